"""Anti-aliasing by luma edges in torch: the definition of `post.filters.fxaa_op.smooth_stairs`, with its gradients."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt.compute.resident import resident
from gbufrt.sampling import pixel_centers, sample, shifted
from post.filters.constants import LUMA, STRIDES


def stairs_reference(image: Tensor, subpixel: float, edge_threshold: float, dark_threshold: float) -> Tensor:
    """``(B, 3, H, W)``. Arguments and result are those of `post.fxaa`."""
    luma = (image * resident(LUMA, image)[None, :, None, None]).sum(1, keepdim=True)
    north, south, west, east = (shifted(luma, dx, dy) for dx, dy in ((0, -1), (0, 1), (-1, 0), (1, 0)))
    nw, ne, sw, se = (shifted(luma, dx, dy) for dx, dy in ((-1, -1), (1, -1), (-1, 1), (1, 1)))
    high = torch.maximum(torch.maximum(torch.maximum(north, south), torch.maximum(west, east)), luma)
    low = torch.minimum(torch.minimum(torch.minimum(north, south), torch.minimum(west, east)), luma)
    contrast = high - low
    is_edge = contrast > (edge_threshold * high).clamp_min(dark_threshold)

    across_rows = (nw + sw - 2 * west).abs() + 2 * (north + south - 2 * luma).abs() + (ne + se - 2 * east).abs()
    across_columns = (nw + ne - 2 * north).abs() + 2 * (west + east - 2 * luma).abs() + (sw + se - 2 * south).abs()
    horizontal = across_rows >= across_columns
    before, after = torch.where(horizontal, north, west), torch.where(horizontal, south, east)
    steep_before = (before - luma).abs() >= (after - luma).abs()
    neighbour = torch.where(steep_before, before, after)
    side = torch.where(steep_before, -1.0, 1.0).to(luma)
    across = torch.cat([torch.where(horizontal, 0.0, side), torch.where(horizontal, side, 0.0)], dim=1)
    along = torch.cat([horizontal, ~horizontal], dim=1).to(luma)

    center = pixel_centers(luma)
    shift = _edge_shift(luma, center, across, along, neighbour)
    smooth = (2 * (north + south + west + east) + nw + ne + sw + se) / 12
    lonely = ((smooth - luma).abs() / contrast.clamp_min(1e-6)).clamp(0, 1)
    lonely = (lonely * lonely * (3 - 2 * lonely)) ** 2 * subpixel / 2  # at most half way to the neighbour
    shifted_px = center + across * torch.maximum(shift, lonely)
    return torch.where(is_edge, sample(image, shifted_px), image)


def _edge_shift(luma: Tensor, center: Tensor, across: Tensor, along: Tensor, neighbour: Tensor) -> Tensor:
    """How far to read across the edge, 0 to 0.5 pixels, from the distances to its two ends."""
    middle = (luma + neighbour) / 2
    end_step = (luma - neighbour).abs() / 4
    on_edge = center + across / 2
    distances, deltas = [], []
    for direction in (-1.0, 1.0):
        distance = torch.zeros_like(luma)
        delta = torch.zeros_like(luma)
        searching = torch.ones_like(luma, dtype=torch.bool)
        for stride in STRIDES:
            distance = torch.where(searching, distance + stride, distance)
            found = sample(luma, on_edge + direction * distance * along) - middle
            delta = torch.where(searching, found, delta)
            searching = searching & (found.abs() < end_step)
        distances.append(distance)
        deltas.append(delta)
    nearer = distances[0] < distances[1]
    delta = torch.where(nearer, deltas[0], deltas[1])
    nearest, length = torch.minimum(*distances), distances[0] + distances[1]
    crosses = (delta < 0) != (luma < middle)  # only the side of the stair that the line really covers moves
    return torch.where(crosses, 0.5 - nearest / length, torch.zeros_like(luma))
