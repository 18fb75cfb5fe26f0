"""Light that is not finite is mended and counted; geometry is refused, or held to its pixel."""

from __future__ import annotations

import boxes
import pytest
import torch
from torch import Tensor

from gbufrt import Frame
from gbufrt.mending import Mended, contained, finite, held, mended, remember, remembering
from gbufrt.reduction import every_nth
from post.filters.signals import stack


def put(tensor: Tensor, *values: float) -> Tensor:
    """One value a pixel, from row 40, column 50 on."""
    changed = tensor.clone()
    for i, value in enumerate(values):
        changed[0, 0, 40, 50 + i] = value
    return changed


def with_channel(frame: Frame, name: str, tensor: Tensor) -> Frame:
    return frame.replace(gbuffer=frame.gbuffer.replace(**{name: tensor}))


def test_good_frames_come_back_themselves():
    frame = boxes.frame()
    frame = frame.replace(behind=boxes.frame())
    assert mended(frame) == (frame, ())
    assert contained(frame, frame.present) is frame
    huge = torch.full((1, 3, 4, 4), 3e38)
    assert finite(huge) is huge, "its sum overflows, but every pixel is finite"
    ids = torch.ones(1, 1, 2, 2, dtype=torch.int32)
    assert finite(ids) is ids


def test_light_is_mended_and_counted():
    frame = boxes.frame()
    brightest = float(frame.read("radiance").max())
    bad = frame.replace(radiance=put(frame.read("radiance"), torch.nan, torch.inf, -torch.inf, torch.nan))
    bad = with_channel(bad, "emission", put(frame.read("emission"), torch.inf))
    result, report = mended(bad.replace(behind=bad).write("glow", put(frame.gbuffer.depth, torch.nan)))
    values = result.read("radiance")[0, 0, 40, 50:54].tolist()
    assert values == [0.0, brightest, 0.0, 0.0]
    unchanged = torch.isfinite(bad.read("radiance"))
    assert torch.equal(result.read("radiance")[unchanged], frame.read("radiance")[unchanged])
    assert float(result.read("emission").max()) == 0.0, "where nothing else is lit, infinity is taken back to nothing"
    radiance = Mended(channel="radiance", pixels=4, nan=2, largest=brightest)
    emission = Mended(channel="emission", pixels=1, nan=0, largest=0.0)
    assert report[:3] == (emission, radiance, Mended(channel="glow", pixels=1, nan=1, largest=None))
    assert [row.channel for row in report[3:]] == ["behind.emission", "behind.radiance"]
    assert str(radiance) == f"radiance: 4 pixels (2 NaN to 0, 2 infinite to {brightest:.4g})"
    assert torch.isnan(bad.read("radiance")).any(), "the input is left alone"
    result.validate()


@pytest.mark.parametrize("name", ["depth", "normal", "normal_geo", "motion", "roughness", "thickness"])
def test_geometry_is_refused_and_counted(name):
    frame = boxes.frame()
    bad = with_channel(frame, name, put(frame.read(name), torch.nan, torch.inf))
    with pytest.raises(ValueError, match=f"^{name} must be finite, but 2 pixels are not, such as nan at .*render"):
        mended(bad)
    with pytest.raises(ValueError, match=f"^behind.{name} must be finite"):
        mended(frame.replace(behind=bad))


def test_elements_of_a_batch_are_mended_apart():
    light = torch.stack([torch.full((3, 4, 4), 2.0), torch.full((3, 4, 4), 7.0), torch.full((3, 4, 4), torch.inf)])
    light[0, 1, 2, 3], light[1, 0, 0, 0] = torch.inf, torch.inf
    found = finite(light)
    assert found.amax((1, 2, 3)).tolist() == [2.0, 7.0, 0.0]
    assert torch.equal(found[:2], finite(light[:2]))


def test_gradients_pass_beside_what_was_mended():
    light = torch.tensor([1.0, torch.nan, 3.0, torch.inf], requires_grad=True)
    finite(light.reshape(1, 1, 2, 2)).sum().backward()
    assert light.grad is not None
    assert light.grad.tolist() == [1.0, 0.0, 1.0, 0.0]


@pytest.mark.parametrize("name", ["depth", "normal", "normal_geo"])
@pytest.mark.parametrize("value", [torch.nan, torch.inf, -torch.inf])
def test_pixels_without_geometry_are_misses(name, value):
    frame = boxes.frame()
    bad = with_channel(frame, name, put(frame.read(name), value))
    found = contained(bad, ("depth", "normal", "normal_geo")).gbuffer
    found.validate()
    assert not found.hit[0, 0, 40, 50]
    assert float(found.depth[0, 0, 40, 50]) == found.camera.far
    assert int((found.hit != frame.gbuffer.hit).sum()) == 1
    for channel in found.present:
        same = getattr(found, channel) == getattr(frame.gbuffer, channel)
        assert int((~same).any(1).sum()) <= 1, channel
    depth, hit, normal = held(bad.gbuffer.depth, bad.gbuffer.hit, bad.gbuffer.normal, 100.0)
    if name != "normal_geo":
        assert torch.equal(hit, found.hit)
        assert torch.equal(depth, found.depth)
        assert torch.equal(normal, found.normal)


def test_materials_and_signals_take_their_clear_values():
    frame = boxes.frame().replace(ao=torch.full_like(boxes.frame().gbuffer.depth, 0.5))
    bad = frame.replace(ao=put(frame.read("ao"), torch.nan, torch.inf))
    bad = with_channel(bad, "roughness", put(frame.read("roughness"), torch.nan))
    bad = with_channel(bad, "motion", put(frame.read("motion") + 2, torch.nan))
    found = contained(bad.replace(behind=bad, previous=bad), ("ao", "roughness", "motion"))
    for layer in (found, found.behind, found.previous):
        assert layer is not None
        assert layer.read("ao")[0, 0, 40, 50:53].tolist() == [1.0, 1.0, 0.5]
        assert float(layer.read("roughness")[0, 0, 40, 50]) == 1.0
        assert layer.read("motion")[0, :, 40, 50].tolist() == [0.0, 0.0], "both components, or neither"
        assert torch.equal(layer.gbuffer.hit, frame.gbuffer.hit)
    assert contained(bad, ("depth", "radiance")) is bad, "what a pass does not read is not its concern"


@pytest.fixture
def looked(monkeypatch: pytest.MonkeyPatch) -> list[Tensor]:
    """The tensors whose sums were taken."""
    seen, whole = list[Tensor](), Tensor.sum
    monkeypatch.setattr(Tensor, "sum", lambda tensor, *args, **kwargs: seen.append(tensor) or whole(tensor, *args))
    return seen


def test_what_is_known_is_not_looked_at_again(looked: list[Tensor]):
    frame = boxes.frame()
    looked.clear()
    with remembering(frame, ("depth", "radiance")):
        assert len(looked) == 2
        contained(frame, ("depth", "radiance"))
        assert len(looked) == 2
        contained(frame, ("depth", "radiance", "normal"))
        assert len(looked) == 3
        contained(every_nth(frame, 2), ("depth", "radiance", "normal"))
        assert len(looked) == 3, "part of what is known is known"
        contained(frame, ("radiance", "ambient"))
        looked.clear()
        finite(stack(frame, ("radiance", "ambient")))
        assert not looked, "what is known side by side is known"
        bad = frame.replace(radiance=put(frame.read("radiance"), torch.nan))
        assert bool(torch.isfinite(contained(bad, ("depth", "radiance")).read("radiance")).all())
    looked.clear()
    contained(frame, ("depth", "radiance"))
    assert len(looked) == 2, "nothing is known outside"


def test_one_bad_channel_leaves_the_others_known(looked: list[Tensor]):
    frame = boxes.frame()
    bad = frame.replace(radiance=put(frame.read("radiance"), torch.nan))
    with remembering(bad, ("depth", "radiance")):
        looked.clear()
        contained(bad, ("depth",))
        assert not looked
        assert bool(torch.isfinite(contained(bad, ("depth", "radiance")).read("radiance")).all())


def test_the_frame_before_is_known_until_something_is_written_into_it(looked: list[Tensor]):
    before = boxes.frame()
    frame = boxes.frame().replace(previous=before)
    with remembering(before, ("depth", "radiance")):
        remember(before)
    for times in (2, 3):  # the second time, after a write
        looked.clear()
        with remembering(frame, ("depth", "radiance")):
            assert len(looked) == times
            clean = contained(frame, ("depth", "radiance")).previous
            assert clean is not None
            assert bool(torch.isfinite(clean.read("radiance")).all())
        before.read("radiance")[0, 0, 0, 0] = torch.nan
