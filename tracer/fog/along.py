"""Lamps along rays through fog: one of them, a place on the ray and a point of the lamp, drawn by what is scattered."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from gbufrt.compute.resident import places
from tracer.fog.segments import Segments, phase
from tracer.lights.lamp_table import LampTable
from tracer.lights.spherical_rectangle import rectangle_points
from tracer.scene.fog import Fog

CELLS = 256  # of angles, within which all are equally likely
FLAT = 1e-6  # rise over a lamp's plane, a unit, below which a ray runs along it
BLOCK = 1 << 17  # rays times lamps at a time
RARE = 0.02  # share of draws by power alone where rays share weights, by which no lamp has none
CANDIDATES = 64  # lamps that are weighed for a ray where not all are


@dataclass(frozen=True, eq=False, kw_only=True)
class Drawn:
    """What `LampsAlong.draw` gives for N rays.

    Args:
        t: ``(N,)`` distance from each ray's origin.
        points: ``(N, 3)`` there.
        away: ``(N, 3)`` to the lamp's point.
        light: ``(N, 3)`` what the lamp sends there, over the density of the draw; neither phase, fog nor shadow.
    """

    t: Tensor
    points: Tensor
    away: Tensor
    light: Tensor


@dataclass(frozen=True, eq=False, kw_only=True)
class LampsAlong:
    """Lamps weighed by what fog along N rays scatters of them: by distance, phase function and their fronts.

    Args:
        table: R rectangles.
        segments: N rays.
        upto: ``(N, K)`` summed weights.
        which: ``(N, K)`` the rectangles; None where they are all.
        turns: see `turns_of`.

    Source: Kulla and Fajardo 2012 (equiangular sampling), with the phase function in the density of angles.
    """

    table: LampTable
    segments: Segments
    upto: Tensor
    which: Tensor | None
    turns: Tensor

    @staticmethod
    def of(
        table: LampTable, segments: Segments, fog: Fog, u: Tensor | None = None, alike: Tensor | None = None
    ) -> LampsAlong:
        """Weigh all lamps for each ray; with ``u`` ``(N,)`` in [0, 1) where there are many, a few drawn by power.

        Rays that follow each other with one number in ``alike`` ``(N,)`` share the weights of the first of them.
        """
        turns, which, power = turns_of(fog, table.power.device), None, table.power
        if u is not None and len(table) > CANDIDATES:
            steps = torch.arange(CANDIDATES, device=u.device) / CANDIDATES
            upto = table.power.cumsum(0)
            which = torch.searchsorted(upto, ((u[:, None] + steps) % 1.0) * upto[-1]).clamp_max(len(table) - 1)
            power = torch.full_like(u, 1 / CANDIDATES)[:, None]  # over what they are drawn by
        rays, group = segments, None
        if alike is not None and which is None:
            group, rays = shared(segments, alike)
        step = max(1, BLOCK // (len(table) if which is None else CANDIDATES))  # rays at a time: they stay in the cache
        each = [
            _weights(table, rays.of(part), fog, turns, None if which is None else which[part], power)
            for part in (slice(k, k + step) for k in range(0, len(rays.begin), step))
        ]
        weights = torch.cat(each)
        if group is not None:
            weights = weights + weights.sum(1, keepdim=True).clamp_min(1e-20) * (RARE * power / power.sum())
        upto = weights.cumsum(dim=1)
        upto = upto if group is None else upto[group]
        return LampsAlong(table=table, segments=segments, upto=upto, which=which, turns=turns)

    def draw(self, u: Tensor) -> Drawn:
        """S places on each ray, from numbers ``(4, S * N)`` in [0, 1): one on each of the rays, then another..."""
        table, total, count = self.table, self.upto[:, -1:], len(self.upto)
        place = torch.searchsorted(self.upto, (u[0].view(-1, count).T * total).contiguous(), right=True)
        place = place.clamp_max(self.upto.shape[1] - 1)
        own = self.upto.gather(1, place) - torch.where(place > 0, self.upto.gather(1, (place - 1).clamp_min(0)), 0.0)
        which, often, share = place, 1.0, (own / total.clamp_min(1e-30)).T.flatten()
        if self.which is not None:
            which = self.which.gather(1, place)
            often = CANDIDATES * table.power[which.T.flatten()]  # Talbot, Cline and Egbert 2005
        which = torch.where(share > 0, which.T.flatten(), 0)
        rays = self.segments.of(torch.arange(count, device=u.device).repeat(place.shape[1]))
        middle, off, low, high = (x[:, 0] for x in _reach(table, rays, which[:, None]))
        first, last = (_turned(self.turns, _angle(t, middle, off)) for t in (low, high))
        turned = first + (last - first) * u[1]
        cell = (torch.searchsorted(self.turns, turned, right=True) - 1).clamp(0, CELLS - 1)
        width = self.turns[cell + 1] - self.turns[cell]
        angle = ((cell + (turned - self.turns[cell]) / width).clamp(0, CELLS) / CELLS - 0.5) * math.pi
        t = (middle + off * angle.tan()).clamp(low, high)
        chance = width * (CELLS / math.pi) / (last - first).clamp_min(1e-30) * off / (off * off + (t - middle).square())
        chance = chance * often * share
        points = rays.points(t)
        away, solid = rectangle_points(points, table.corner[which], table.edge_u[which], table.edge_v[which], u[2:])
        light = torch.where((share > 0) & (high > low), solid / chance.clamp_min(1e-30), 0.0)
        return Drawn(t=t, points=points, away=away, light=light[:, None] * table.radiance[which])


def turns_of(fog: Fog, device: torch.device) -> Tensor:
    """``(CELLS + 1,)`` the phase function, summed over angles from behind a lamp's nearest place on a ray to before it,
    where light goes straight on."""
    angle = ((torch.arange(CELLS, device=device) + 0.5) / CELLS - 0.5) * math.pi
    return torch.nn.functional.pad((phase(fog, -angle.sin()) * (math.pi / CELLS)).cumsum(0), (1, 0))


def shared(ray: Segments, alike: Tensor) -> tuple[Tensor, Segments]:
    """``(N,)`` the group of each ray, and a ray for each group: its first, as long as all of them.

    On a GPU as many rays are weighed as there might be groups.
    """
    begins = torch.cat([torch.ones_like(alike[:1], dtype=torch.bool), alike[1:] != alike[:-1]])
    group, one = begins.cumsum(0) - 1, ray.of(places(begins)[0])
    begin = one.begin.scatter_reduce(0, group, ray.begin, "amin")
    return group, replace(one, begin=begin, end=one.end.scatter_reduce(0, group, ray.end, "amax"))


def _weights(table: LampTable, ray: Segments, fog: Fog, turns: Tensor, which: Tensor | None, power: Tensor) -> Tensor:
    """``(N, K)``: about how much fog along rays scatters of lamps."""
    middle, off, low, high = _reach(table, ray, which)
    thick = (fog.depth(*ray.entry(), ray.length()) / ray.length().clamp_min(1e-9))[:, None]
    near = middle.clamp(low, high)
    far = ((middle - near).square() + off * off).sqrt()
    given = _turned(turns, _angle(high, middle, off)) - _turned(turns, _angle(low, middle, off))
    given = power / off * given.clamp_min(0) * (-thick * (near - ray.begin[:, None] + far)).exp()
    return torch.where(high > low, given, 0.0)


def _reach(table: LampTable, ray: Segments, which: Tensor | None) -> tuple[Tensor, ...]:
    """``(N, K)``: where rays come nearest to lamps, how near, between where they lie before their fronts."""
    center = table.corner + (table.edge_u + table.edge_v) / 2
    least = (table.edge_u + table.edge_v).norm(dim=1) / 4
    home = ray.origins.mean(dim=0)  # products of large coordinates would round
    start = ray.origins - home
    if which is None:
        center, facing = (center - home).T, table.facing.T
        middle = ray.directions @ center - (ray.directions * start).sum(1, keepdim=True)
        square = start.square().sum(1, keepdim=True) + center.square().sum(0) - 2 * (start @ center)
        above = start @ facing - ((table.corner - home) * table.facing).sum(1)
        rise = ray.directions @ facing
    else:
        away, facing, least = (center - home)[which] - start[:, None], table.facing[which], least[which]
        middle = (away * ray.directions[:, None]).sum(2)
        square = away.square().sum(2)
        above, rise = -(away * facing).sum(2), (ray.directions[:, None] * facing).sum(2)
    off = (square - middle * middle).clamp_min(0).sqrt().maximum(least)
    cross = -above / torch.where(rise.abs() < FLAT, FLAT, rise)
    none = (rise.abs() < FLAT) & (above <= 0)
    low = torch.where(rise >= FLAT, cross.maximum(ray.begin[:, None]), ray.begin[:, None])
    high = torch.where(rise <= -FLAT, cross.minimum(ray.end[:, None]), ray.end[:, None])
    high = torch.where(none, low, high).maximum(low)
    return middle, off, low, high


def _turned(turns: Tensor, angle: Tensor) -> Tensor:
    """`turns_of` up to an angle."""
    place = ((angle / math.pi + 0.5) * CELLS).clamp(0, CELLS)
    cell = place.long().clamp_max(CELLS - 1)
    return torch.lerp(turns[cell], turns[cell + 1], place - cell)


def _angle(t: Tensor, middle: Tensor, off: Tensor) -> Tensor:
    return ((t - middle) / off).atan()
