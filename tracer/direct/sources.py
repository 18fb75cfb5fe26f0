"""The tables of lamps and sun that the kernels of direct light read."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt.compute.kernel import array
from tracer.direct import reference
from tracer.direct.kernel import Sources
from tracer.lights.emitters import Lamps
from tracer.scene.scene import Sun

MANY = 8  # rectangles of a lamp from which on they are summed by where they face
ALIKE = 1e-6  # part of the sum of their areas by which facings that count as one may differ


def sources_of(lamps: Lamps, sun: Sun | None) -> Sources:
    """Lamps and sun as `tracer.direct.kernel` reads them."""
    return Sources(*map(array, tables_of(lamps, sun)))


def tables_of(lamps: Lamps, sun: Sun | None) -> tuple[Tensor, ...]:
    """The tables of `Sources`, where the lamps lie."""
    used = lamps.edge_u.abs().sum(dim=2) > 0
    corner, edge_u, edge_v = (t[used].double() for t in (lamps.corner, lamps.edge_u, lamps.edge_v))
    facing = torch.linalg.cross(edge_u, edge_v)
    offset = (facing * corner).sum(dim=1, keepdim=True)
    first = F.pad(used.sum(dim=1).cumsum(0), (1, 0))
    ball = torch.cat([lamps.center, lamps.radius[:, None], lamps.radiance.mean(dim=1, keepdim=True)], dim=1)
    sine, basis = (0.0, torch.eye(3)) if sun is None else reference.sun_frame(sun)
    color = torch.zeros(1, 3) if sun is None else torch.tensor([sun.irradiance])
    return (
        torch.cat([corner, edge_u, edge_v, facing, offset], dim=1),
        first,
        _faces(used, facing, offset, ball),
        ball.double(),
        torch.cat([basis.T, torch.full((1, 3), sine)]).double().to(ball.device),
        torch.cat([lamps.radiance, color.to(lamps.radiance)]),
    )


def _faces(used: Tensor, facing: Tensor, offset: Tensor, ball: Tensor) -> Tensor:
    """`Sources.faces` of lamps with rectangles where ``used`` ``(L, K)`` is set; ``ball`` is `Sources.lamps`."""
    lamp, area = used.nonzero()[:, 0], facing.norm(dim=1, keepdim=True)
    axis = facing.abs().argmax(dim=1)
    up = facing.gather(1, axis[:, None])[:, 0] > 0
    sums = facing.new_zeros(6 * len(used), 5)
    sums.index_add_(0, 6 * lamp + 2 * axis + up, torch.cat([facing, offset, area], dim=1))
    unlike = sums[:, 4] - sums[:, :3].norm(dim=1) > ALIKE * sums[:, 4]
    sides = sums.view(-1, 6, 5)
    alone = unlike.view(-1, 6).any(dim=1) | (used.sum(dim=1) < MANY)
    least = (sides[..., :3] * ball[:, None, :3]).sum(dim=2) - sides[..., 4] * ball[:, 3:4]
    summed = torch.cat([sides[..., :4], least[..., None], sides[..., 4:]], dim=2)
    widest = max(6, int(used[alone].sum(dim=1).max())) if bool(alone.any()) else 6
    own = facing.new_zeros(len(used), used.shape[1], 6)
    own[used] = torch.cat([facing, offset, offset, area], dim=1)
    own = own.gather(1, used.int().argsort(dim=1, descending=True, stable=True)[..., None].expand(-1, -1, 6))
    own = F.pad(own[:, :widest], (0, 0, 0, max(widest - own.shape[1], 0)))
    summed = F.pad(summed, (0, 0, 0, widest - 6))
    return torch.where(alone[:, None, None], own, summed).permute(1, 2, 0)
