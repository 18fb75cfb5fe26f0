"""Temporal accumulation."""

# pyright: reportPossiblyUnboundVariable=false

from __future__ import annotations

from typing import Any

import boxes
import pytest
import torch
from accumulated import SIZE, noisy, rms, still, truth_of
from torch import Tensor

from gbufrt import Camera, Pipeline
from post.passes.denoising.atrous import Atrous
from post.passes.denoising.temporal import Temporal, temporal


@pytest.mark.parametrize("kind", ["gauss", "exponential", "rare"])
def test_still_scene_converges_as_one_over_root_n(kind):
    _, errors = still(Temporal(blend=1.0), 64, kind)
    for n in (4, 16, 64):
        assert rms(errors[n - 1]) * n**0.5 == pytest.approx(rms(errors[0]), rel=0.12)


@pytest.mark.parametrize("kind", ["gauss", "rare"])
def test_error_reaches_the_floor_that_blend_sets_and_does_not_drift(kind):
    _, errors = still(Temporal(), 500, kind, boxes.frame(boxes.camera((24, 32))))
    floor = (0.05 / 1.95) ** 0.5 * rms(errors[0])
    late = [rms(e) for e in errors[100::50]]
    assert all(value == pytest.approx(floor, rel=0.12) for value in late)
    many = torch.stack(errors[100::20]).mean(0)
    assert abs(float(many.mean())) < 0.02, "no bias: what noise does is not taken for a change of light"


def test_variance_tells_the_error():
    for kind, frames in (("gauss", 1), ("gauss", 12), ("exponential", 60)):
        out, errors = still(Temporal(), frames, kind)
        variance = float(out.read("ao_variance")[out.gbuffer.hit].mean())
        assert variance == pytest.approx(rms(errors[-1]) ** 2, rel=0.2), (kind, frames)


def test_a_variance_that_nobody_wants_changes_nothing_else():
    """Nor is it missed where feedback needs it."""
    for feedback in (False, True):
        told, untold = (still(Temporal(feedback=feedback, variance=told), 3, "gauss")[0] for told in (True, False))
        assert torch.equal(told.read("ao"), untold.read("ao"))
        assert set(told.present) - set(untold.present) == {"ao_variance"}


def test_first_frame_passes_through():
    frame = noisy(boxes.frame(boxes.camera(SIZE)), torch.Generator().manual_seed(1))
    out, state = Temporal()(frame)
    assert torch.equal(out.read("ao"), frame.read("ao"))
    assert bool((out.read("ao_history") == 1).all())
    assert bool((state.length == 1).all())


def test_change_of_light_is_followed():
    """The light halves; without the fast history it would take 14 frames to come half way."""
    frame, state = boxes.frame(boxes.camera(SIZE)), None
    generator, hit = torch.Generator().manual_seed(3), frame.gbuffer.hit
    stages = {"on": Temporal(), "off": Temporal(clamp=0.0)}
    left = {}
    for name, stage in stages.items():
        state = None
        for step in range(44):
            lit = noisy(frame, generator)
            lit = lit.replace(ao=lit.read("ao") * (1.0 if step < 40 else 0.3))
            out, state = stage(lit, state)
        left[name] = float((out.read("ao") - 0.3 * truth_of(frame))[hit].mean() / truth_of(frame)[hit].mean())
    assert left["off"] > 0.5
    assert abs(left["on"]) < 0.2


def test_moving_shadow_leaves_no_trail():
    frame, state = boxes.frame(boxes.camera(SIZE), boxes=boxes.ROOM[:1]), None
    x = torch.arange(SIZE[1])
    for step in range(20):
        frame = frame.replace(ao=torch.where((x - step).remainder(48) < 10, 0.1, 0.9).expand(1, 1, *SIZE).clone())
        out, state = Temporal()(frame, state)
    gone = (x >= 5) & (x <= 14)  # in shadow 5 to 14 frames ago
    assert float((out.read("ao") - frame.read("ao")).abs()[..., gone].mean()) < 0.12


@pytest.mark.parametrize("after", [1, 3, 11])  # frames: a history too young for a variance of its own cuts as well
def test_firefly_is_cut_and_detail_is_not(after: int):
    frame = boxes.frame(boxes.camera(SIZE), boxes=boxes.ROOM[:1])
    state, generator = None, torch.Generator().manual_seed(4)
    dot = torch.zeros_like(frame.gbuffer.depth)
    dot[..., 25, 25] = 3.0
    for step in range(after + 1):
        lit = frame.replace(ao=0.5 + dot + 0.05 * torch.randn(dot.shape, generator=generator))
        if step == after:
            spike = lit.read("ao").clone()
            spike[..., 28, 12] = 1000.0
            lit = lit.replace(ao=spike)
        out, state = Temporal()(lit, state)
    assert float(out.read("ao")[..., 28, 12]) < 1.0
    assert float(out.read("ao")[..., 25, 25]) == pytest.approx(3.5, abs=0.1), "a lone bright pixel that stays is detail"


def test_cut_resets_its_batch_element_alone():
    one = boxes.frame(boxes.camera(SIZE)).gbuffer
    camera = Camera(
        intrinsics=one.camera.intrinsics.repeat(2, 1, 1),
        world_from_view=one.camera.world_from_view.repeat(2, 1, 1),
        size=SIZE,
        far=one.camera.far,
    )
    frame = boxes.frame(camera)
    pipeline, state = Pipeline(given={"ao"}, accumulate=Temporal()), None
    for step in range(4):
        cut = torch.tensor([False, True]) if step == 3 else None
        given = torch.full_like(frame.gbuffer.depth, float(step))
        out, state = pipeline(frame.replace(ao=given, cut=cut), state)
    assert bool((out.read("ao_history")[1] == 1).all())
    assert bool((out.read("ao")[1] == 3).all())
    assert bool((out.read("ao_history")[0] > 1).all())


def test_signals_share_weights_and_unit_vectors_keep_their_length():
    frame = boxes.frame(boxes.camera(SIZE))
    g, state, generator = frame.gbuffer, None, torch.Generator().manual_seed(6)
    for _ in range(24):
        lit = noisy(frame, generator)
        shaken = g.normal + 0.4 * torch.randn(g.normal.shape, generator=generator)
        lit = lit.replace(bent_normal=torch.where(g.hit, shaken / shaken.norm(dim=1, keepdim=True), 0.0))
        out, state = Temporal(signal=("ao", "bent_normal"))(lit, state)
    bent = out.read("bent_normal")
    assert torch.allclose(bent.norm(dim=1, keepdim=True)[g.hit], torch.ones(()), atol=1e-4)
    assert float((bent * g.normal).sum(1, keepdim=True)[g.hit].mean()) > 0.985
    assert rms((out.read("ao") - truth_of(frame))[g.hit]) < 0.08


def test_with_wavelets_behind_it_beats_each_alone():
    frame, state, generator = boxes.frame(boxes.camera((48, 64))), None, torch.Generator().manual_seed(7)
    pipeline = Pipeline(given={"ao"}, accumulate=Temporal(), denoise=Atrous(signal="ao"))
    for _ in range(12):
        lit = noisy(frame, generator)
        out, state = pipeline(lit, state)
    accumulated, _ = still(Temporal(), 12, frame=frame)
    alone = Atrous(signal="ao")(lit)
    hit, truth = frame.gbuffer.hit, truth_of(frame)
    both, time, space = (rms((f.read("ao") - truth)[hit]) for f in (out, accumulated, alone))
    assert both < 0.4 * min(time, space)


def test_feedback_keeps_less_noise_in_the_history():
    left = {f: rms(still(Temporal(feedback=f), 10)[1][-1]) for f in (False, True)}
    assert left[True] < 0.5 * left[False]


@pytest.mark.parametrize("case", ["orthographic", "odd", "sky", "pixel", "double"])
def test_awkward_frames(case):
    size = {"odd": (127, 73), "pixel": (1, 1)}.get(case, (24, 32))
    state, previous, generator = None, None, torch.Generator().manual_seed(8)
    for step in range(4):
        camera = boxes.camera(size, orthographic=case == "orthographic", dx=0.1 * step)
        world = boxes.ROOM + 500 if case == "sky" else boxes.ROOM
        frame = noisy(boxes.frame(camera, previous=previous, boxes=world), generator)
        frame = frame.to(torch.float64) if case == "double" else frame
        out, state = Temporal()(frame, state)
        assert out.read("ao").dtype == frame.read("ao").dtype
        assert bool(torch.isfinite(out.read("ao")).all())
        previous = frame.gbuffer.camera
    assert float(out.read("ao_history").mean()) > 2 or case == "pixel"


def test_module_equals_function():
    frame = noisy(boxes.frame(boxes.camera(SIZE)), torch.Generator().manual_seed(9))
    state, history = None, None
    for _ in range(3):
        out, state = Temporal()(frame, state)
        mean, history = temporal(frame.read("ao"), frame.gbuffer, history)
    assert torch.equal(torch.where(frame.gbuffer.hit, mean, frame.read("ao")), out.read("ao"))


def test_gradients():
    frame = boxes.frame(boxes.camera((4, 4)), boxes=boxes.ROOM[:1]).to(torch.float64)
    g = frame.gbuffer
    before, now = (torch.rand(g.depth.shape, dtype=torch.float64) + 0.5 for _ in range(2))
    inputs = (before.requires_grad_(), now.requires_grad_())

    def run(first: Tensor, second: Tensor) -> Tensor:
        _, history = temporal(first, g)
        return temporal(second, g, history)[0]

    assert torch.autograd.gradcheck(run, inputs, fast_mode=True)
    (run(*inputs) ** 2).sum().backward()
    assert all(t.grad is not None and float(t.grad.abs().max()) > 1e-3 for t in inputs)


def test_errors_help():
    frame = noisy(boxes.frame(boxes.camera((12, 16))), torch.Generator())
    ao, g = frame.read("ao"), frame.gbuffer
    with pytest.raises(ValueError, match="blend must lie in 0 to 1, got 2"):
        temporal(ao, g, blend=2)
    _, history = temporal(ao, g)
    with pytest.raises(ValueError, match="the history holds 1 channels but the signal has 2"):
        temporal(torch.cat([ao, ao], dim=1), g, history, lead=1)
    with pytest.raises(ValueError, match="start with state=None"):
        temporal(torch.ones(1, 1, 3, 4), boxes.frame(boxes.camera((3, 4))).gbuffer, history)


def test_what_is_cut_is_not_followed_as_well():
    """Of light that one sample in twenty brings, mean and cuts hold all; noise that seems a change adds some."""
    g = boxes.frame(boxes.camera((36, 48)), boxes=boxes.ROOM[:1]).gbuffer
    generator, history, sums = torch.Generator().manual_seed(1), None, []
    options: dict[str, Any] = {"blend": 0.97, "clamp": 1.5, "firefly": 2.5, "sharp": True, "excess": True}
    for _ in range(40):
        light = (torch.rand(g.depth.shape, generator=generator) < 0.05) * 20.0
        mean, history = temporal(light.expand(-1, 3, -1, -1), g, history, **options)
        sums.append(float((mean[:, :1] + history.signals["excess"])[g.hit].mean()))
    assert sum(sums[20:]) / 20 == pytest.approx(1.0, abs=0.08)


def test_what_the_history_holds_too_is_in_memory_once():
    """Without gradients, and for one element of a batch; what nothing was hit by keeps its value."""
    frame = boxes.frame(boxes.camera((8, 10)))
    hit = torch.rand_like(frame.gbuffer.depth) > 0.3
    frame = frame.replace(gbuffer=frame.gbuffer.replace(hit=hit), reflection=torch.rand_like(frame.gbuffer.normal))
    frame = frame.replace(reflection_confidence=torch.rand_like(frame.gbuffer.depth))
    accumulate, state, copies = Temporal(signal="reflection"), None, None
    light = frame.read("reflection")
    for index in range(3):
        given = frame.replace(index=index, reflection=light * (1 + index))
        expected, copies = accumulate(given, copies)
        with torch.no_grad():
            found, state = accumulate(given, state)
        for name in ("reflection", "reflection_confidence"):
            assert torch.equal(found.read(name), expected.read(name))
            assert found.read(name).untyped_storage().data_ptr() == state.length.untyped_storage().data_ptr()
            assert torch.equal(found.read(name).where(~hit, 0), given.read(name).where(~hit, 0))


@pytest.mark.parametrize("level", [0.1, 0.3])
def test_light_that_changes_by_less_than_its_noise_is_followed(level):
    """Over few pixels noise explains it: histories that compared 3x3 of them left 0.95 of the change."""
    g, generator, history = boxes.frame(boxes.camera(SIZE)).gbuffer, torch.Generator().manual_seed(1), None
    for now in [1.0] * 20 + [level]:
        light = -now * torch.rand(g.depth.shape, generator=generator).clamp_min(1e-9).log()
        mean, history = temporal(light, g, history, firefly=0.0)
    assert float((mean[g.hit].mean() - level) / (1 - level)) < 0.4
