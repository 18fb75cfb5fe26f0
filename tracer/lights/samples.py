"""Next-event estimation: one direction to the sun and one to a lamp for each point.

Directions to the sky are in `tracer.lights.sky_table`."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt.directions import tangent_frame
from tracer.lights.emitters import lamps_of
from tracer.lights.lamp_table import LampTable
from tracer.lights.shadows import SHORT
from tracer.lights.sky_table import SkyTable
from tracer.lights.spherical_rectangle import rectangle_points
from tracer.sampling.scatter import dot
from tracer.sampling.sequence import disc
from tracer.scene.scene import Scene, Sun

NEAR = 0.02  # area over squared distance above which a rectangle is sampled by solid angle
DIMS = 6  # random numbers that the two samples use


@dataclass(frozen=True, eq=False, kw_only=True)
class LightSample:
    """One direction toward a light for each of N points.

    Args:
        direction: ``(N, 3)`` unit length.
        distance: ``(N,)`` to just before the light, inf for the sun.
        energy: ``(N, 3)`` radiance divided by the density of this direction, per steradian.
        facing: ``(N, 3)`` unit normal of the lamp there; None for the sun.
    """

    direction: Tensor
    distance: Tensor
    energy: Tensor
    facing: Tensor | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class Lights:
    """What is sampled as direct light: the sun's disc, the lamps, and the sky.

    Args:
        sun: or None.
        lamps: or None where there are none.
        sky: or None where it is black.
    """

    sun: Sun | None
    lamps: LampTable | None
    sky: SkyTable | None = None

    @staticmethod
    def of(scene: Scene, poses: Tensor) -> Lights:
        """The lights of a scene whose instances are at ``poses`` ``(I, 4, 4)``."""
        lamps = lamps_of(scene, poses)
        table = LampTable.of(lamps, *scene.world.bounds()) if len(lamps) else None
        return Lights(sun=scene.sun, lamps=table, sky=SkyTable.of(scene))

    def at(self, scene: Scene, poses: Tensor) -> Lights:
        """The same lights with the instances at other ``poses``; their probabilities stay."""
        return self if self.lamps is None else replace(self, lamps=self.lamps.moved(lamps_of(scene, poses)))

    def sample(self, points: Tensor, normals: Tensor, u: Tensor) -> list[LightSample]:
        """A sample of sun and lamps, where there are any, for surfaces ``(N, 3)`` from numbers ``(6, N)`` in [0, 1)."""
        samples = []
        if self.sun is not None:
            samples.append(sun_sample(self.sun, u[:2]))
        if self.lamps is not None:
            samples.append(lamp_sample(self.lamps, points, normals, u[2:]))
        return samples


def sun_sample(sun: Sun, u: Tensor) -> LightSample:
    """Directions uniform over the sun's disc, from numbers ``(2, N)``."""
    sine = math.sin(math.radians(sun.angular_radius))
    toward = F.normalize(torch.tensor(sun.direction, dtype=u.dtype, device=u.device), dim=0)[None]
    across, other = tangent_frame(toward)
    x, y = disc(u)[:, :, None] * sine
    along = (1 - x * x - y * y).sqrt()
    direction = across * x + other * y + toward * along
    # uniform over the projected disc, so that every sample gives a surface facing the sun its full irradiance
    energy = u.new_tensor(sun.irradiance) / along
    distance = torch.full_like(u[0], torch.inf)
    return LightSample(direction=direction, distance=distance, energy=energy)


def lamp_sample(lamps: LampTable, points: Tensor, normals: Tensor, u: Tensor) -> LightSample:
    """A point on one rectangle, from numbers ``(4, N)``: uniform in area, or in solid angle where it is near."""
    chosen, factor = lamps.choose(points, normals, u[:2])
    corner, edge_u, edge_v = lamps.corner[chosen], lamps.edge_u[chosen], lamps.edge_v[chosen]
    facing, area = lamps.facing[chosen], lamps.area[chosen]
    way = corner + edge_u * u[2, :, None] + edge_v * u[3, :, None] - points
    above = -dot(facing, way)
    square = dot(way, way).clamp_min(1e-12)
    angle = area * above / (square * square.sqrt())
    middle = corner + (edge_u + edge_v) / 2 - points
    near = ((above > 0) & (area > NEAR * dot(middle, middle))).nonzero()[:, 0]
    places = (points[near], corner[near], edge_u[near], edge_v[near])
    way[near], angle[near] = rectangle_points(*places, u[2:, near])
    distance = dot(way, way).clamp_min(1e-12).sqrt()
    return LightSample(
        direction=way / distance[:, None],
        distance=(distance - SHORT).clamp_min(0),
        energy=lamps.radiance[chosen] * (angle.clamp_min(0) * factor)[:, None],
        facing=facing,
    )
