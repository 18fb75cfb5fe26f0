"""Light that fog scatters toward the eye: sun, sky and lamps, scattered once.

Places along a ray are drawn in proportion to the light that fog takes there, so that the mean over them is the source
term's; lamps are drawn apart, by what they send to the ray. Shadow rays are the compiled `tracer.traversal`'s.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt.directions import tangent_frame
from tracer.lights.emitters import lamps_of
from tracer.lights.lamp_table import LampTable
from tracer.lights.shadows import SHORT
from tracer.lights.sky import sky_along
from tracer.lights.sky_table import SkyTable
from tracer.sampling.sequence import BELOW_ONE, disc
from tracer.scene.fog import Fog
from tracer.scene.scene import Scene, Sun
from tracer.traversal.rays import transmission

SUN_STEPS, SKY_STEPS, LAMP_STEPS = 8, 4, 4  # shadow rays a ray through the fog
CANDIDATES = 64  # lamps that are weighed for a ray; with more lamps so many of them are drawn
NEAREST = 0.05  # world units: a ray that meets a lamp's point would weigh it without bound
NOTHING = 1e-7  # share of light below which fog is not marched


@dataclass(frozen=True, eq=False, kw_only=True)
class Segments:
    """Parts of rays through fog, ``(N, 3)`` and ``(N,)``: world space, unit directions, world units."""

    origins: Tensor
    directions: Tensor
    begin: Tensor
    end: Tensor

    def points(self, t: Tensor) -> Tensor:
        """``(N, 3)`` at distances ``(N,)`` from the origins."""
        return self.origins + self.directions * t[:, None]

    def entry(self) -> tuple[Tensor, Tensor]:
        """Height where each begins, and its rise a unit."""
        return self.points(self.begin)[:, 1], self.directions[:, 1]

    def length(self) -> Tensor:
        """World units; none where the end comes first."""
        return (self.end - self.begin).clamp_min(0)

    def of(self, chosen: Tensor) -> Segments:
        """Those of an index."""
        fields = (self.origins, self.directions, self.begin, self.end)
        origins, directions, begin, end = (t[chosen] for t in fields)
        return Segments(origins=origins, directions=directions, begin=begin, end=end)


def phase(fog: Fog, cosine: Tensor) -> Tensor:
    """Share of light that is scattered into a steradian, by the cosine of the angle that it turns.

    Source: Henyey and Greenstein 1941.
    """
    g = fog.anisotropy
    return (1 - g * g) / (4 * math.pi * (1 + g * g - 2 * g * cosine).clamp_min(1e-9) ** 1.5)


def passes(fog: Fog, segments: Segments) -> Tensor:
    """``(N,)``: the share of light that fog lets through."""
    return (-fog.depth(*segments.entry(), segments.length())).exp()


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
    march = _March(scene, scene.fog, segments.of(some), taken[some], poses)
    noise = noise[:, some]
    found = march.sky(noise[3:6], index)
    if scene.sun is not None:
        found = found + march.sun(scene.sun, noise[:3], index)
    lamps = LampTable.of(lamps_of(scene, poses), (0, 0, 0), (1, 1, 1))
    if len(lamps):
        found = found + march.lamps(lamps, noise[6:10], index)
    light[some] = found * light.new_tensor(scene.fog.albedo)
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
        g, light = self.fog.anisotropy, torch.zeros_like(self.segments.origins)
        across, other = tangent_frame(self.segments.directions)
        table = SkyTable.of(self.scene)
        if table is None:
            return light
        for step, u in enumerate(_points(noise, SKY_STEPS, index)):
            # the cosine that Henyey and Greenstein's function gives for a number in [0, 1)
            x = (1 - g * g) / (1 - g + 2 * g * u[1])
            cosine = (1 + g * g - x * x) / (2 * g) if abs(g) > 1e-3 else 1 - 2 * u[1]
            cosine = cosine.clamp(-1, 1)[:, None]
            sine, angle = (1 - cosine * cosine).sqrt(), 2 * math.pi * u[2, :, None]
            ways = across * (sine * angle.cos()) + other * (sine * angle.sin()) + self.segments.directions * cosine
            if step % 2:  # half by the phase function, half by the sky's light: both know peaks of their own
                ways, _ = table.sample(u[1:])
            share = phase(self.fog, (ways * self.segments.directions).sum(1))
            share = 2 * share / (share + table.density_of(ways))
            light = light + self._seen(self._place(u[0]), ways) * sky_along(self.scene, ways) * share[:, None]
        return light / SKY_STEPS

    def lamps(self, table: LampTable, noise: Tensor, index: int) -> Tensor:
        light = torch.zeros_like(self.segments.origins)
        for u in _points(noise, LAMP_STEPS, index):
            chosen, scale = self._choose(table, u[0])
            spot = table.corner[chosen] + table.edge_u[chosen] * u[1, :, None] + table.edge_v[chosen] * u[2, :, None]
            middle, off, low, high = self._angles(spot)
            t = (middle + off * (low + (high - low) * u[3]).tan()).clamp(self.segments.begin, self.segments.end)
            points = self.segments.points(t)
            away = spot - points
            distance = away.norm(dim=1).clamp_min(1e-6)
            ways = away / distance[:, None]
            # the place's density is off / ((high - low) distance^2): it cancels the fall of light with distance
            weight = scale * table.area[chosen] * (-(ways * table.facing[chosen]).sum(1)).clamp_min(0)
            weight = weight * (high - low) / off * phase(self.fog, (ways * self.segments.directions).sum(1))
            height, rise = self.segments.entry()
            before = self.fog.depth(height, rise, t - self.segments.begin)
            between = self.fog.depth(points[:, 1], ways[:, 1], distance)
            weight = weight * self.fog.density(points[:, 1]) * (-before - between).exp() / self.taken
            seen = self._seen(points, ways, (distance - SHORT).clamp_min(0))
            light = light + seen * weight[:, None] * table.radiance[chosen]
        return light / LAMP_STEPS

    def _choose(self, table: LampTable, u: Tensor) -> tuple[Tensor, Tensor]:
        """A rectangle for each segment, in proportion to what its middle sends there, and the inverse of how often."""
        every, count = torch.arange(len(table), device=u.device), len(u)
        if len(table) <= CANDIDATES:
            drawn, ratio = every[:, None].expand(-1, count), torch.ones(len(table), 1, device=u.device)
        else:  # resampling: few by power, of which one by what it sends
            steps = torch.arange(CANDIDATES, device=u.device)[:, None] / CANDIDATES
            upto = table.power.cumsum(0)
            drawn = torch.searchsorted(upto, ((u * 7919 % 1 + steps) % 1.0) * upto[-1]).clamp_max(len(table) - 1)
            ratio = 1 / (table.power[drawn] * CANDIDATES).clamp_min(1e-30)
        middle = table.corner + (table.edge_u + table.edge_v) / 2
        parts = []
        for which in drawn:
            spot = middle[which]
            _, off, low, high = self._angles(spot)
            dim = (-self.fog.extinction * off).clamp_min(-20).exp()
            parts.append(table.power[which] * (high - low) / off * dim)
        upto = (torch.stack(parts) * ratio).cumsum(dim=0)
        place = (u * upto[-1] >= upto).sum(dim=0).clamp_max(len(drawn) - 1)[None]
        own = (torch.stack(parts)).gather(0, place)[0]
        chosen = drawn.gather(0, place)[0]
        return chosen, upto[-1] / own.clamp_min(1e-30)

    def _angles(self, spot: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Distance along each ray to where it comes nearest to a spot, how near that is, and the angles of its ends."""
        middle = ((spot - self.segments.origins) * self.segments.directions).sum(1)
        off = (spot - self.segments.points(middle)).norm(dim=1).clamp_min(NEAREST)
        low, high = (((t - middle) / off).atan() for t in (self.segments.begin, self.segments.end))
        return middle, off, low, torch.maximum(high, low)

    def _place(self, u: Tensor) -> Tensor:
        """``(N, 3)`` points in proportion to what fog takes there."""
        height, rise = self.segments.entry()
        t = self.fog.distance(height, rise, -torch.log1p(-u * self.taken))
        return self.segments.points(self.segments.begin + t.minimum(self.segments.length()))

    def _seen(self, points: Tensor, ways: Tensor, far: Tensor | float = torch.inf) -> Tensor:
        return transmission(self.scene, points, ways, poses=self.poses, t_max=far)


def _points(noise: Tensor, steps: int, index: int) -> list[Tensor]:
    """For each step ``(D, N)`` in [0, 1): one additive sequence over steps and frames.

    Source: Roberts 2018 (R sequences).
    """
    dims, ratio = len(noise), 2.0
    for _ in range(30):
        ratio = (1 + ratio) ** (1 / (dims + 1))
    turns = [ratio ** -(d + 1) for d in range(dims)]
    numbers = range(index * steps, (index + 1) * steps)
    shifts = (noise.new_tensor([[number * turn % 1] for turn in turns]) for number in numbers)
    return [((noise + shift) % 1.0).clamp_max(BELOW_ONE) for shift in shifts]
