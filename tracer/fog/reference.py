"""Steps through fog: places on rays, and the light that comes to each of them along a shadow ray."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Self

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt.compute.resident import numbers, resident_on
from gbufrt.directions import tangent_frame
from tracer.fog.along import LampsAlong
from tracer.fog.segments import Segments, phase, phase_direction
from tracer.lights.samples import Lights
from tracer.lights.shadows import SHORT
from tracer.lights.sky import sky_along
from tracer.sampling.sequence import BELOW_ONE, disc
from tracer.scene.fog import Fog
from tracer.scene.scene import Scene
from tracer.traversal.rays import transmission

GOLDEN = (5**0.5 - 1) / 2
WIDE = 1 << 15  # rays at a time: bounds memory
FEW = 512  # lamps up to which all are weighed for every ray
TURN = 7919  # by which candidates among more lamps take other numbers than places do
NOTHING = 1e-7  # share of light below which fog is not marched


@dataclass(frozen=True, eq=False, kw_only=True)
class March:
    """N rays through the fog of a scene; the mean light of steps along each, over the share that fog takes.

    Its methods take ``(D, N)`` numbers in [0, 1) and the numbers of the steps, and return ``(N, 3)``.

    Args:
        scene: with ``fog``.
        fog: of the scene.
        lights: of the scene.
        poses: ``(I, 4, 4)`` of its instances.
        segments: the rays.
        taken: ``(N,)`` share of light that fog takes along each.
    """

    scene: Scene
    fog: Fog
    lights: Lights
    poses: Tensor
    segments: Segments
    taken: Tensor

    def of(self, chosen: Tensor) -> Self:
        """Some of the rays."""
        return replace(self, segments=self.segments.of(chosen), taken=self.taken[chosen])

    def sun(self, noise: Tensor, steps: range) -> Tensor:
        """Of the sun's disc, by three numbers a ray."""
        sun, light = self.lights.sun, torch.zeros_like(self.segments.origins)
        assert sun is not None
        toward = F.normalize(numbers((sun.direction,), noise), dim=1)
        across, other = tangent_frame(toward)
        sine = math.sin(math.radians(sun.angular_radius))
        irradiance = numbers((sun.irradiance,), noise)[0]
        for rays, u in self._steps(noise, steps):
            x, y = disc(u[1:])[:, :, None] * sine
            ways = across * x + other * y + toward * (1 - x * x - y * y).sqrt()
            light = light + self._sum(rays._seen(rays._place(u[0]), ways))
        share = phase(self.fog, self.segments.directions @ toward[0])
        return light * share[:, None] * irradiance / len(steps)

    def sky(self, noise: Tensor, steps: range) -> Tensor:
        """Of the sky, by three numbers a ray; two shadow rays a step."""
        table, light = self.lights.sky, torch.zeros_like(self.segments.origins)
        assert table is not None
        for rays, u in self._steps(noise, steps):
            points, onward = rays._place(u[0]), rays.segments.directions
            for ways in (phase_direction(self.fog, onward, u[1:]), table.sample(u[1:])[0]):
                share = phase(self.fog, (ways * onward).sum(1))
                share = share / (share + table.density_of(ways))  # both know peaks of their own
                light = light + self._sum(rays._seen(points, ways) * sky_along(self.scene, ways) * share[:, None])
        return light / len(steps)

    def lamps(self, noise: Tensor, steps: range, alike: Tensor | None) -> Tensor:
        """Of lamps, by four numbers a ray, see `LampsAlong`."""
        table, light = self.lights.lamps, torch.zeros_like(self.segments.origins)
        assert table is not None
        known = LampsAlong.of(table, self.segments, self.fog, alike=alike) if len(table) <= FEW else None
        for rays, u in self._steps(noise, steps):
            along = known or LampsAlong.of(table, rays.segments, self.fog, u[0] * TURN % 1)
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

    def _steps(self, noise: Tensor, steps: range) -> Iterator[tuple[Self, Tensor]]:
        """As many steps at a time as there is room for: rays once for each, and their ``(D, S * N)`` in [0, 1)."""
        count = len(self.taken)
        points = ((noise[:, None] + shifts(steps, noise)[..., None]) % 1.0).clamp_max(BELOW_ONE)
        for u in points.split(max(1, WIDE // count), dim=1):
            yield self.of(torch.arange(count, device=u.device).repeat(u.shape[1])), u.flatten(1)

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


def shifts(steps: range, noise: Tensor) -> Tensor:
    """``(D, S)`` in [0, 1) by which S steps turn the numbers ``(D, N)`` of all rays: a sequence over steps and frames.

    The first number, by which most light differs, goes by the golden ratio, which no other ratio spreads better.

    Source: Roberts 2018 (R sequences).
    """
    dims, ratio = len(noise), 2.0
    for _ in range(30):
        ratio = (1 + ratio) ** (1 / dims)
    turns = (GOLDEN, *(ratio ** -(d + 1) for d in range(dims - 1)))
    number = torch.arange(steps.start, steps.stop, dtype=torch.float64, device=noise.device)
    return (resident_on(noise.device, turns, torch.float64)[:, None] * number % 1).to(noise)
