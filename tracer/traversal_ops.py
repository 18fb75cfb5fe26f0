"""The three walks through voxels as torch operators: compiled on the CPU, the torch reference elsewhere.

They share these arguments:
    origins, directions: ``(N, 3)`` float32 world space, the rays of the first of B batch elements first; t counts in
        lengths of the direction.
    spans: ``(N, 2)`` float32: t at which each ray begins and ends.
    bricks, index, entries: see `tracer.grids.Grids`.
    media: ``(M, 4)`` float32: opacity and tint of every material.
    transforms: ``(B, I + 1, 3, 4)`` float64 grid from world: voxels counted from the corner of the index.
    mask: which entries are seen.
"""

from __future__ import annotations

import torch
from torch import Tensor

from tracer import traversal_reference as reference


@torch.library.custom_op("tracer::surface", mutates_args=())
def surface(
    origins: Tensor,
    directions: Tensor,
    spans: Tensor,
    media_left: Tensor,
    bricks: Tensor,
    index: Tensor,
    entries: Tensor,
    media: Tensor,
    transforms: Tensor,
    mask: int,
) -> tuple[Tensor, Tensor]:
    """The nearest place where the medium along a ray changes.

    A ray that begins in something opaque comes out of it first, without a surface. ``media_left`` is ``(N, 5)`` int32,
    or has no rows: a material, an entry and a voxel in which the ray is; leaving that material into air is no surface.

    Returns:
        ``(N, 4)`` float32: t (inf on a miss) and the place in voxel coordinates of its grid; and ``(N, 7)`` int32:
        material, entry (-1 on a miss), face (2 x axis, + 1 where the ray falls along it), whether it is the back of the
        medium that the ray leaves, and the voxel.
    """
    rays = (origins, directions, spans, media_left)
    if origins.is_cpu:
        from tracer.traversal_kernel import run_surface

        return run_surface(*rays, bricks, index, entries, media, transforms, mask)
    return reference.surface(*rays, bricks, index, entries, media, transforms, mask)


@torch.library.custom_op("tracer::transmit", mutates_args=())
def transmit(
    origins: Tensor,
    directions: Tensor,
    spans: Tensor,
    bricks: Tensor,
    index: Tensor,
    entries: Tensor,
    media: Tensor,
    transforms: Tensor,
    mask: int,
) -> Tensor:
    """``(N, 3)`` float32: the share of light that comes through; 0 behind anything opaque."""
    if origins.is_cpu:
        from tracer.traversal_kernel import run_transmit

        return run_transmit(origins, directions, spans, bricks, index, entries, media, transforms, mask)
    return reference.transmit(origins, directions, spans, bricks, index, entries, media, transforms, mask)


@torch.library.custom_op("tracer::runs", mutates_args=())
def runs(
    origins: Tensor,
    directions: Tensor,
    spans: Tensor,
    starts: Tensor,
    bricks: Tensor,
    index: Tensor,
    entries: Tensor,
    media: Tensor,
    transforms: Tensor,
) -> Tensor:
    """How far a ray goes on through the solid whose surface it met.

    ``starts`` is ``(N, 5)`` int32: material, entry (-1 for none) and voxel at the beginning of the span.

    Returns:
        ``(N, 2)`` float32, in t: through voxels that are not air, and through the first ones of the same material.
    """
    if origins.is_cpu:
        from tracer.traversal_kernel import run_runs

        return run_runs(origins, directions, spans, starts, bricks, index, entries, media, transforms)
    return reference.runs(origins, directions, spans, starts, bricks, index, entries, media, transforms)


@surface.register_fake
def _(origins: Tensor, *_: object) -> tuple[Tensor, Tensor]:
    count = origins.shape[0]
    return origins.new_empty(count, 4, dtype=torch.float32), origins.new_empty(count, 7, dtype=torch.int32)


@transmit.register_fake
def _(origins: Tensor, *_: object) -> Tensor:
    return origins.new_empty(origins.shape[0], 3, dtype=torch.float32)


@runs.register_fake
def _(origins: Tensor, *_: object) -> Tensor:
    return origins.new_empty(origins.shape[0], 2, dtype=torch.float32)
