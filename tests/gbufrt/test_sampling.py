"""Reading between pixels: +0.5 is a pixel's centre, and the border repeats."""

from __future__ import annotations

import pytest
import torch

from gbufrt.sampling import gather, inside, sample, sample_table, shifted


@pytest.fixture
def ramp() -> torch.Tensor:
    """``(1, 2, 5, 7)``: channel 0 holds x at the pixel's centre, channel 1 y."""
    y, x = torch.meshgrid(torch.arange(5) + 0.5, torch.arange(7) + 0.5, indexing="ij")
    return torch.stack([x, y])[None]


def at(*points: tuple[float, float]) -> torch.Tensor:
    return torch.tensor(points).T.reshape(1, 2, 1, -1)


@pytest.mark.parametrize("mode", ["bilinear", "nearest", "bicubic"])
def test_centres_read_themselves(ramp, mode):
    torch.testing.assert_close(sample(ramp, ramp, mode=mode), ramp, atol=1e-5, rtol=0)


def test_linear_between_centres(ramp):
    px = at((3.2, 1.9), (1.0, 4.1))
    torch.testing.assert_close(sample(ramp, px), px, atol=1e-5, rtol=0)


def test_outside_reads_the_border(ramp):
    got = sample(ramp, at((-3.0, 2.5), (99.0, 99.0)))[0, :, 0].T
    torch.testing.assert_close(got, torch.tensor([[0.5, 2.5], [6.5, 4.5]]))


def test_gradient_reaches_positions_and_pixels(ramp):
    px = (ramp * 0.9).double().requires_grad_()
    image = torch.rand(1, 1, 5, 7, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(lambda i, p: sample(i, p), (image, px))


def test_gather_any_type():
    ids = torch.arange(35, dtype=torch.int32).view(1, 1, 5, 7)
    x, y = torch.tensor([[[0, 6, 99]]]), torch.tensor([[[0, 4, -5]]])
    assert gather(ids, x, y).tolist() == [[[[0, 34, 6]]]]


def test_shifted_is_a_tap(ramp):
    out = shifted(ramp, 2, -1)
    assert out[0, :, 2, 3].tolist() == [5.5, 1.5]
    assert out[0, :, 0, 6].tolist() == [6.5, 0.5]
    assert shifted(ramp, 0, 0).equal(ramp)


def test_inside():
    px = at((0.0, 0.0), (6.99, 4.99), (7.0, 1.0), (3.0, -0.1))
    assert inside(px, (5, 7)).flatten().tolist() == [True, True, False, False]


def test_tables_of_any_dimension_are_linear_between_entries():
    steps = [torch.arange(n, dtype=torch.float64) for n in (3, 4, 5)]
    x, y, z = torch.meshgrid(*steps, indexing="ij")
    table = torch.stack([x * y, z], dim=-1)
    places = torch.rand(3, 6, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    a, b, c = places * torch.tensor([[2.0], [3.0], [4.0]], dtype=torch.float64)
    torch.testing.assert_close(sample_table(table, list(places)), torch.stack([a * b, c], dim=-1))
    assert sample_table(table, [torch.tensor([-1.0]), torch.tensor([2.0]), torch.tensor([9.0])]).tolist() == [
        [0.0, 4.0]
    ]
