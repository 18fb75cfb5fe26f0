"""The tables of lamps and sun that the kernels of direct light read."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt.compute.kernel import array
from gbufrt.compute.resident import numbers, places
from tracer.direct import reference
from tracer.direct.kernel import FACING, Sources
from tracer.lights.emitters import Lamps
from tracer.scene.scene import Sun

SIDES = 6  # of a grid's voxels; a lamp of more rectangles has their sums by where they face


def sources_of(lamps: Lamps, sun: Sun | None) -> Sources:
    """Lamps and sun as `tracer.direct.kernel` reads them."""
    return Sources(*map(array, tables_of(lamps, sun)))


def tables_of(lamps: Lamps, sun: Sun | None) -> tuple[Tensor, ...]:
    """The tables of `Sources`, where the lamps lie; on a GPU with room for as many rectangles of each as one has."""
    used = lamps.edge_u.abs().sum(dim=2) > 0
    at = places(used)
    rectangles, few = _rectangles(lamps, at), used.sum(dim=1) <= SIDES
    ball = torch.cat([lamps.center, lamps.radius[:, None], lamps.radiance.mean(dim=1, keepdim=True)], dim=1).double()
    summed = _summed(rectangles, SIDES * at[0] + lamps.side[at], ball)
    sine, basis = (0.0, torch.eye(3)) if sun is None else reference.sun_frame(sun)
    color = (0.0, 0.0, 0.0) if sun is None else sun.irradiance
    return (
        rectangles,
        F.pad(used.sum(dim=1).cumsum(0), (1, 0)),
        torch.where(few[:, None, None], _own(lamps), summed).permute(1, 2, 0),
        ball.T,
        numbers((*basis.T.tolist(), (sine,) * 3), ball),
        torch.cat([lamps.radiance, numbers((color,), lamps.radiance)]),
    )


def _rectangles(lamps: Lamps, at: tuple[Tensor | slice, ...]) -> Tensor:
    """``(..., 13)``: rows of `Sources.rectangles`, of those at an index."""
    corner, edge_u, edge_v = (t[at].double() for t in (lamps.corner, lamps.edge_u, lamps.edge_v))
    facing = torch.linalg.cross(edge_u, edge_v)
    return torch.cat([corner, edge_u, edge_v, facing, (facing * corner).sum(dim=-1, keepdim=True)], dim=-1)


def _own(lamps: Lamps) -> Tensor:
    """``(L, 6, 6)``: the first rectangles of each lamp, as `Sources.faces` holds them."""
    plane = _rectangles(lamps, (slice(None), slice(SIDES)))[..., FACING:]
    area = plane[..., :3].norm(dim=2, keepdim=True)
    return F.pad(torch.cat([plane, plane[..., 3:], area], dim=2), (0, 0, 0, SIDES - plane.shape[1]))


def _summed(rectangles: Tensor, side: Tensor, ball: Tensor) -> Tensor:
    """``(L, 6, 6)``: the sums of rectangles over each ``side`` of a lamp; ``ball`` is `Sources.lamps`, a row a lamp."""
    plane = rectangles[:, FACING:]
    rows = torch.cat([plane, plane[:, :3].norm(dim=1, keepdim=True)], dim=1)
    sides = rows.new_zeros(SIDES * len(ball), 5).index_add_(0, side, rows).view(-1, SIDES, 5)
    least = (sides[..., :3] * ball[:, None, :3]).sum(dim=2) - sides[..., 4] * ball[:, 3:4]
    return torch.cat([sides[..., :4], least[..., None], sides[..., 4:]], dim=2)
