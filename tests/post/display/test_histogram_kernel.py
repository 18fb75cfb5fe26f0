"""The compiled histogram of log luminance against its torch reference."""

from __future__ import annotations

import pytest
import torch

from post import exposure
from post.display.constants import BINS, BRIGHTEST, DARKEST, STRIP
from post.display.op import histogram, histogram_cpu


def light(size: tuple[int, int]) -> torch.Tensor:
    """Two pictures in the middles of bins, where both forms agree on the bin; some pixels are without light."""
    drawn = torch.Generator().manual_seed(1)
    stops = (torch.randint(-30, 30, (2, 1, *size), generator=drawn) + 0.5) * (BRIGHTEST - DARKEST) / BINS
    level = torch.where(torch.rand(2, 1, *size, generator=drawn) < 0.1, -0.5, torch.exp2(stops))
    return level.expand(-1, 3, -1, -1).contiguous()


@pytest.mark.parametrize("size", [(2 * STRIP + 3, 73), (1, 1), (STRIP, 5)])
def test_forms_agree(size: tuple[int, int]) -> None:
    color = light(size)
    got, want = (histogram(color, compiled=form) for form in (True, False))
    assert torch.equal(got[:, 0], want[:, 0])
    torch.testing.assert_close(got[:, 1], want[:, 1], rtol=1e-5, atol=1e-5)
    assert torch.equal(got[:, 0].sum(1), (color[:, 0] > 0).flatten(1).sum(1).float())


def test_light_beyond_its_ends_is_counted_in_the_last_bins() -> None:
    color = torch.tensor([2.0**-40, 2.0**40]).view(2, 1, 1, 1).expand(2, 3, 1, 1)
    counted, total = histogram(color, compiled=True).unbind(1)
    assert counted[0].nonzero().item() == 0
    assert counted[1].nonzero().item() == BINS - 1
    torch.testing.assert_close(total.sum(1), torch.tensor([DARKEST, BRIGHTEST]))


def test_a_picture_without_light_is_as_dark_as_the_histogram_knows() -> None:
    color = light((20, 30))
    color[0] = 0.0
    for kind in (torch.float32, torch.float64):
        _, adapted = exposure(color.to(kind), max_ev=40.0)
        assert float(adapted[0]) == DARKEST
        assert float(adapted[1]) > DARKEST / 2


def test_operator_is_registered_properly() -> None:
    torch.library.opcheck(histogram_cpu, (light((6, 8)),), test_utils=("test_schema", "test_faketensor"))
