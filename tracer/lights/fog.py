"""Light that fog scatters toward the eye: sun, sky and lamps, scattered once.

Places along a ray are drawn in proportion to the light that fog takes there, so that the mean over them is the source
term's; lamps are drawn apart, see `tracer.lights.along`. Shadow rays are the compiled `tracer.traversal`'s.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor

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

SUN_STEPS, SKY_STEPS, LAMP_STEPS = 32, 10, 16  # places on a ray through the fog, a frame
GOLDEN = (5**0.5 - 1) / 2
WIDE = 1 << 15  # rays at a time: bounds memory
FEW = 512  # lamps up to which all are weighed for every ray
NOTHING = 1e-7  # share of light below which fog is not marched


def scattered(scene: Scene, segments: Segments, noise: Tensor, *, poses: Tensor, index: int = 0) -> Tensor:
    """Mean light that fog scatters toward the eye, over the share of light that it takes.

    Times ``1 - passes(...)`` it is what fog adds before a surface. It hardly depends on where the segment ends, so it
    can be filtered across edges of depth.

    Args:
        scene: with fog. Sun and sky reach it undimmed, as they reach surfaces; light of lamps is dimmed on its way.
        segments: N of them.
        noise: ``(10, N)`` in [0, 1).
        poses: ``(I, 4, 4)`` of the scene's instances.
        index: frame number: others draw other places, well spread over time.

    Returns:
        ``(N, 3)`` linear radiance; 0 where fog takes nothing.

    Source: Kulla and Fajardo 2012 (importance sampling in participating media); Veach and Guibas 1995 for the sky.
    """
    assert scene.fog is not None
    light = segments.origins.new_zeros(len(segments.begin), 3)
    taken = 1 - passes(scene.fog, segments)
    some = (taken > NOTHING).nonzero()[:, 0]
    if not len(some):
        return light
    lamps = LampTable.of(lamps_of(scene, poses), (0, 0, 0), (1, 1, 1))
    for part in some.split(WIDE):
        march, u = _March(scene, scene.fog, segments.of(part), taken[part], poses), noise[:, part]
        found = march.sky(u[3:6], index)
        if scene.sun is not None:
            found = found + march.sun(scene.sun, u[:3], index)
        if len(lamps):
            found = found + march.lamps(lamps, u[6:10], index)
        light[part] = found * light.new_tensor(scene.fog.albedo)
    return light


@dataclass(frozen=True, eq=False)
class _March:
    scene: Scene
    fog: Fog
    segments: Segments
    taken: Tensor
    poses: Tensor

    def sun(self, sun: Sun, noise: Tensor, index: int) -> Tensor:
        toward = F.normalize(noise.new_tensor([sun.direction]), dim=1)
        across, other = tangent_frame(toward)
        sine, light = math.sin(math.radians(sun.angular_radius)), 0.0
        for u in _points(noise, SUN_STEPS, index):
            x, y = disc(u[1:])[:, :, None] * sine
            ways = across * x + other * y + toward * (1 - x * x - y * y).sqrt()
            light = light + self._seen(self._place(u[0]), ways)
        share = phase(self.fog, self.segments.directions @ toward[0])
        return light * share[:, None] * noise.new_tensor(sun.irradiance) / SUN_STEPS

    def sky(self, noise: Tensor, index: int) -> Tensor:
        light = torch.zeros_like(self.segments.origins)
        table = SkyTable.of(self.scene)
        if table is None:
            return light
        for u in _points(noise, SKY_STEPS, index):
            points = self._place(u[0])
            for ways in (phase_direction(self.fog, self.segments.directions, u[1:]), table.sample(u[1:])[0]):
                share = phase(self.fog, (ways * self.segments.directions).sum(1))
                share = share / (share + table.density_of(ways))  # both know peaks of their own
                light = light + self._seen(points, ways) * sky_along(self.scene, ways) * share[:, None]
        return light / SKY_STEPS

    def lamps(self, table: LampTable, noise: Tensor, index: int) -> Tensor:
        light = torch.zeros_like(self.segments.origins)
        height, rise = self.segments.entry()
        points = _points(noise, LAMP_STEPS, index)
        known = LampsAlong.of(table, self.segments, self.fog) if len(table) <= FEW else None
        for u in points:
            along = known or LampsAlong.of(table, self.segments, self.fog, u[0] * 7919 % 1)
            drawn = along.draw(u)
            far = drawn.away.norm(dim=1).clamp_min(1e-6)
            ways = drawn.away / far[:, None]
            depth = self.fog.depth(height, rise, drawn.t - self.segments.begin)
            depth = depth + self.fog.depth(drawn.points[:, 1], ways[:, 1], far)
            weight = phase(self.fog, (ways * self.segments.directions).sum(1)) * self.fog.density(drawn.points[:, 1])
            weight = weight * (-depth).exp() / self.taken
            seen = self._seen(drawn.points, ways, (far - SHORT).clamp_min(0))
            light = light + seen * weight[:, None] * drawn.light
        return light / LAMP_STEPS

    def _place(self, u: Tensor) -> Tensor:
        """``(N, 3)`` points in proportion to what fog takes there."""
        height, rise = self.segments.entry()
        t = self.fog.distance(height, rise, -torch.log1p(-u * self.taken))
        return self.segments.points(self.segments.begin + t.minimum(self.segments.length()))

    def _seen(self, points: Tensor, ways: Tensor, far: Tensor | float = torch.inf) -> Tensor:
        return transmission(self.scene, points, ways, poses=self.poses, t_max=far)


def _points(noise: Tensor, steps: int, index: int) -> list[Tensor]:
    """For each step ``(D, N)`` in [0, 1): one additive sequence over steps and frames.

    The first number, by which most light differs, goes by the golden ratio, which no other ratio spreads better.

    Source: Roberts 2018 (R sequences).
    """
    dims, ratio = len(noise), 2.0
    for _ in range(30):
        ratio = (1 + ratio) ** (1 / dims)
    turns = [GOLDEN, *(ratio ** -(d + 1) for d in range(dims - 1))]
    numbers = range(index * steps, (index + 1) * steps)
    shifts = (noise.new_tensor([[number * turn % 1] for turn in turns]) for number in numbers)
    return [((noise + shift) % 1.0).clamp_max(BELOW_ONE) for shift in shifts]
