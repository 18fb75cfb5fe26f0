"""Reads of pictures as means over squares, in which edges stay."""

from __future__ import annotations

import pytest
import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt.sampling import pixel_centers, sample
from post.history.catmull_rom import catmull_rom
from post.upsampling.remap import remapped


def moved(image: Tensor, dx: float, dy: float = 0.0) -> Tensor:
    return pixel_centers(image) + torch.tensor([dx, dy]).view(1, 2, 1, 1)


def noise(*size: int) -> Tensor:
    return torch.rand(size, generator=torch.Generator().manual_seed(1))


def edge(at: float) -> Tensor:
    """Means over pixels of what is 1 left of a vertical edge, 0 right of it."""
    return (at - torch.arange(24.0)).clamp(0, 1).expand(1, 1, 8, 24)


def test_pixels_are_read_as_they_are():
    white = noise(1, 3, 12, 16)
    torch.testing.assert_close(remapped(white, moved(white, 0, 0)), white)
    assert torch.equal(remapped(white[..., :1, :1], moved(white, 0.3, 0.7)), white[..., :1, :1].expand_as(white))


@pytest.mark.parametrize("shift", [0.1, 0.25, 0.5, 0.9])
def test_slopes_are_read_exactly(shift: float):
    ramp = torch.arange(16.0).expand(1, 1, 16, 16) + 3 * torch.arange(16.0)[:, None]
    read = remapped(ramp, moved(ramp, shift, 1 - shift))[..., 3:-3, 3:-3]
    torch.testing.assert_close(read, ramp[..., 3:-3, 3:-3] + shift + 3 * (1 - shift))


def test_light_is_neither_won_nor_lost():
    image = torch.zeros(1, 3, 20, 20)
    image[..., 6:14, 6:14] = noise(1, 3, 8, 8)
    torch.testing.assert_close(remapped(image, moved(image, 0.3, -0.4)).sum((2, 3)), image.sum((2, 3)))


@pytest.mark.parametrize("place", [10.0, 10.3, 10.8])
def test_edges_stay_sharp_however_often_they_move(place: float):
    reads = {"ours": edge(place), "Catmull-Rom": edge(place), "bilinear": edge(place)}
    for _ in range(10):
        there = moved(edge(0), -0.37)
        reads["ours"] = remapped(reads["ours"], there)
        reads["Catmull-Rom"] = catmull_rom(reads["Catmull-Rom"], there)
        reads["bilinear"] = sample(reads["bilinear"], there)
    error = {name: float((read - edge(place + 3.7)).abs().sum(3).mean()) for name, read in reads.items()}
    assert error["ours"] < 0.5 * error["Catmull-Rom"] < 0.5 * error["bilinear"], error


def test_nothing_overshoots():
    image = noise(1, 3, 12, 16) ** 8
    around = F.unfold(F.pad(image, (1, 2, 1, 2), mode="replicate"), 4).view(1, 3, 16, 12, 16)
    read = remapped(image, moved(image, 0.35, 0.6))
    assert bool((read >= around.amin(2) - 1e-6).all())
    assert bool((read <= around.amax(2) + 1e-6).all())


def test_gradients_are_those_of_finite_differences():
    image = noise(1, 1, 5, 6).double().requires_grad_()
    there = moved(image.detach(), 0.3, 0.4)
    assert torch.autograd.gradcheck(lambda picture: remapped(picture, there), image)
    remapped(image, there).sum().backward()
    assert image.grad is not None
    assert float(image.grad.abs().amin()) > 0.0
