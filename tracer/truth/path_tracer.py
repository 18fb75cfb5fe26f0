"""The frame of a real camera: all light, lens, shutter and pixels with an area."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import torch
from torch import Tensor

from gbufrt import Camera
from gbufrt.numeric import check_counts, check_each, check_numbers
from tracer import lens
from tracer.gbuffers import gbuffer
from tracer.lights.samples import Lights
from tracer.lights.sky import irradiance_table
from tracer.paths.diffuse import unblocked
from tracer.paths.on_screen import Picture, begins_on_screen
from tracer.paths.op import radiance
from tracer.paths.radiance import MORE
from tracer.sampling.progressive import WIDE, Progress, Truth, Values, converge
from tracer.sampling.sequence import Sequence as Numbers
from tracer.scene.checks import check_scene, check_seen_by
from tracer.scene.scene import Scene
from tracer.scene.times import moments, seconds
from tracer.underwater.paths import onward

FIRST = 5  # numbers that a ray from the camera takes: time, pixel (2), lens (2)
MOMENTS = 8  # groups of pixels, each with its own time, that a sample is split into while the shutter is open


def path_trace(
    scene: Scene,
    camera: Camera | Callable[[float], Camera],
    *,
    time: float | Tensor | Sequence[float] = 0.0,
    shutter: float = 0.0,
    shutter_offset: float = 0.0,
    aperture_radius: float = 0.0,
    focus_distance: float | Tensor | None = None,
    bounces: int = 4,
    unblocked: bool = False,
    samples: int = 64,
    antialias: bool = True,
    noise: float = 0.0,
    seed: int = 0,
    progress: Progress | None = None,
) -> Truth:
    """All light that reaches the camera, by paths with next-event estimation to sun, lamps and sky.

    Surfaces follow the model of the passes: specular reflection by GGX with Fresnel; of the rest,
    albedo x (1 - metallic) x opacity is diffuse, and transmitted light goes straight on. Nothing is clamped: the mean
    over seeds is the answer.

    Args:
        scene: what is there, and its lights.
        camera: B cameras; or a function of the time in seconds, for a camera that moves while the shutter is open.
        time: seconds, one number or B.
        shutter: seconds that the shutter is open; 0 is an instant.
        shutter_offset: seconds from ``time`` to its opening: ``-shutter / 2`` centres it on ``time``.
        aperture_radius: of a thin lens with a circular aperture, world units; 0 is a pinhole.
        focus_distance: planar depth of the focal plane, world units, a number or ``(B,)``; by default what
            `tracer.lens.focus_distance` finds.
        bounces: most surfaces between the first one and a light; 0 for direct light and sky alone.
        unblocked: end paths at the first surface, in unoccluded light, see `tracer.paths.diffuse.unblocked`: the only
            noise is then that of lens, shutter and pixel.
        samples: most paths a pixel.
        antialias: spread rays over the pixel's square; otherwise all go where the camera's jitter says.
        noise: stop once the mean standard error is not above this; 0 takes all samples.
        seed: another seed, another noise.
        progress: called with samples done and their number.

    Returns:
        A `tracer.Truth`, read by name: ``["radiance"]`` ``(B, 3, H, W)``, linear; and ``["radiance_onscreen"]``, the
        part of it from paths whose surfaces are all first in a pixel of the pinhole's picture at ``time`` (without a
        shutter: at the instant itself).
        Moving surfaces are back-projected to where they were then. Through a lens or a shutter the sky must be on
        screen as well, and what is behind glass counts with the glass. The first hit of a pinhole without a shutter
        always counts. Lights that shadow rays sample need not be on screen, nor the sky after a bounce; lamps that
        reflected rays hit must be.

    Raises:
        TypeError: no scene, no camera, or no number where there must be one.
        ValueError: no voxels, or a number out of its range.

    Source: Kajiya 1986; Cook, Porter and Carpenter 1984 (lens and shutter).
    """
    _check(scene, bounces, samples, shutter, aperture_radius)
    check_numbers(shutter_offset=shutter_offset)
    at_time = camera if callable(camera) else lambda _: camera
    cameras = at_time(moments(time)[0])
    check_seen_by(scene, cameras)
    times = seconds(time, cameras.batch)
    focus = _focus(scene, cameras, times, aperture_radius, focus_distance)
    sequence = Numbers.of(samples, FIRST + 1 + MORE * (bounces + 1), cameras.size, seed=seed, device=cameras.device)
    # without a shutter the picture is of the very instant
    shown = times if shutter > 0 else [t + shutter_offset for t in times]
    exposures = [
        _Exposure(
            scene=scene,
            camera=lambda t, b=b: lens.one_of(at_time(t), b),
            begin=times[b] + shutter_offset,
            shutter=shutter,
            aperture_radius=aperture_radius,
            focus_distance=focus[b],
            bounces=bounces,
            unblocked=unblocked,
            antialias=antialias,
            size=cameras.size,
            sequence=sequence,
            picture=Picture.of(gbuffer(scene, lens.one_of(at_time(shown[b]), b), time=shown[b]), 0),
            shown=shown[b],
        )
        for b in range(cameras.batch)
    ]
    count = cameras.height * cameras.width

    def estimate(numbers: range) -> Values:
        both = torch.stack([e.sums(numbers) for e in exposures])
        return {"radiance": both[:, :3], "radiance_onscreen": both[:, 3:]}

    return converge(
        estimate,
        samples=samples,
        noise=noise,
        pixels=WIDE if shutter > 0 else count,  # so that an open shutter gets one sample at a time
        progress=progress,
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class _Moment:
    """The scene at the time of some rays, and the picture that tells what is on screen."""

    camera: Camera
    poses: Tensor
    lights: Lights
    picture: Picture


@dataclass(frozen=True, eq=False, kw_only=True)
class _Exposure:
    """One picture of the batch: the arguments of `path_trace`, with ``begin`` the time at which the shutter opens, and
    the pinhole's ``picture`` as it was when ``shown``."""

    scene: Scene
    camera: Callable[[float], Camera]
    begin: float
    shutter: float
    aperture_radius: float
    focus_distance: float
    bounces: int
    unblocked: bool
    antialias: bool
    size: tuple[int, int]
    sequence: Numbers
    picture: Picture
    shown: float

    def sums(self, numbers: range) -> Tensor:
        """``(6, H, W)`` sums over samples: radiance, and its on-screen part."""
        first = float(self.sequence.points[numbers.start, 0])
        total = torch.zeros(len(self.sequence.places), 6, device=self.sequence.places.device)
        for number, pixels in enumerate(self._groups):
            now = self._moment(self.begin + self.shutter * ((first + number / MOMENTS) % 1))
            for part in pixels.split(max(1, WIDE // len(numbers))):
                total[part] = self._light(numbers, part, now)
        return total.T.reshape(6, *self.size)

    def _moment(self, time: float) -> _Moment:
        camera = self.camera(time)
        poses, shown = self.scene.poses([time, self.shown]).to(camera.device)
        lights = self._lights.at(self.scene, poses) if self.shutter > 0 else self._lights
        return _Moment(camera=camera, poses=poses, lights=lights, picture=self.picture.moved(shown, poses))

    @cached_property
    def _lights(self) -> Lights:
        poses = self.scene.poses([self.begin + self.shutter / 2])[0]
        return Lights.of(self.scene, poses.to(self.scene.world.device))

    @cached_property
    def _irradiance(self) -> Tensor:
        return irradiance_table(self.scene)

    @cached_property
    def _groups(self) -> list[Tensor]:
        """Numbers of the pixels that share a moment, evenly spread over the picture."""
        order = self.sequence.dims(0, 1).turns[0].argsort()
        return [order[i::MOMENTS].sort().values for i in range(MOMENTS)] if self.shutter > 0 else [order.sort().values]

    def _light(self, numbers: range, pixels: Tensor, now: _Moment) -> Tensor:
        """``(n, 6)`` sums over samples."""
        u, camera = self.sequence.part(numbers).draw(pixels), now.camera
        px = camera.pixel_centers(jittered=not self.antialias, dtype=torch.float32)[0].flatten(1)[:, pixels]
        px = px.repeat(1, len(numbers)) + (u[1:3] - 0.5 if self.antialias else 0.0)
        origins, directions, along = lens.lens_rays(
            camera, px, u[3:5], aperture_radius=self.aperture_radius, focus_distance=self.focus_distance
        )
        focal = camera.intrinsics[0, 1, 1]
        spans = {"poses": now.poses, "t_min": camera.near / along, "t_max": camera.far / along}
        known = torch.ones_like(along, dtype=torch.bool)
        if self.aperture_radius > 0 or self.shutter > 0:  # else it is the picture itself, in finer detail
            known = begins_on_screen(self.scene, now.picture, origins, directions, **spans)
        detail = focal if camera.orthographic else focal / along
        given = {**spans, "detail": detail, "spreads": not camera.orthographic}
        led = onward(self.scene, camera.position, origins, directions, u[FIRST], **spans)
        if led is not None:
            origins, directions, given["t_min"] = led.origins, led.directions, led.t_min
            u = torch.cat([u[:FIRST], led.u[None], u[FIRST + 1 :]])
        if self.unblocked:
            light = unblocked(self.scene, self._irradiance, origins, directions, u[FIRST], **given)
            both = light, light * known[:, None]
        else:
            given |= {"bounces": self.bounces, "picture": now.picture, "known": known}
            both = radiance(self.scene, now.lights, origins, directions, u[FIRST:], **given)
        if led is not None:
            both = both[0] * led.weight + led.added, both[1] * led.weight + led.added * known[:, None]
        return torch.cat(both, dim=1).view(len(numbers), len(pixels), 6).sum(dim=0)


def _focus(
    scene: Scene, cameras: Camera, times: list[float], aperture_radius: float, given: float | Tensor | None
) -> list[float]:
    """Planar depth of each picture's focal plane."""
    if aperture_radius == 0:
        return [1.0] * len(times)
    if given is None:
        return [float(lens.focus_distance(scene, lens.one_of(cameras, b), time=t)) for b, t in enumerate(times)]
    try:
        distances = torch.as_tensor(given, dtype=torch.float64).cpu()
    except (TypeError, ValueError):
        raise TypeError(f"focus_distance must be a number or a tensor, got {type(given).__name__}") from None
    check_each(0, above=True, unit="world units", focus_distance=distances)
    if distances.ndim > 1 or distances.numel() not in (1, len(times)):
        raise ValueError(f"focus_distance must be one number or ({len(times)},), got {tuple(distances.shape)}")
    return distances.expand(len(times)).tolist()


def _check(scene: Scene, bounces: int, samples: int, shutter: float, aperture_radius: float) -> None:
    check_scene(scene)
    check_counts(bounces=bounces, samples=samples)
    check_numbers(shutter=shutter, aperture_radius=aperture_radius)
    for name, value, least in (("bounces", bounces, 0), ("samples", samples, 1)):
        if value < least:
            raise ValueError(f"{name} must be at least {least}, got {value}")
    for name, value, unit in (("shutter", shutter, "seconds"), ("aperture_radius", aperture_radius, "world units")):
        if not value >= 0:
            raise ValueError(f"{name} must not be negative, in {unit}, got {value}")
