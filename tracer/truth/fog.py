"""The truth about fog that scatters once: many even steps along each ray, with shadow rays from every one."""

from __future__ import annotations

import math

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt.directions import tangent_frame
from tracer.lights.emitters import lamps_of
from tracer.lights.fog import Segments, phase
from tracer.lights.shadows import SHORT
from tracer.lights.sky import sky_along
from tracer.sampling.sequence import disc
from tracer.scene.scene import Scene
from tracer.traversal.rays import transmission

STEPS = 1024


def fog_truth(
    scene: Scene, segments: Segments, *, poses: Tensor, steps: int = STEPS, rays: int = 1, seed: int = 0
) -> Tensor:
    """Light that fog adds along segments, by brute force: nothing is drawn by what it gives.

    Args:
        scene: with fog.
        segments: N of them.
        poses: ``(I, 4, 4)`` of the scene's instances.
        steps: along each ray, evenly spaced, each at an even random place.
        rays: from each step to the sun, to the sky over the whole sphere, and to a face of any lamp by its area.
        seed: another seed, another noise.

    Returns:
        ``(N, 3)`` linear radiance.
    """
    fog = scene.fog
    assert fog is not None
    generator = torch.Generator().manual_seed(seed)
    lamps = lamps_of(scene, poses)
    used = lamps.edge_u.abs().sum(dim=2) > 0
    corner, across, down = (t[used] for t in (lamps.corner, lamps.edge_u, lamps.edge_v))
    shines = lamps.radiance[:, None].expand(-1, used.shape[1], -1)[used]
    facing = torch.linalg.cross(across, down)
    area = facing.norm(dim=1)
    count, total = len(segments.begin), torch.zeros_like(segments.origins)
    height, rise = segments.entry()
    step = segments.length() / steps
    for number in range(steps):
        for _ in range(rays):
            u = torch.rand(8, count, generator=generator)
            t = (number + u[0]) * step
            points = segments.points(segments.begin + t)

            def seen(ways: Tensor, far: Tensor | float = torch.inf, points: Tensor = points) -> Tensor:
                return transmission(scene, points, ways, poses=poses, t_max=far)

            def turn(ways: Tensor) -> Tensor:
                return phase(fog, (ways * segments.directions).sum(1))[:, None]

            y = 1 - 2 * u[1]
            ring, angle = (1 - y * y).clamp_min(0).sqrt(), 2 * math.pi * u[2]
            ways = torch.stack([ring * angle.cos(), y, ring * angle.sin()], dim=1)
            light = 4 * math.pi * turn(ways) * seen(ways) * sky_along(scene, ways)
            if scene.sun is not None:
                toward = F.normalize(u.new_tensor([scene.sun.direction]), dim=1)
                first, other = tangent_frame(toward)
                a, b = disc(u[3:5])[:, :, None] * math.sin(math.radians(scene.sun.angular_radius))
                ways = first * a + other * b + toward * (1 - a * a - b * b).sqrt()
                light = light + turn(ways) * seen(ways) * u.new_tensor(scene.sun.irradiance)
            if len(area):
                upto = area.cumsum(0)
                which = torch.searchsorted(upto, u[5] * upto[-1]).clamp_max(len(area) - 1)
                away = corner[which] + across[which] * u[6, :, None] + down[which] * u[7, :, None] - points
                far = away.norm(dim=1).clamp_min(1e-6)
                ways = away / far[:, None]
                lean = -(ways * facing[which]).sum(1).clamp_max(0) / area[which] * upto[-1] / far**2
                lean = lean * (-fog.depth(points[:, 1], ways[:, 1], far)).exp()
                light = light + turn(ways) * seen(ways, (far - SHORT).clamp_min(0)) * lean[:, None] * shines[which]
            taken = fog.density(points[:, 1]) * (-fog.depth(height, rise, t)).exp() * step / rays
            total = total + light * taken[:, None]
    return total * total.new_tensor(fog.albedo)
