"""Joint bilateral upsampling: the kernel against the reference, and what neither may do."""

from __future__ import annotations

import boxes
import pytest
import torch
from torch import Tensor

from gbufrt import Camera
from post.filters.edges import Surface
from post.filters.surfaces import surface
from post.upsampling.op import upsample, upsample_cpu


def geometry(camera: Camera) -> Surface:
    g = boxes.frame(camera).gbuffer
    return surface(g.depth, g.normal, g.hit, g.camera)


def samples(like: Tensor, stride: int, offset: tuple[int, int], channels: int = 3) -> Tensor:
    low = like[..., offset[0] :: stride, offset[1] :: stride]
    return torch.rand(low.shape[0], channels, *low.shape[2:], generator=torch.Generator().manual_seed(3))


@pytest.mark.parametrize("case", ["perspective", "orthographic", "odd", "one pixel", "jittered"])
@pytest.mark.parametrize(("stride", "offset"), [(2, (0, 0)), (2, (1, 0)), (3, (1, 2))])
def test_kernel_equals_reference(case: str, stride: int, offset: tuple[int, int]):
    size = {"odd": (73, 127), "one pixel": (1, 1)}.get(case, (48, 64))
    offset = (0, 0) if case == "one pixel" else offset
    camera = boxes.camera(size, orthographic=case == "orthographic")
    whole = geometry(camera.with_jitter((0.3, -0.4)) if case == "jittered" else camera)
    low = samples(whole.guide, stride, offset)
    options = {"stride": stride, "offset": offset, "clear": (0.5, 1.0, 2.0)}
    got, want = (upsample(low, whole, **options, compiled=form) for form in (True, False))
    torch.testing.assert_close(got, want, rtol=1e-4, atol=1e-4)
    sky = ~whole.hit.expand_as(got)
    assert torch.equal(got[sky], torch.tensor([0.5, 1.0, 2.0])[None, :, None, None].expand_as(got)[sky])


@pytest.mark.parametrize("compiled", [True, False])
def test_samples_keep_their_values_and_objects_theirs(compiled: bool):
    g = boxes.frame(boxes.camera((48, 64))).gbuffer
    assert g.material_id is not None
    value, whole = g.material_id.float(), surface(g.depth, g.normal, g.hit, g.camera)
    found = upsample(value[..., ::2, ::2], whole, compiled=compiled)
    at = g.hit[..., ::2, ::2]
    torch.testing.assert_close(found[..., ::2, ::2][at], value[..., ::2, ::2][at])
    assert float(((found - value).abs() > 0.05).float().mean()) < 0.03


def test_a_linear_signal_on_a_plane_comes_back():
    camera = boxes.camera((48, 64))
    g = boxes.frame(camera, boxes=boxes.ROOM[:1]).gbuffer
    px = camera.pixel_centers()
    found = upsample(px[..., ::2, ::2], surface(g.depth, g.normal, g.hit, camera))
    inner = g.hit.clone()
    inner[..., :24, :], inner[..., -2:, :], inner[..., -2:] = False, False, False  # the horizon, and beyond the last
    error = (found - px).abs()[inner.expand_as(found)]
    assert float(error.mean()) < 0.02
    assert float(error.max()) < 0.3


@pytest.mark.parametrize("compiled", [True, False])
def test_a_thin_thing_between_samples_takes_from_its_own_farther_away(compiled: bool):
    """A column one pixel wide, of which only every fourth row has a sample that shows it."""
    normal = torch.tensor([0.0, 0.0, 1.0]).view(1, 3, 1, 1).expand(1, 3, 16, 16).contiguous()
    camera = Camera.look_at((0.0, 0.0, 9.0), (0.0, 0.0, 0.0), size=(16, 16))
    depth = torch.full((1, 1, 16, 16), 9.0)
    depth[..., 7] = 2.0
    depth[..., ::4, 6] = 2.0  # at samples
    near = (depth < 9.0).float()
    whole = surface(depth, normal, torch.ones_like(depth, dtype=torch.bool), camera)
    found = upsample(near[..., ::2, ::2], whole, compiled=compiled)
    assert float(found[..., 7].min()) > 0.99
    assert float(found[..., 8:].max()) < 0.01


@pytest.mark.parametrize("compiled", [True, False])
def test_another_surface_is_better_than_nothing(compiled: bool):
    whole = geometry(boxes.camera((24, 32)))
    lonely = Surface(whole.guide.clone(), whole.plane, whole.perspective)
    lonely.guide[:, 0, 13, 15] = 3.0  # in front of everything around
    found = upsample(torch.full((1, 1, 12, 16), 0.7), lonely, compiled=compiled)
    assert float(found[..., 13, 15]) == pytest.approx(0.7, abs=1e-4)


def test_gradients_reach_samples_and_depth():
    camera = boxes.camera((12, 16))
    g = boxes.frame(camera).gbuffer
    depth = g.depth.double().requires_grad_()
    low = samples(g.depth, 2, (0, 0)).double().requires_grad_()
    found = upsample(low, surface(depth, g.normal.double(), g.hit, camera))
    found.square().sum().backward()
    for tensor in (low, depth):
        assert tensor.grad is not None
        assert torch.isfinite(tensor.grad).all()
        assert float(tensor.grad.abs().sum()) > 0


def test_number_of_threads_changes_nothing():
    whole, before = geometry(boxes.camera((73, 127))), torch.get_num_threads()
    low, found = samples(whole.guide, 2, (0, 0)), []
    try:
        for count in (1, 2):
            torch.set_num_threads(count)
            found.append(upsample(low, whole, compiled=True))
    finally:
        torch.set_num_threads(before)
    assert torch.equal(*found)


def test_operator_is_registered_properly():
    whole = geometry(boxes.camera((6, 8)))
    low = samples(whole.guide, 2, (0, 0))
    given = (low, whole.guide, whole.plane, torch.zeros(3), 2, 0, 0, True)
    torch.library.opcheck(upsample_cpu, given, test_utils=("test_schema", "test_faketensor"))
