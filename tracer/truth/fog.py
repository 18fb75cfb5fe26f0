"""The truth about fog that scatters once: even steps along each ray, with shadow rays from every one."""

from __future__ import annotations

import math

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt import GBuffer
from gbufrt.directions import tangent_frame
from gbufrt.numeric import check_counts
from tracer.direct.fog import segments_of
from tracer.direct.lighting import batched
from tracer.fog.along import LampsAlong
from tracer.fog.segments import Segments, passes, phase, phase_direction
from tracer.lights.emitters import lamps_of
from tracer.lights.lamp_table import LampTable
from tracer.lights.shadows import SHORT
from tracer.lights.sky import sky_along
from tracer.lights.sky_table import SkyTable
from tracer.sampling.progressive import Progress, Truth, Values, converge
from tracer.sampling.sequence import Sequence, disc
from tracer.scene.checks import check_shown
from tracer.scene.scene import Scene, Sun
from tracer.traversal.rays import transmission

STEPS = 1024
DIMS = 11  # numbers in [0, 1) a step: its place; two for the sun, two each for two rays to the sky, four for a lamp


def fog_truth(
    scene: Scene,
    gbuffer: GBuffer,
    *,
    poses: Tensor | None = None,
    steps: int = STEPS,
    noise: float = 0.0,
    seed: int = 0,
    progress: Progress | None = None,
) -> Truth:
    """Light that fog adds before surfaces and sky by brute force: what `post.fog` should have found.

    Rays are cut into as many even steps as there are, with one place in each. From there go a shadow ray to the sun,
    two to the sky and one to a lamp. See `Truth` and `tracer.sampling.progressive.converge`.

    Args:
        scene: with fog, whose light is scattered once.
        gbuffer: what the cameras show; where nothing was hit, fog ends at their far plane.
        poses: ``(B, I, 4, 4)`` or ``(I, 4, 4)`` of the instances; may be left out where there are none.
        steps: along each ray.
        noise: stop once the mean standard error of ``fog`` is not above this; 0 takes all steps.
        seed: another seed, another noise.
        progress: called with steps done and their number.

    Returns:
        ``fog`` ``(B, 3, H, W)`` linear radiance; and ``fog_transmittance`` ``(B, 1, H, W)``.

    Raises:
        ValueError: the scene has no fog, steps is below 1, or the poses do not fit.
    """
    check_shown(scene, gbuffer)
    if scene.fog is None:
        raise ValueError("scene must have fog: dataclasses.replace(scene, fog=tracer.Fog(extinction=0.01))")
    check_counts(steps=steps)
    if steps < 1:
        raise ValueError(f"steps must be at least 1, got {steps}")
    poses, size = batched(poses, gbuffer.batch, len(scene.instances)), gbuffer.camera.size
    sequence = Sequence.of(steps, DIMS, size, seed=seed, device=gbuffer.camera.device)
    rays = [segments_of(gbuffer, b) for b in range(gbuffer.batch)]
    marches = [_Brute(scene, ray, poses[b]) for b, ray in enumerate(rays)]
    clear = [passes(scene.fog, ray)[None] for ray in rays]

    def estimate(numbers: range) -> Values:
        points, light = sequence.part(numbers).points, clear[0].new_zeros(len(marches), 3, size[0] * size[1])
        for u in points[:, :, None]:
            drawn = (u + sequence.turns) % 1.0
            light = light + torch.stack([march.step(drawn).T for march in marches])
        return {
            "fog": light.view(-1, 3, *size),
            "fog_transmittance": len(points) * torch.stack(clear).view(-1, 1, *size),
        }

    pixels = size[0] * size[1] * gbuffer.batch
    return converge(estimate, samples=steps, noise=noise, pixels=pixels, progress=progress)


class _Brute:
    """Light scattered toward the eye from one even random place on each of N rays, as a sample of all of it."""

    def __init__(self, scene: Scene, segments: Segments, poses: Tensor) -> None:
        assert scene.fog is not None
        self.scene, self.fog, self.segments, self.poses = scene, scene.fog, segments, poses
        self.sky = SkyTable.of(scene)
        table = LampTable.of(lamps_of(scene, poses), (0, 0, 0), (1, 1, 1))
        self.lamps = LampsAlong.of(table, segments, scene.fog) if len(table) else None

    def step(self, u: Tensor) -> Tensor:
        """``(N, 3)`` from numbers ``(DIMS, N)`` in [0, 1)."""
        t = self.segments.begin + u[0] * self.segments.length()
        points = self.segments.points(t)
        light = torch.zeros_like(points)
        if self.scene.sun is not None:
            light = light + self._sun(self.scene.sun, points, u[1:3])
        if self.sky is not None:
            light = light + self._sky(self.sky, points, u[3:5], u[5:7])
        light = light * (self._taken(t, points) * self.segments.length())[:, None]
        if self.lamps is not None:
            light = light + self._lamp(self.lamps, u[7:])
        return light * light.new_tensor(self.fog.albedo)

    def _taken(self, t: Tensor, points: Tensor) -> Tensor:
        """Share of light a unit that fog takes there, of what reaches the eye."""
        height, rise = self.segments.entry()
        return self.fog.density(points[:, 1]) * (-self.fog.depth(height, rise, t - self.segments.begin)).exp()

    def _sun(self, sun: Sun, points: Tensor, u: Tensor) -> Tensor:
        toward = F.normalize(u.new_tensor([sun.direction]), dim=1)
        first, other = tangent_frame(toward)
        a, b = disc(u)[:, :, None] * math.sin(math.radians(sun.angular_radius))
        ways = first * a + other * b + toward * (1 - a * a - b * b).sqrt()
        return self._turned(ways)[:, None] * self._seen(points, ways) * u.new_tensor(sun.irradiance)

    def _sky(self, table: SkyTable, points: Tensor, u: Tensor, v: Tensor) -> Tensor:
        light = torch.zeros_like(points)
        for ways in (phase_direction(self.fog, self.segments.directions, u), table.sample(v)[0]):
            share = self._turned(ways)
            share = share / (share + table.density_of(ways))  # Veach and Guibas 1995, the balance heuristic
            light = light + share[:, None] * self._seen(points, ways) * sky_along(self.scene, ways)
        return light

    def _lamp(self, lamps: LampsAlong, u: Tensor) -> Tensor:
        drawn = lamps.draw(u)  # at a place of its own: at even ones, near lamps would be noise
        far = drawn.away.norm(dim=1).clamp_min(1e-6)
        ways = drawn.away / far[:, None]
        share = self._turned(ways) * (-self.fog.depth(drawn.points[:, 1], ways[:, 1], far)).exp()
        share = share * self._taken(drawn.t, drawn.points)
        return share[:, None] * self._seen(drawn.points, ways, (far - SHORT).clamp_min(0)) * drawn.light

    def _turned(self, ways: Tensor) -> Tensor:
        return phase(self.fog, (ways * self.segments.directions).sum(1))

    def _seen(self, points: Tensor, ways: Tensor, far: Tensor | float = torch.inf) -> Tensor:
        return transmission(self.scene, points, ways, poses=self.poses, t_max=far)
