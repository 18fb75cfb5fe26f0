"""Textures of materials: the faces of voxels as texels, in one atlas."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

COLOR, TILT, ROUGH, METAL, GLOW = 0, 3, 5, 6, 7
"""Columns of `Textures.texels`."""
COLUMNS = 10
MAX_ROWS = (1 << 24) - (1 << 15)  # kernels keep their numbers, after those of the materials, as float32


@dataclass(frozen=True, eq=False, kw_only=True)
class Textures:
    """The textures of M materials.

    A texture covers one face of a block: of one voxel in a world, and of as many as make a world unit in an instance.
    Its rows go along the second of the face's two axes (see `tracer.traversal.rays.Hits.uv`), its columns along the
    first. Each is followed by its mip levels, every one half as wide, down to one texel.

    Args:
        faces: ``(M, 6, 2)`` int32: of each face, -x +x -y +y -z +z, its first row of ``texels`` and how many texels its
            side has, a power of two; 0 where the face has no texture.
        texels: ``(T, 10)`` float32, at most `MAX_ROWS`: linear albedo, the normal's components along the face's two
            axes, perceptual roughness, metallic, emitted radiance.
    """

    faces: Tensor
    texels: Tensor

    @staticmethod
    def none(count: int, like: Tensor) -> Textures:
        """Of ``count`` materials that have none, on the device of another tensor."""
        return Textures(
            faces=torch.zeros(count, 6, 2, dtype=torch.int32, device=like.device),
            texels=torch.zeros(0, COLUMNS, device=like.device),
        )

    @staticmethod
    def joined(parts: Sequence[Textures]) -> Textures:
        """Those of several tables of materials, one after the other."""
        faces, first = list[Tensor](), 0
        for part in parts:
            faces.append(part.faces + part.faces.new_tensor([first, 0]))
            first += len(part.texels)
        return Textures(faces=torch.cat(faces), texels=torch.cat([part.texels for part in parts]))


def with_mips(texels: Tensor) -> Tensor:
    """The rows of a texture and of its mip levels, each a mean over 2 x 2.

    Args:
        texels: ``(S, S, C)``, S a power of two.

    Returns:
        ``(N, C)``; see `Textures`.
    """
    levels, side = [texels.flatten(0, 1)], len(texels)
    while side > 1:
        side //= 2
        texels = texels.view(side, 2, side, 2, -1).mean(dim=(1, 3))
        levels.append(texels.flatten(0, 1))
    return torch.cat(levels)
