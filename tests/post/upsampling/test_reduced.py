"""Pipelines whose stages run at half resolution."""

from __future__ import annotations

import boxes
import pytest
import torch

from gbufrt import Frame, Pass, Pipeline
from post import GTAO, SSGI, Reduced, Temporal, me1


class Note(Pass):
    """Writes a channel of the G-buffer under another name, and notes the size of what it saw."""

    reads = frozenset({"depth"})

    def __init__(self, *, signal: str = "ao") -> None:
        super().__init__()
        self.signal, self.writes, self.seen = signal, frozenset({signal}), []

    def forward(self, frame: Frame) -> Frame:
        self.seen.append(frame)
        return frame.write(self.signal, frame.gbuffer.depth / 100)


def still() -> Frame:
    return boxes.frame(boxes.camera((48, 64)))


def test_stages_see_every_second_pixel_and_what_they_write_comes_back():
    note, frame = Note(), still()
    result, _ = Pipeline(light=Pipeline(reduction=Reduced(), note=note))(frame)
    assert note.seen[0].gbuffer.camera.size == (24, 32)
    assert result.read("ao").shape == (1, 1, 48, 64)
    hit = frame.gbuffer.hit[..., ::2, ::2]
    torch.testing.assert_close(result.read("ao")[..., ::2, ::2][hit], frame.gbuffer.depth[..., ::2, ::2][hit] / 100)
    assert bool((result.read("ao")[~frame.gbuffer.hit] == 1).all()), "the sky is open"
    assert result.gbuffer is frame.gbuffer


@pytest.mark.parametrize("further", [(), ("albedo", "radiance", "mine", "behind")])
def test_stages_see_only_what_one_of_them_names(further: tuple[str, ...]):
    note, other, frame = Note(), Note(signal="mine"), still().write("mine", torch.rand(1, 1, 48, 64))
    note.optional, given = frozenset(further), frame.write("yours", torch.rand(1, 1, 48, 64))
    given = given.replace(behind=frame, previous=frame.replace(gi=torch.rand(1, 3, 48, 64)))
    first, second = (Pipeline(reduction=Reduced(), note=one) for one in (note, other))
    result, _ = Pipeline(first=first, second=second)(given)
    seen = note.seen[0]
    assert set(seen.present) == {"depth", "hit", "normal", "mine", *further} - {"behind"}
    assert (seen.behind is not None) == ("behind" in further)
    assert seen.previous is not None
    assert set(seen.previous.present) == set(seen.present)
    assert {"albedo", "yours", "radiance"} <= set(result.present), "the whole frame keeps all"


def test_neighbours_share_the_smaller_frame_and_see_what_the_others_wrote():
    first, second, third = Note(), Note(signal="sky_visibility"), Note(signal="mine")
    stages = {"a": first, "b": second, "c": third}
    halves = {name: Pipeline(reduction=Reduced(), note=note) for name, note in stages.items()}
    pipeline = Pipeline(given=(), layer=None, reduction=None, **halves)
    result, _ = pipeline(still())
    assert second.seen[0].ao is not None
    assert second.seen[0].gbuffer is first.seen[0].gbuffer
    assert {"ao", "sky_visibility"} <= pipeline.writes
    assert "mine" not in pipeline.writes
    assert "mine" not in result.present
    named = Pipeline(c=Pipeline(reduction=Reduced(extra=("mine",)), note=third))
    assert "mine" in named.writes
    assert named(still())[0].read("mine").shape == (1, 1, 48, 64)


class Against(Pass):
    """Bent normals that point left and right in turn, so that they cancel between pixels."""

    writes = frozenset({"bent_normal"})

    def forward(self, frame: Frame) -> Frame:
        turn = torch.ones_like(frame.gbuffer.depth)
        turn[..., ::2] = -1
        turn[..., 1::2, :] *= -1
        return frame.write("bent_normal", turn * torch.tensor([1.0, 0.0, 0.0])[:, None, None])


def test_unit_vectors_come_back_with_unit_length():
    frame = still()
    found = Pipeline(light=Pipeline(reduction=Reduced(), against=Against()))(frame)[0].read("bent_normal")
    hit, length = frame.gbuffer.hit, found.norm(dim=1, keepdim=True)
    torch.testing.assert_close(length[hit], torch.ones_like(length[hit]))
    same = (found == frame.gbuffer.normal).all(dim=1, keepdim=True) & hit
    assert int(same.sum()) > 100, "where directions cancel, the normal is the least wrong"


def test_a_stage_may_not_read_what_does_not_come_back():
    half = Pipeline(reduction=Reduced(), ao=GTAO(), accumulate=Temporal(signal="ao"))
    assert half.writes == {"ao", "bent_normal"}

    class Reader(Note):
        reads = frozenset({"ao_history"})

    with pytest.raises(ValueError, match="reads 'ao_history', but no stage before it writes that"):
        Pipeline(light=half, reader=Reader())


def test_a_stride_is_positive():
    with pytest.raises(ValueError, match="stride must be at least 1, got 0"):
        Reduced(stride=0)


def test_the_layer_behind_is_reduced_alike():
    note, frame = Note(), still()
    layer = Pipeline(layer="behind", reduction=Reduced(), note=note)
    result, _ = Pipeline(behind=layer)(frame.replace(behind=still()))
    assert note.seen[0].gbuffer.camera.size == (24, 32)
    assert result.behind is not None
    assert result.behind.read("ao").shape == (1, 1, 48, 64)
    assert result.ao is None
    assert Pipeline(behind=layer)(frame)[0].behind is None


def test_copies_keep_the_reduction():
    pipeline = me1("low").with_tunables({"ssr.samples": 1}).without("gi.denoise")
    for name in ("ao", "gi", "reflection", "behind"):
        stage = pipeline.stages[name]
        assert isinstance(stage, Pipeline)
        assert stage.place.reduction == Reduced(3)


def test_accumulation_at_half_resolution_goes_on_over_frames():
    frame, errors = still(), []
    many = Pipeline(ao=GTAO(directions=16, steps=16))(frame)[0].read("ao")
    half = Pipeline(
        reduction=Reduced(), ao=GTAO(directions=1, steps=8), accumulate=Temporal(signal=("ao", "bent_normal"))
    )
    state, result = None, frame
    for i in range(12):
        result, state = Pipeline(ao=half)(frame.replace(index=i), state)
        errors.append(float((result.read("ao") - many).square().mean().sqrt()))
    assert errors[-1] < 0.75 * errors[0]
    assert errors[-1] < 0.05
    length = result.read("bent_normal").norm(dim=1, keepdim=True)[frame.gbuffer.hit]
    torch.testing.assert_close(length, torch.ones_like(length))


def test_indirect_light_keeps_albedo_of_every_pixel():
    frame = still()
    g = frame.gbuffer
    assert g.albedo is not None
    checks = (torch.arange(64) % 2 == 0).float().mul(0.6).add(0.2).expand_as(g.albedo)
    frame = frame.replace(gbuffer=g.replace(albedo=torch.where(g.hit, checks, 0.0)))
    full, half = (
        Pipeline(gi=Pipeline(reduction=r, gi=SSGI(directions=8, steps=12, bounces=1)))(frame)[0].read("gi")
        for r in (None, Reduced())
    )
    error, columns = (half - full).abs().mean(), (full[..., ::2].mean() - full[..., 1::2].mean()).abs()
    assert float(error) < 0.2 * float(columns)


def test_gradients_pass():
    frame = still()
    light = frame.read("radiance").clone().requires_grad_()
    stage = Pipeline(reduction=Reduced(), gi=SSGI(directions=1, steps=4))
    result, _ = Pipeline(gi=stage)(frame.replace(radiance=light))
    result.read("gi").sum().backward()
    assert light.grad is not None
    assert float(light.grad.abs().sum()) > 0
