"""Stairs get closer to the area-sampled truth; what is not an edge stays as it was."""

from __future__ import annotations

import boxes
import pytest
import torch
from torch import Tensor

from post.passes.display.fxaa import FXAA, fxaa


def picture(supersample: int, size: int = 96) -> Tensor:
    """A slanted line, a steep line and a disc, at ``supersample`` times the size; ``(1, 3, ...)``."""
    axis = (torch.arange(size * supersample) + 0.5) / supersample
    y, x = torch.meshgrid(axis, axis, indexing="ij")
    luma = torch.where(y - 20 - 0.13 * x > 0, 0.8, 0.2)
    luma = torch.where(x - 60 - 0.3 * y > 0, 0.9, luma)
    luma = torch.where((x - 40) ** 2 + (y - 65) ** 2 < 18**2, 0.05, luma)
    return luma[None, None].expand(1, 3, -1, -1).contiguous()


def rmse(a: Tensor, b: Tensor) -> float:
    return float((a - b).square().mean().sqrt())


@pytest.mark.parametrize("turn", [0, 1])
def test_closer_to_area_sampling(turn):
    aliased = picture(1).rot90(turn, (2, 3))
    truth = torch.nn.functional.avg_pool2d(picture(8), 8).rot90(turn, (2, 3))
    assert rmse(fxaa(aliased), truth) < 0.5 * rmse(aliased, truth)


def test_flat_and_faint_pictures_are_untouched():
    flat = torch.full((2, 3, 9, 11), 0.4)
    assert torch.equal(fxaa(flat), flat)
    faint = flat + 0.01 * torch.rand(flat.shape)
    assert torch.equal(fxaa(faint), faint)


def test_axis_aligned_edges_stay_sharp():
    step = torch.full((1, 3, 16, 16), 0.2)
    step[..., 8:] = 0.8
    assert rmse(fxaa(step, subpixel=0.0), step) < 1e-6


def test_isolated_pixels_fade():
    spot = torch.zeros(1, 3, 9, 9)
    spot[..., 4, 4] = 1.0
    assert 0.2 < float(fxaa(spot, subpixel=1.0)[0, 0, 4, 4]) < 0.8


def test_gradient_reaches_the_picture():
    image = (picture(1, 12).double() + 0.01 * torch.rand(1, 3, 12, 12, dtype=torch.float64)).requires_grad_()
    assert torch.autograd.gradcheck(lambda i: fxaa(i)[..., 2:6, 2:6], (image,), atol=1e-4)
    (gradient,) = torch.autograd.grad(fxaa(image).sum(), image)
    assert gradient.abs().min() > 0


def test_module_is_the_function():
    frame = boxes.frame(boxes.camera((24, 32)))
    assert frame.radiance is not None
    frame = frame.replace(image=frame.radiance.clamp(0, 1))
    assert torch.equal(FXAA(subpixel=0.3)(frame).read("image"), fxaa(frame.read("image"), subpixel=0.3))


@pytest.mark.parametrize("bad", [torch.nan, torch.inf, -torch.inf])
def test_a_pixel_that_is_not_finite_spreads_nothing(bad):
    picture = torch.rand(1, 3, 8, 8)
    picture[0, :, 4, 4] = bad
    assert bool(fxaa(picture).isfinite().all())


def test_wrong_shape():
    with pytest.raises(ValueError, match=r"image must be \(B,3,H,W\)"):
        fxaa(torch.zeros(1, 1, 4, 4))
