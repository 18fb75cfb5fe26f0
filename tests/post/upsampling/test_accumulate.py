"""What temporal upscaling is made of: samples and their kernels, locks, shear of motion."""

from __future__ import annotations

import pytest
import torch

from post.upsampling.accumulate import (
    Gathered,
    clipped,
    ellipses,
    ellipses_before,
    mean_weight,
    near,
    same_light,
    shear,
)
from post.upsampling.samples import Samples
from post.upsampling.upscale_reference import within

SMALL, LARGE = (30, 40), (60, 80)


def test_light_that_changes_over_an_area_ends_locks_and_histories():
    one = torch.ones(1, 1, 6, 8)
    still = torch.zeros(1, 2, 6, 8)
    assert bool((same_light(one, one * 1.05, still) == 1).all())
    assert bool((same_light(one, one * 0.3, still) == 0).all())
    line = torch.where(torch.arange(8) < 4, 0.3, 1.0).expand_as(one)  # as beside a body that has passed
    assert bool((same_light(one, torch.where(torch.arange(8) == 3, line, 1.0), still) == 1).all())
    assert bool((same_light(one, line, still)[..., :2] == 0).all())


def test_samples_along_an_edge_count_farther_than_across_it():
    ramp = torch.arange(8.0).expand(1, 3, 8, 8) / 8
    for edge, along in ((ramp, 2), (ramp.transpose(2, 3), 0)):
        xx, xy, yy = (ellipses(edge)[0, k, 4, 4] for k in range(3))
        counts = torch.stack([xx, xy, yy])
        assert float(counts[2 - along]) == pytest.approx(1.0, abs=0.01)
        assert float(counts[along]) < 0.3
        assert float(xy) == pytest.approx(0.0, abs=1e-4)
    slanted = (ramp + ramp.transpose(2, 3)) / 2  # its edges go from lower left to upper right
    xx, xy, yy = ellipses(slanted)[0, :, 4, 4].tolist()
    assert xx + yy - 2 * xy < 0.3 * (xx + yy + 2 * xy)
    assert torch.allclose(ellipses(torch.ones(1, 3, 5, 5))[0, :, 2, 2], torch.tensor([1.0, 0.0, 1.0]), atol=1e-4)


def test_a_history_tells_of_edges_between_the_samples_of_one_frame():
    """A line two pixels of the history wide, which samples four pixels apart miss, read beside it and far from it."""
    image = torch.zeros(1, 3, 24, 24)
    image[..., 10:12] = 0.5
    px = torch.tensor([[10.2, 12.0], [17.0, 12.0]]).T.reshape(1, 2, 1, 2)
    beside, away = ellipses_before(image, px)[0, :, 0].unbind(1)
    assert beside.tolist() == pytest.approx([1.0, 0.0, 0.27], abs=0.03)
    assert away.tolist() == pytest.approx([1.0, 0.0, 1.0], abs=1e-4)
    assert float(image[..., ::4, ::4].max()) == 0.0
    down = ellipses_before(image.transpose(2, 3), px.flip(1))[0, :, 0, 0]
    assert torch.allclose(down, beside.flip(0), atol=1e-6)
    ramp = (torch.arange(24.0)[:, None] + torch.arange(24.0)).expand(1, 3, 24, 24) / 8
    xx, xy, yy = ellipses_before(ramp, px)[0, :, 0, 0].tolist()
    assert xx + yy - 2 * xy < 0.3 * (xx + yy + 2 * xy), "it runs from lower left to upper right"


def test_four_samples_surround_each_pixel():
    at = Samples.of(SMALL, LARGE, torch.tensor([[0.3, -0.4]]), torch.zeros(1, 1, *SMALL))
    index = torch.arange(float(SMALL[0] * SMALL[1])).view(1, 1, *SMALL)
    taps, away = (torch.stack(found)[..., 4:-4, 4:-4] for found in zip(*at.surrounding(index), strict=True))
    least, most = away.amin(0), away.amax(0)
    assert bool(((least <= 0) & (most >= 0)).all())
    assert torch.allclose(most - least, torch.tensor(2.0))
    assert bool((taps.sort(0).values.diff(dim=0) > 0).all()), "they are four"
    assert torch.equal(taps[0], at.nearest(index)[..., 4:-4, 4:-4])


def test_the_kernel_is_nearly_exponential_and_never_zero():
    exponent = torch.linspace(-40, 0, 81)
    assert torch.allclose(near(exponent), exponent.exp(), atol=0.04)
    assert float(near(exponent).min()) > 0


def test_reads_beyond_the_pixels_at_the_border_count_less():
    x, y = torch.tensor([0.0, 0.25, 0.5, 40.0, 79.5, 79.75, 40.0]), torch.tensor([30.0] * 6 + [59.9])
    share = within(torch.stack([x, y])[None, :, None], LARGE)
    assert share.flatten().tolist() == pytest.approx([0.0, 0.5, 1.0, 1.0, 1.0, 0.5, 0.2], abs=1e-4)


def test_shear_is_how_otherwise_neighbours_move():
    motion = torch.zeros(1, 2, 5, 8)
    motion[:, :, :, 4:] = torch.tensor([3.0, -4.0]).view(1, 2, 1, 1)
    assert shear(motion)[0, 0, 2].tolist() == [0, 0, 0, 5, 5, 0, 0, 0]
    assert float(shear(motion * 0 + 7).max()) == 0.0


def of_gray(value: float, spread: float) -> Gathered:
    """Surroundings of one luma, which spreads, and no colour."""
    plane = torch.zeros(1, 3, 2, 3)
    luma = torch.tensor([1.0, 0.0, 0.0]).view(1, 3, 1, 1)
    gray = plane + value
    return Gathered(gray, gray, plane[:, :1] + 1, plane + value * luma, plane + spread * luma, gray, gray)


@pytest.mark.parametrize("ratio", [1, 2])
def test_histories_of_more_frames_are_clipped_less_and_lose_weight_as_they_are(ratio: int):
    at = Samples.of((2, 3), (2 * ratio, 3 * ratio), None, torch.zeros(1, 1, 2, 3))
    old, one = torch.full((1, 3, 2, 3), 0.9), torch.ones(1, 1, 2, 3)
    found = {
        frames: clipped(old, of_gray(0.5, 0.06), one, one * frames * mean_weight(at), at) for frames in (0, 4, 12, 99)
    }
    kept = {frames: float(color.mean()) for frames, (color, _, _) in found.items()}
    assert kept[0] == pytest.approx(0.68)
    assert kept[0] < kept[4] < kept[12] == pytest.approx(0.8) == kept[99]
    for frames, (_, moved, left) in found.items():
        assert float(moved.mean()) == pytest.approx(kept[frames] - 0.9, abs=1e-6)
        assert float(left.mean()) == pytest.approx(frames * mean_weight(at) / (1 - 6 * float(moved.mean())))
    color, moved, left = clipped(old, of_gray(0.9, 0.1), one, one, at)
    torch.testing.assert_close(color, old)
    assert float(moved.abs().max()) < 1e-6
    assert float(left.min()) == pytest.approx(1.0), "what is not clipped keeps its weight"
