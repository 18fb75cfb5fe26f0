"""Colour variation over the faces of voxels, so that they are not flat."""

from __future__ import annotations

import torch
from torch import Tensor

from tracer.traversal.rays import Hits

OCTAVES = ((8, 0.55), (2, 0.2), (1, 0.45))
"""Cells along a face's side and their amplitude: the texels, coarse blotches, and the whole face."""


def variation(hits: Hits, texture_ids: Tensor, pixels_per_voxel: Tensor) -> Tensor:
    """How far the colour at each hit strays from its material's.

    Each octave is a hash of the voxel, the face and the cell on the face, and fades to its mean of zero where its cells
    are smaller than a pixel, so that far faces do not alias.

    Args:
        hits: of any shape ``(...)``.
        texture_ids: ``(...)`` integers that tell apart grids in which the same voxel coordinates occur.
        pixels_per_voxel: ``(...)`` how many pixels a voxel's side spans in the picture, foreshortened.

    Returns:
        ``(...)`` about in [-1, 1], with mean zero.
    """
    uv = hits.uv()
    x, y, z = (hits.cell[..., k].long() for k in range(3))
    face = _mix(x * 73856093 + y * 19349663 + z * 83492791 + (hits.face.long() + 6 * texture_ids.long()) * 2654435761)
    total = torch.zeros_like(pixels_per_voxel)
    for side, amplitude in OCTAVES:
        cell = (uv * side).long().clamp_max(side - 1)
        number = _mix(face + (cell[..., 0] * side + cell[..., 1] + 64 * side) * 668265263)
        visible = ((pixels_per_voxel / side - 0.75) / 1.25).clamp(0.0, 1.0)  # from 3/4 of a pixel to two
        total = total + amplitude * visible * (number.to(total.dtype) * (2.0 / 0xFFFFFFFF) - 1.0)
    return total


def _mix(value: Tensor) -> Tensor:
    """32 well mixed bits of an integer, in 64-bit arithmetic. Source: Wellons 2018, "lowbias32"."""
    value = value & 0xFFFFFFFF
    value = ((value ^ (value >> 16)) * 0x7FEB352D) & 0xFFFFFFFF
    value = ((value ^ (value >> 15)) * 0x846CA68B) & 0xFFFFFFFF
    return value ^ (value >> 16)
