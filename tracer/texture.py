"""What the surface is like where a ray hits it: the voxel's material, its texture, or a variation of its colour."""

from __future__ import annotations

from dataclasses import dataclass, replace

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt.compute.resident import places, resident
from gbufrt.tree import map_tensors
from tracer.scene.scene import Scene
from tracer.scene.textures import COLOR, GLOW, METAL, ROUGH, TILT
from tracer.traversal.hits import Hits

OCTAVES = ((8, 0.55), (2, 0.2), (1, 0.45))
"""Cells along a face's side and their amplitude: the texels, coarse blotches, and the whole face."""
FADED = 0.75  # pixels across a cell up to which it is not visible
GRAZING = 0.05  # least cosine between a textured normal and the way back along the ray


@dataclass(frozen=True, eq=False, kw_only=True)
class Look:
    """Surfaces, of any shape ``(...)``; see `tracer.scene.material.Material`.

    Args:
        albedo: ``(..., 3)``.
        roughness: ``(...)``.
        metallic: ``(...)``.
        emission: ``(..., 3)``.
        normal: ``(..., 3)`` unit length, world space, facing the ray: that of the face, turned by its texture.
    """

    albedo: Tensor
    roughness: Tensor
    metallic: Tensor
    emission: Tensor
    normal: Tensor


def look(scene: Scene, hits: Hits, directions: Tensor, pixels_per_unit: Tensor, *, poses: Tensor) -> Look:
    """The surfaces that rays hit.

    A texture shows its nearest texel, on the mip level whose texels span about a pixel.

    Args:
        scene: what is there.
        hits: of any shape ``(...)``.
        directions: ``(..., 3)`` of the rays, world space, unit length.
        pixels_per_unit: ``(...)`` how many pixels a world unit spans in the picture, at each hit.
        poses: ``(I, 4, 4)`` of the instances, or ``(B, I, 4, 4)`` for hits ``(B, ...)``.
    """
    table, which, shape = scene.materials, hits.material, hits.t.shape
    sizes = resident((1.0, *(i.scale for i in scene.instances)), hits.t)
    scales = sizes.index_select(0, hits.instance.flatten()).view(shape)
    pixels = pixels_per_unit * (hits.normal * directions).sum(-1).abs().clamp_min(1e-3).sqrt()
    strays, wide = table.each("variation", which).flatten(), (pixels * scales).flatten()
    shows = places(hits.hit.flatten() & (strays > 0) & (wide > FADED))[0]  # beside these nothing varies
    some = map_tensors(lambda x: x.reshape(-1, *x.shape[len(shape) :]).index_select(0, shows), hits)
    tone = torch.ones_like(strays)
    tone[shows] += strays.index_select(0, shows) * variation(some, some.instance, wide.index_select(0, shows))
    tone = tone.view(shape)
    plain = Look(
        albedo=(table.each("albedo", which) * tone[..., None]).clamp(0.0, 1.0),
        roughness=table.each("roughness", which),
        metallic=table.each("metallic", which),
        emission=table.each("emission", which),
        normal=hits.normal,
    )
    if table.textures is None:
        return plain
    faces = table.textures.faces[which.long(), hits.face.long()].long()
    textured = hits.hit & (faces[..., 1] > 0)
    here = places(textured)
    first, side = faces[here].unbind(dim=-1)
    first, side = torch.where(textured[here], first, 0), side.clamp_min(1)  # of what has no texture: any that there is
    rows = table.textures.texels[first + _texel(hits.uv(scales)[here], side, pixels[here])]
    columns = {
        "albedo": rows[:, COLOR : COLOR + 3],
        "roughness": rows[:, ROUGH],
        "metallic": rows[:, METAL],
        "emission": rows[:, GLOW : GLOW + 3],
        "normal": _turned(rows[:, TILT : TILT + 2], hits, directions[here], here, poses),
    }
    return replace(plain, **{name: _put(getattr(plain, name), here, textured, c) for name, c in columns.items()})


def _put(values: Tensor, here: tuple[Tensor, ...], mask: Tensor, new: Tensor) -> Tensor:
    """Values ``(...)`` or ``(..., C)`` with ``new`` ones where a mask is set, ``here`` its `places`."""
    set_ = mask[here] if new.ndim == 1 else mask[here][:, None]
    return values.index_put(here, torch.where(set_, new, values[here]))


def _texel(uv: Tensor, side: Tensor, pixels: Tensor) -> Tensor:
    """``(n,)`` which row of a texture of ``side`` texels shows where it spans ``pixels`` pixels."""
    level = (side / pixels.clamp_min(1e-9)).clamp_min(1.0).log2().add(0.5).floor().clamp_max(side.log2()).long()
    width = side >> level
    column, row = (uv * width[:, None]).long().clamp_max(width[:, None] - 1).unbind(dim=-1)
    return (4 * (side * side - width * width)) // 3 + row * width + column


def _turned(tilt: Tensor, hits: Hits, directions: Tensor, here: tuple[Tensor, ...], poses: Tensor) -> Tensor:
    """``(n, 3)`` normals of faces with a ``tilt`` ``(n, 2)`` along their two axes; none is turned away from its ray."""
    poses = (poses if poses.ndim == 4 else poses[None]).to(tilt.device)
    still = torch.eye(3, device=tilt.device).expand(len(poses), 1, 3, 3)
    axes = torch.cat([still, poses[..., :3, :3].to(tilt.dtype)], dim=1)  # columns are the grids' axes in world space
    axes = axes[here[0] if len(poses) > 1 else torch.zeros_like(here[0]), hits.instance[here].long()]
    axis = hits.face[here].long() // 2
    along = [torch.where(axis == 0, 1, 0), torch.where(axis == 2, 1, 2)]
    u, v = (axes.gather(2, k[:, None, None].expand(-1, 3, 1))[..., 0] for k in along)
    up = (1 - tilt.square().sum(dim=-1, keepdim=True)).clamp_min(0).sqrt()
    flat = hits.normal[here]
    return facing(tilt[:, :1] * u + tilt[:, 1:] * v + up * flat, flat, directions)


def facing(normal: Tensor, flat: Tensor, directions: Tensor) -> Tensor:
    """``(n, 3)`` unit normals on a face of normal ``flat``; none is turned away from the ray that hits it."""
    least = (flat * directions).sum(dim=-1, keepdim=True).neg().clamp_max(GRAZING)
    behind = (least + (normal * directions).sum(dim=-1, keepdim=True)).clamp_min(0)
    return F.normalize(normal - behind * directions, dim=-1)


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
    face = mix(x * 73856093 + y * 19349663 + z * 83492791 + (hits.face.long() + 6 * texture_ids.long()) * 2654435761)
    total = torch.zeros_like(pixels_per_voxel)
    for side, amplitude in OCTAVES:
        cell = (uv * side).long().clamp_max(side - 1)
        number = mix(face + (cell[..., 0] * side + cell[..., 1] + 64 * side) * 668265263)
        visible = ((pixels_per_voxel / side - FADED) / 1.25).clamp(0.0, 1.0)  # up to two pixels
        total = total + amplitude * visible * (number.to(total.dtype) * (2.0 / 0xFFFFFFFF) - 1.0)
    return total


def mix(value: Tensor) -> Tensor:
    """32 well mixed bits of an integer, in 64-bit arithmetic. Source: Wellons 2018, "lowbias32"."""
    value = value & 0xFFFFFFFF
    value = ((value ^ (value >> 16)) * 0x7FEB352D) & 0xFFFFFFFF
    value = ((value ^ (value >> 15)) * 0x846CA68B) & 0xFFFFFFFF
    return value ^ (value >> 16)
