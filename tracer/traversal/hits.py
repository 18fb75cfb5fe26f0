"""What rays hit."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import torch
from torch import Tensor

from gbufrt.tree import map_tensors

Rows = Tensor | tuple[Any, ...]
"""An index into the shape of rays."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Hits:
    """What rays hit; every field begins with the rays' shape. Where ``hit`` is False the rest is meaningless.

    Args:
        t: distance in units of the direction's length; inf on a miss.
        hit: bool.
        material: int32 row of ``scene.materials``; 0 on a miss.
        instance: int32: 0 the world, i + 1 instance i; 0 on a miss.
        normal: ``(..., 3)`` of the face, unit length, world space, facing the ray; 0 on a miss.
        cell: ``(..., 3)`` int32: the voxel, in the coordinates of its own grid.
        local: ``(..., 3)`` the hit point, in the coordinates of its own grid.
        face: int32: which face of the voxel, -x +x -y +y -z +z.
        back_face: bool: the ray left a transmissive material into air here.
    """

    t: Tensor
    hit: Tensor
    material: Tensor
    instance: Tensor
    normal: Tensor
    cell: Tensor
    local: Tensor
    face: Tensor
    back_face: Tensor

    def at(self, rows: Rows) -> Hits:
        """Those of some rays."""
        return map_tensors(lambda x: x[rows], self)

    def put(self, rows: Rows, values: Hits) -> None:
        """Write those of some rays, in place."""
        for f in fields(Hits):
            getattr(self, f.name)[rows] = getattr(values, f.name)

    def where(self, mask: Tensor, other: Hits) -> Hits:
        """These where ``mask`` ``(...)`` is set, else others."""
        wide = mask[..., None]
        pairs = {f.name: (getattr(self, f.name), getattr(other, f.name)) for f in fields(Hits)}
        return Hits(**{n: torch.where(mask if a.ndim == mask.ndim else wide, a, b) for n, (a, b) in pairs.items()})

    def without(self, mask: Tensor) -> Hits:
        """These, of which those set in ``mask`` ``(...)`` have become misses."""
        return replace(
            self,
            t=torch.where(mask, torch.inf, self.t),
            hit=self.hit & ~mask,
            material=torch.where(mask, 0, self.material),
            instance=torch.where(mask, 0, self.instance),
            normal=torch.where(mask[..., None], 0.0, self.normal),
        )

    def uv(self, scales: Tensor | None = None) -> Tensor:
        """``(..., 2)`` in [0, 1]: the hit point on the face, along the grid's two other axes in order.

        Args:
            scales: ``(...)`` world units a voxel, for the face of the world unit that the voxel is part of.
        """
        inner = (self.local - self.cell).clamp(0.0, 1.0)
        if scales is not None:
            begin = self.cell * scales[..., None]
            inner = (begin - begin.floor() + inner * scales[..., None]).clamp(0.0, 1.0)
        axis = self.face.long() // 2
        first, second = torch.where(axis == 0, 1, 0), torch.where(axis == 2, 1, 2)
        return inner.gather(-1, torch.stack([first, second], dim=-1))


@dataclass(frozen=True, eq=False, kw_only=True)
class Place:
    """Where rays are when a program runs, a row for each.

    Args:
        origins: ``(N, 3)`` world space.
        directions: ``(N, 3)``, of the length that they were sent with.
        hits: what they hit; in a miss program None.
    """

    origins: Tensor
    directions: Tensor
    hits: Hits | None = None

    @property
    def found(self) -> Hits:
        """The hits; in a miss program there are none to ask for."""
        if self.hits is None:
            raise ValueError("a miss program has no hits: its rays have origins and directions alone")
        return self.hits

    @property
    def points(self) -> Tensor:
        """``(N, 3)`` world space, of the hits."""
        return self.origins + self.directions * self.found.t[:, None]
