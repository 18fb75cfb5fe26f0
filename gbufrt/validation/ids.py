"""Checks of masks of objects against the edges that depth and normals have."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt.validation.geometry import SMOOTH, Geometry

FARTHEST = 8  # pixels along each axis by which a mask is tried shifted
ENOUGH = 64  # places where a mask changes; fewer tell nothing
MOST = 1 << 12  # of them that are looked at
TURNED = 0.9  # cosine of normals below which there is an edge
FITS = 0.5  # share of the changes that lie on edges, from which on a shift is right
BETTER = 0.25  # share of the changes by which a shift must fit better: many objects touch without an edge


def check_ids(g: Geometry, object_id: Tensor, prefix: str) -> None:
    """Raise ValueError where objects end beside the edges of depth and normals, and would end on them if shifted.

    ``object_id``: ``(B, 1, H, W)``.
    """
    if min(g.camera.size) <= 4 * FARTHEST:
        return
    shifts = [(x, y) for y in range(-FARTHEST, FARTHEST + 1) for x in range(-FARTHEST, FARTHEST + 1)]
    edges = [_edges(g, dim) for dim in (2, 3)]
    found = torch.zeros(len(shifts))
    count = 0
    for dim, edge in zip((2, 3), edges, strict=True):
        at = _inner(_differ(object_id, dim)).nonzero()
        at = at[:: len(at) // MOST + 1]
        count += len(at)
        b, _, y, x = at.unbind(1)
        found += torch.stack([edge[b, 0, y + FARTHEST + dy, x + FARTHEST + dx].sum() for dx, dy in shifts]).cpu()
    if count < ENOUGH:
        return
    fits = found / count
    best, now = int(fits.argmax()), float(fits[shifts.index((0, 0))])
    if float(fits[best]) < max(FITS, now + BETTER):
        return
    x, y = shifts[best]
    raise ValueError(
        f"{prefix}object_id must lie on the pixels of depth: {now:.0%} of its borders lie on edges of depth or "
        f"normals, and {float(fits[best]):.0%} would, shifted by ({x}, {y}) px; it looks like a mask of another crop, "
        f"overscan or size: use torch.roll(object_id, ({y}, {x}), (2, 3)), or write it with depth"
    )


def _differ(t: Tensor, dim: int) -> Tensor:
    """Whether pixels differ from the next one along ``dim``."""
    return t != t.roll(-1, dim)


def _inner(t: Tensor) -> Tensor:
    return t[:, :, FARTHEST : -FARTHEST - 1, FARTHEST : -FARTHEST - 1]


def _edges(g: Geometry, dim: int) -> Tensor:
    """Where depth jumps or normals turn between a pixel and the next one along ``dim``."""
    step = (g.depth.roll(-1, dim) - g.depth).abs()
    slope = torch.minimum((g.depth - g.depth.roll(1, dim)).abs(), (g.depth.roll(-2, dim) - g.depth.roll(-1, dim)).abs())
    jump = step - slope > SMOOTH * torch.minimum(g.depth, g.depth.roll(-1, dim))
    both = g.hit & g.hit.roll(-1, dim)
    turned = (g.normal * g.normal.roll(-1, dim)).sum(1, keepdim=True) < TURNED
    return (both & (jump | turned)) | _differ(g.hit, dim)
