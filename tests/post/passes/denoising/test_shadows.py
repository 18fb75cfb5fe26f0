"""Borders of shadows, from the samples of one frame."""

from __future__ import annotations

import boxes
import torch
import torch.nn.functional as F

from post.filters.around import alike
from post.filters.surfaces import surface
from post.history.antilag import trusted
from post.passes.denoising.shadows import into_shadow, often_dark

SIZE = (36, 48)
G = boxes.frame(boxes.camera(SIZE), boxes=boxes.ROOM[:1]).gbuffer
SAME = alike(surface(G.depth, G.normal, G.hit, G.camera))
ONES = torch.ones_like(G.depth)
INNER = (..., slice(8, -8), slice(8, -8))
ROWS, COLUMNS = torch.arange(SIZE[0])[:, None], torch.arange(SIZE[1])


def test_borders_of_shadows_come_from_the_sample():
    left = torch.arange(SIZE[1]).view(1, 1, 1, -1).expand(1, 3, *SIZE) < 24
    dark = left & G.hit
    truth = torch.where(left, 0.1, 1.0)
    blurred = torch.nn.functional.avg_pool2d(
        torch.nn.functional.pad(truth, (1, 1, 1, 1), mode="replicate"), 3, stride=1
    )
    sample = torch.where(left, 0.0, 0.9)
    kept = into_shadow(blurred, sample, SAME, ONES)
    assert float((kept - truth)[dark].abs().max()) < 0.5 * float((blurred - truth)[dark].abs().max())
    assert torch.equal(kept[~left], blurred[~left])
    flat = torch.full_like(truth, 0.5)
    assert torch.allclose(into_shadow(flat, torch.zeros_like(flat), SAME, ONES), flat)


def test_dark_samples_among_bright_ones_are_no_shadow():
    mean = torch.linspace(0.5, 1.0, SIZE[1]).expand_as(G.normal).contiguous()
    scattered = torch.where((ROWS % 2 == 0) & (COLUMNS % 2 == 0), 0.0, 1.3) * mean
    assert torch.equal(into_shadow(mean, scattered, SAME, ONES)[INNER], mean[INNER])
    together = into_shadow(mean, torch.where(COLUMNS < 24, 0.0, 1.0) * mean, SAME, ONES)
    lower = (mean - together)[INNER][G.hit.expand_as(mean)[INNER] & (COLUMNS < 22).expand_as(mean)[INNER]]
    assert float(lower.min()) > 0


def test_samples_that_are_often_dark_prove_no_shadow():
    """A penumbra that stays: half of its samples have been dark, and half of those of this frame are."""
    mean = torch.linspace(0.4, 0.6, SIZE[1]).expand_as(G.normal).contiguous()
    half = torch.where((ROWS + COLUMNS) % 2 == 0, 0.0, 2.0) * mean
    long = torch.full_like(G.depth, 30.0)
    variance = mean[:, :1].square() / long  # of samples that are all or nothing, half of the time
    often = often_dark(mean, variance, long, G.hit, SAME)
    whole = SAME.all(dim=1, keepdim=True) & G.hit
    wide = whole & (F.avg_pool2d(whole.float(), 5, stride=1, padding=2) > 0.99)
    torch.testing.assert_close(often[wide], torch.full_like(often[wide], 0.5), rtol=0.02, atol=0)
    assert float(often[~wide].max()) == 0  # an edge is near, whose variance it may be
    young = often_dark(mean, variance * long, ONES, G.hit, SAME)
    assert float(young.max()) == 0
    wide = wide.expand_as(mean)
    kept, darker = (into_shadow(mean, half, SAME, ONES, each)[wide] for each in (often, young))
    torch.testing.assert_close(kept, mean[wide])
    assert float((darker - mean[wide]).min()) < -0.001
    dark = into_shadow(mean, 0 * mean, SAME, ONES, often)  # where all are dark a shadow has come
    assert float((mean - dark)[G.hit.expand_as(mean)].mean()) > 0


def test_one_dark_sample_proves_no_shadow_where_many_are_dark():
    length = torch.full_like(G.depth, 8.0)
    grain = torch.where(COLUMNS < 24, 100.0, 1.0).expand_as(G.depth)
    ramp = torch.linspace(0.5, 1.0, SIZE[0])[:, None].expand_as(G.normal).contiguous()
    kept = into_shadow(ramp, torch.zeros_like(ramp), SAME, trusted(grain, length))
    darker = (ramp - kept)[INNER]
    assert 0 < float(darker[..., :12].mean()) < 0.02 * float(darker[..., 20:].mean())


def test_the_variance_of_a_sharp_border_leaves_its_shadow():
    """One row of pixels in five is as noisy as a penumbra: far less than in a penumbra, which is noisy all over."""
    mean, long = torch.full_like(G.normal, 0.5), torch.full_like(G.depth, 30.0)
    variance = mean[:, :1].square() / long
    border = torch.where(ROWS == 20, variance, 0.0).requires_grad_()
    often = often_dark(mean, border, long, G.hit, SAME)
    assert float(often.detach().max()) < 0.1 * float(often_dark(mean, variance, long, G.hit, SAME).max())
    often.sum().backward()
    assert border.grad is not None
    assert bool(border.grad.isfinite().all())
