"""Light that fog scatters toward the eye: sun, sky and lamps, scattered once.

Places along a ray are drawn in proportion to the light that fog takes there, so that the mean over them is the source
term's; lamps are drawn apart, see `tracer.lights.along`. Shadow rays are the compiled `tracer.traversal`'s.

Most noise lies in a few pixels: at shafts of light, thin openings and lamps. All take a few steps of each light, and
those around which these differ most take many more.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt.compute.resident import numbers, places, resident_on
from gbufrt.directions import tangent_frame
from tracer.lights.along import LampsAlong
from tracer.lights.emitters import lamps_of
from tracer.lights.lamp_table import LampTable
from tracer.lights.segments import Segments, passes, phase, phase_direction
from tracer.lights.shadows import SHORT
from tracer.lights.sky import sky_along
from tracer.lights.sky_table import SkyTable
from tracer.sampling.sequence import BELOW_ONE, disc
from tracer.scene.fog import Fog
from tracer.scene.scene import Scene, Sun
from tracer.traversal.rays import transmission


class Steps(NamedTuple):
    """Places on a ray through the fog, a frame: at every pixel, and at most at those that need more."""

    first: int
    most: int


SUN, SKY, LAMPS = Steps(5, 64), Steps(3, 20), Steps(4, 32)
UNEVEN = 0.1  # share of pixels that take most steps
NEIGHBOURS = 7  # pixels across
SHARED = 4  # pixels both ways that weigh lamps together for their first steps
GOLDEN = (5**0.5 - 1) / 2
WIDE = 1 << 15  # rays at a time: bounds memory
FEW = 512  # lamps up to which all are weighed for every ray
NOTHING = 1e-7  # share of light below which fog is not marched


def scattered(
    scene: Scene, segments: Segments, noise: Tensor, *, poses: Tensor, index: int = 0, coherent: bool = True
) -> Tensor:
    """Mean light that fog scatters toward the eye, over the share of light that it takes.

    Times ``1 - passes(...)`` it is what fog adds before a surface. It hardly depends on where the segment ends, so it
    can be filtered across edges of depth.

    Args:
        scene: with fog. Sun and sky reach it undimmed, as they reach surfaces; light of lamps is dimmed on its way.
        segments: of H x W pixels, row by row.
        noise: ``(10, H, W)`` in [0, 1).
        poses: ``(I, 4, 4)`` of the scene's instances.
        index: frame number: others draw other places, well spread over time.
        coherent: whether neighbouring rays run side by side.

    Returns:
        ``(H * W, 3)`` linear radiance; 0 where fog takes nothing.

    Source: Kulla and Fajardo 2012 (importance sampling in participating media); Veach and Guibas 1995 for the sky.
    """
    assert scene.fog is not None
    fog, size, u = scene.fog, noise.shape[1:], noise.flatten(1)
    light = segments.origins.new_zeros(len(segments.begin), 3)
    taken = 1 - passes(fog, segments)
    blocks = _blocks(size, SHARED if coherent else 1, taken.device)
    order = blocks.argsort(stable=True)
    order = order[places(taken[order] > NOTHING)]
    if not len(order):
        return light
    table = LampTable.of(lamps_of(scene, poses), (0, 0, 0), (1, 1, 1))

    def march(add: Callable[[_March, Tensor, range, Tensor | None], Tensor], steps: Steps, dims: slice) -> Tensor:
        """Mean of the first steps, or of all of them where those around differ most."""
        found, more = torch.zeros_like(light), steps.most - steps.first
        for part in order.split(WIDE):
            rays = _March(scene, fog, segments.of(part), taken[part], poses)
            some = add(rays, u[dims, part], range(index * steps.first, (index + 1) * steps.first), blocks[part])
            found[part] = torch.where(taken[part, None] > NOTHING, some, 0.0)
        uneven, differ = _uneven(found.mean(dim=1).view(size), taken.view(size))
        for part in uneven.split(WIDE) if len(uneven) else ():
            rays = _March(scene, fog, segments.of(part), taken[part], poses)
            rest = add(rays, u[dims, part], range(-(index + 1) * more, -index * more), None)
            found[part] = torch.where(differ[part, None], torch.lerp(found[part], rest, more / steps.most), found[part])
        return found

    sun, sky = scene.sun, SkyTable.of(scene)
    if sun is not None:
        light += march(lambda rays, u, steps, _: rays.sun(sun, u, steps), SUN, slice(0, 3))
    if sky is not None:
        light += march(lambda rays, u, steps, _: rays.sky(sky, u, steps), SKY, slice(3, 6))
    if len(table):
        light += march(lambda rays, u, steps, alike: rays.lamps(table, u, steps, alike), LAMPS, slice(6, 10))
    return light * numbers((fog.albedo,), light)[0]


def _blocks(size: tuple[int, ...], side: int, device: torch.device) -> Tensor:
    """``(H * W,)`` the number of the square that each pixel lies in."""
    rows, columns = (torch.arange(n, device=device) // side for n in size)
    return (rows[:, None] * -(-size[1] // side) + columns).flatten()


def _uneven(light: Tensor, taken: Tensor) -> tuple[Tensor, Tensor]:
    """Pixels around which light differs most, by what fog takes at each; and ``(H * W,)`` bool, where it does.

    A pixel's own light has no part in that: were more steps taken where the first saw something, the mean would be off.
    """
    reach, each = NEIGHBOURS // 2, torch.stack([torch.ones_like(light), light, light * light])[:, None]
    around = F.conv2d(each, _ring(light), padding=reach)[:, 0]
    mean, square = around[1:] / around[0].clamp_min(1)
    spread = ((square - mean * mean).clamp_min(0).sqrt() * taken).flatten()
    worst, where = spread.topk(math.ceil(len(spread) * UNEVEN))
    return where[places(worst > 0)], spread > 0


def _ring(like: Tensor) -> Tensor:
    ring = like.new_ones(1, 1, NEIGHBOURS, NEIGHBOURS)
    ring[..., NEIGHBOURS // 2, NEIGHBOURS // 2] = 0
    return ring


@dataclass(frozen=True, eq=False)
class _March:
    scene: Scene
    fog: Fog
    segments: Segments
    taken: Tensor
    poses: Tensor

    def sun(self, sun: Sun, noise: Tensor, steps: range) -> Tensor:
        toward = F.normalize(numbers((sun.direction,), noise), dim=1)
        across, other = tangent_frame(toward)
        sine, light = math.sin(math.radians(sun.angular_radius)), 0.0
        irradiance = numbers((sun.irradiance,), noise)[0]
        for rays, u in self._steps(noise, steps):
            x, y = disc(u[1:])[:, :, None] * sine
            ways = across * x + other * y + toward * (1 - x * x - y * y).sqrt()
            light = light + self._sum(rays._seen(rays._place(u[0]), ways))
        share = phase(self.fog, self.segments.directions @ toward[0])
        return light * share[:, None] * irradiance / len(steps)

    def sky(self, table: SkyTable, noise: Tensor, steps: range) -> Tensor:
        light = torch.zeros_like(self.segments.origins)
        for rays, u in self._steps(noise, steps):
            points, onward = rays._place(u[0]), rays.segments.directions
            for ways in (phase_direction(self.fog, onward, u[1:]), table.sample(u[1:])[0]):
                share = phase(self.fog, (ways * onward).sum(1))
                share = share / (share + table.density_of(ways))  # both know peaks of their own
                light = light + self._sum(rays._seen(points, ways) * sky_along(self.scene, ways) * share[:, None])
        return light / len(steps)

    def lamps(self, table: LampTable, noise: Tensor, steps: range, alike: Tensor | None) -> Tensor:
        light = torch.zeros_like(self.segments.origins)
        known = LampsAlong.of(table, self.segments, self.fog, alike=alike) if len(table) <= FEW else None
        for rays, u in self._steps(noise, steps):
            along = known or LampsAlong.of(table, rays.segments, self.fog, u[0] * 7919 % 1)
            drawn, (height, rise) = along.draw(u), rays.segments.entry()
            far = drawn.away.norm(dim=1).clamp_min(1e-6)
            ways = drawn.away / far[:, None]
            depth = self.fog.depth(height, rise, drawn.t - rays.segments.begin)
            depth = depth + self.fog.depth(drawn.points[:, 1], ways[:, 1], far)
            weight = phase(self.fog, (ways * rays.segments.directions).sum(1)) * self.fog.density(drawn.points[:, 1])
            weight = weight * (-depth).exp() / rays.taken
            seen = rays._seen(drawn.points, ways, (far - SHORT).clamp_min(0))
            light = light + self._sum(seen * weight[:, None] * drawn.light)
        return light / len(steps)

    def _steps(self, noise: Tensor, steps: range) -> Iterator[tuple[_March, Tensor]]:
        """As many steps at a time as there is room for: rays once for each, and their ``(D, S * N)`` in [0, 1)."""
        points, count = _points(noise, steps), len(self.taken)
        for u in points.split(max(1, WIDE // count), dim=1):
            index = torch.arange(count, device=u.device).repeat(u.shape[1])
            yield replace(self, segments=self.segments.of(index), taken=self.taken[index]), u.flatten(1)

    def _sum(self, light: Tensor) -> Tensor:
        return light.view(-1, len(self.taken), light.shape[1]).sum(dim=0)

    def _place(self, u: Tensor) -> Tensor:
        """``(N, 3)`` points in proportion to what fog takes there."""
        height, rise = self.segments.entry()
        t = self.fog.distance(height, rise, -torch.log1p(-u * self.taken))
        return self.segments.points(self.segments.begin + t.minimum(self.segments.length()))

    def _seen(self, points: Tensor, ways: Tensor, far: Tensor | float = torch.inf) -> Tensor:
        far = torch.where(self.taken > NOTHING, far, 0.0)
        return transmission(self.scene, points, ways, poses=self.poses, t_max=far)


def _points(noise: Tensor, steps: range) -> Tensor:
    """``(D, S, N)`` in [0, 1) for S steps: one additive sequence over steps and frames.

    The first number, by which most light differs, goes by the golden ratio, which no other ratio spreads better.

    Source: Roberts 2018 (R sequences).
    """
    dims, ratio = len(noise), 2.0
    for _ in range(30):
        ratio = (1 + ratio) ** (1 / dims)
    turns = (GOLDEN, *(ratio ** -(d + 1) for d in range(dims - 1)))
    number = torch.arange(steps.start, steps.stop, dtype=torch.float64, device=noise.device)
    shifts = resident_on(noise.device, turns, torch.float64)[:, None] * number % 1
    return ((noise[:, None] + shifts.to(noise)[..., None]) % 1.0).clamp_max(BELOW_ONE)
