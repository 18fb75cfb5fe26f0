"""Next-event estimation: where light may come from, one direction to the sun and one to a lamp for each point."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import torch
import torch.nn.functional as F
from torch import Tensor

from tracer.emitters import lamps_of
from tracer.lamp_table import LampTable
from tracer.scatter import dot, frame
from tracer.scene import Scene, Sun
from tracer.sequence import disc
from tracer.shadows import SHORT

DIMS = 5  # numbers that the two samples take


@dataclass(frozen=True, eq=False, kw_only=True)
class LightSample:
    """One direction in which light may come to each of N points.

    Args:
        direction: ``(N, 3)`` unit length.
        distance: ``(N,)`` to just before the light, inf for the sun.
        energy: ``(N, 3)`` radiance over the density, per steradian, of having chosen this direction.
        facing: ``(N, 3)`` unit normal of the lamp there; None for the sun.
    """

    direction: Tensor
    distance: Tensor
    energy: Tensor
    facing: Tensor | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class Lights:
    """What is sampled as direct light: the sun's disc and the lamps. The sky is not: rays find it.

    Args:
        sun: or None.
        lamps: or None where nothing shines.
    """

    sun: Sun | None
    lamps: LampTable | None

    @staticmethod
    def of(scene: Scene, poses: Tensor) -> Lights:
        """The lights of a scene whose instances are at ``poses`` ``(I, 4, 4)``."""
        lamps = lamps_of(scene, poses)
        return Lights(sun=scene.sun, lamps=LampTable.of(lamps, *scene.world.bounds()) if len(lamps) else None)

    def at(self, scene: Scene, poses: Tensor) -> Lights:
        """The same lights with the instances at other ``poses``; how often each is chosen stays as it was."""
        return self if self.lamps is None else replace(self, lamps=self.lamps.moved(lamps_of(scene, poses)))

    def sample(self, points: Tensor, u: Tensor) -> list[LightSample]:
        """A sample of every kind of light there is, for points ``(N, 3)`` from numbers ``(5, N)`` in [0, 1)."""
        samples = []
        if self.sun is not None:
            samples.append(sun_sample(self.sun, u[:2]))
        if self.lamps is not None:
            samples.append(lamp_sample(self.lamps, points, u[2:5]))
        return samples


def sun_sample(sun: Sun, u: Tensor) -> LightSample:
    """Directions spread evenly over the sun's disc, from numbers ``(2, N)``."""
    sine = math.sin(math.radians(sun.angular_radius))
    toward = F.normalize(torch.tensor(sun.direction, dtype=u.dtype, device=u.device), dim=0)[None]
    across, other = frame(toward)
    x, y = disc(u)[:, :, None] * sine
    along = (1 - x * x - y * y).sqrt()
    direction = across * x + other * y + toward * along
    # even over the disc as it is seen, so that a surface facing the sun receives its irradiance from every sample
    energy = u.new_tensor(sun.irradiance) / along
    distance = torch.full_like(u[0], torch.inf)
    return LightSample(direction=direction, distance=distance, energy=energy)


def lamp_sample(lamps: LampTable, points: Tensor, u: Tensor) -> LightSample:
    """A point on one rectangle, from numbers ``(3, N)``."""
    chosen, chance = lamps.choose(points, u[0])
    way = lamps.corner[chosen] + lamps.edge_u[chosen] * u[1, :, None] + lamps.edge_v[chosen] * u[2, :, None] - points
    square = (way * way).sum(dim=1).clamp_min(1e-12)
    distance = square.sqrt()
    direction = way / distance[:, None]
    outward = lamps.outward[chosen]
    shown = -dot(outward, direction)  # area as it is seen from the point
    energy = lamps.radiance[chosen] * (shown.clamp_min(0) / (square * chance))[:, None]
    facing = F.normalize(outward, dim=1)
    return LightSample(direction=direction, distance=(distance - SHORT).clamp_min(0), energy=energy, facing=facing)
