"""Light on visible surfaces: the sun, emissive blocks, and the unoccluded sky, kept apart as passes need them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import torch
from torch import Tensor

from gbufrt import Camera, GBuffer
from gbufrt.compute.dispatch import Form, form_of
from gbufrt.noise.noise import blue_noise
from gbufrt.numeric import check_kind
from tracer.direct.reference import Direct
from tracer.lights.emitters import lamps_of
from tracer.lights.haze import sky_behind
from tracer.lights.shadows import Surface
from tracer.lights.sky import sky_irradiance, sun_radiance
from tracer.lights.stars import stars
from tracer.scene.scene import Scene
from tracer.weather.caustics import caustics
from tracer.weather.waves import above_waves

LIFT = 1e-3  # world units that shadow rays begin above a surface and before it, and
LIFT_RELATIVE = 2e-6  # of the depth, whose rounding grows with it
SKY_SHARE = 1 / 64  # of the unoccluded sky's light, which lamps are weighed against


def light(
    scene: Scene,
    gbuffer: GBuffer,
    *,
    poses: Tensor | None = None,
    samples: int = 16,
    index: int = 0,
    seed: int = 0,
    times: Sequence[float] | None = None,
    seen: Tensor | None = None,
    sky: Tensor | None = None,
) -> tuple[Tensor, Tensor]:
    """Direct light and sky light that leave every pixel's surface toward the camera.

    ``radiance`` is emission + diffuse albedo / pi x irradiance from the sun's disc and from emissive blocks, both with
    soft shadows, and from the sun by way of waves on water; where nothing was hit it is the sky, with the sun's disc.
    ``ambient`` is diffuse albedo / pi x irradiance of the unoccluded sky. Diffuse albedo is albedo x (1 - metallic) x
    opacity: metals only reflect, and a transmissive surface shows its own share, to which the light from behind it,
    times the transmittance, is added later.

    Unshadowed light is exact; only penumbrae have noise (see `tracer.lights.shadows.arriving`). No lamp is cut
    off: those that may give a pixel at most 1/96 of the light it could get are represented by up to eight of them, or
    half as many as there are ``samples``, drawn in proportion, those below 1/32 get a sixteenth of the samples, and
    those below 1/16 a quarter. Where more than twelve first rays a pixel were due for each of ``samples``, greater
    lamps are drawn too. A share of the sky's light counts to what a pixel could get, as much of it as reaches all but
    the deepest caves, and so does what a surface emits.

    Args:
        scene: what is there, and its sun and sky.
        gbuffer: what the cameras show of it, with ``albedo``.
        poses: ``(B, I, 4, 4)`` or ``(I, 4, 4)`` of the instances; may be left out where there are none.
        samples: most shadow rays a pixel to the sun, and to each lamp that matters there; 0 for no light of either, so
            that ``radiance`` is emission and sky alone.
        index: frame number, from which the noise comes.
        seed: another seed, another noise.
        times: B, seconds, of the waves that reflect the sun, where there are any; by default 0.
        seen: ``(B, 1, H, W)`` in [0, 1], how much of each pixel's light reaches the camera; by default all. The less it
            is, the fewer samples are taken.
        sky: what `backdrop` returns for these cameras, where it is there already.

    Returns:
        ``radiance`` and ``ambient``, both ``(B, 3, H, W)`` outgoing linear radiance.

    Raises:
        ValueError: ``samples`` is negative, there is no albedo, or the poses do not fit.
    """
    if samples < 0:
        raise ValueError(f"samples must not be negative, got {samples}")
    if gbuffer.albedo is None:
        raise ValueError("gbuffer must have albedo to be lit; it has " + ", ".join(gbuffer.present))
    camera, hit = gbuffer.camera, gbuffer.hit
    poses = batched(poses, gbuffer.batch, len(scene.instances))
    diffuse = gbuffer.albedo / math.pi
    if gbuffer.metallic is not None:
        diffuse = diffuse * (1 - gbuffer.metallic)
    if gbuffer.opacity is not None:
        diffuse = diffuse * gbuffer.opacity
    sky_light = sky_irradiance(scene, gbuffer.normal)
    shown = torch.zeros_like(diffuse)
    if samples:
        given = {"samples": samples, "index": index, "seed": seed, "times": times, "seen": seen}
        shown = diffuse * _arriving(scene, gbuffer, diffuse, sky_light, poses, **given)
    sky = backdrop(scene, camera) if sky is None else sky
    if gbuffer.emission is not None:
        shown = shown + gbuffer.emission
    ambient = diffuse * sky_light
    return torch.where(hit, shown, sky), torch.where(hit, ambient, 0.0)


def backdrop(scene: Scene, camera: Camera) -> Tensor:
    """``(B, 3, H, W)`` linear radiance of sky, stars and the sun's disc, as pixels show it that show no surface."""
    directions = camera.rays()[1].permute(0, 3, 1, 2)
    sky = sky_behind(scene, directions)
    if scene.sky.stars is not None and not camera.orthographic:  # which sees one point of the sky in all pixels
        night = stars(directions, scene.sky.stars, 1 / camera.intrinsics[0, 1, 1])
        sky = sky + torch.where(directions[:, 1:2] > 0, night, 0.0)  # none below the horizon, where land may be hazy
    return sky if scene.sun is None else sky + sun_radiance(scene.sun, directions)


def _arriving(
    scene: Scene,
    gbuffer: GBuffer,
    diffuse: Tensor,
    sky_light: Tensor,
    poses: Tensor,
    *,
    samples: int,
    index: int,
    seed: int,
    times: Sequence[float] | None,
    seen: Tensor | None,
) -> Tensor:
    """``(B, 3, H, W)`` light of sun and lamps that arrives at surfaces whose ``diffuse`` share is above 0."""
    camera = gbuffer.camera
    points = ray_origins(scene, gbuffer)
    noise = blue_noise(*camera.size, index=index, dims=3, seed=seed, device=camera.device)
    arrived = []
    besides = SKY_SHARE * sky_light.mean(dim=1)
    if gbuffer.emission is not None:  # as the irradiance that would make a surface as bright
        besides = besides + gbuffer.emission.mean(dim=1) / diffuse.mean(dim=1).clamp_min(1e-6)
    for b in range(gbuffer.batch):
        surface = Surface(
            points=points[b].flatten(1).float(),
            normals=gbuffer.normal[b].flatten(1).float(),
            lit=(gbuffer.hit[b, 0] & (diffuse[b].amax(dim=0) > 0)).flatten(),
            size=camera.size,
            seen=None if seen is None else seen[b].flatten(),
            besides=besides[b].flatten(),
        )
        arrived.append(_direct(scene, poses[b], surface).arriving(noise, samples))
        if scene.waves is not None:
            rows = surface.points.T.contiguous(), surface.normals.T.contiguous(), surface.lit
            moment = {"time": 0.0 if times is None else times[b], "eye": camera.position[b].float()}
            arrived[b] = arrived[b] + caustics(scene, *rows, poses=poses[b], **moment).T.view_as(arrived[b])
    return torch.stack(arrived)


def _direct(scene: Scene, poses: Tensor, surface: Surface) -> Direct:
    """Direct light on a surface, in the form for its device."""
    lamps = lamps_of(scene, poses)
    if form_of(surface.points.detach(), cuda=True) is Form.REFERENCE:
        return Direct(scene=scene, poses=poses, surface=surface, lamps=lamps)
    from tracer.direct import drivers

    return drivers.Direct(scene=scene, poses=poses, surface=surface, lamps=lamps)


def ray_origins(scene: Scene, gbuffer: GBuffer) -> Tensor:
    """``(B, 3, H, W)`` world points that rays to lights and paths start from: `lifted`, and out of the water's voxels.

    Rays from a wave that started inside its voxel would meet the face of still water, which is not there.
    """
    return above_waves(scene, gbuffer.material_id, gbuffer.normal, lifted(gbuffer))


def lifted(gbuffer: GBuffer) -> Tensor:
    """``(B, 3, H, W)`` world points a little above the surface and nearer the camera, on the visible side."""
    camera = gbuffer.camera
    points = gbuffer.points_view()
    normal = gbuffer.normal if gbuffer.normal_geo is None else gbuffer.normal_geo
    lift = LIFT + LIFT_RELATIVE * gbuffer.depth
    back = camera.rotate_to_world(camera.to_eye(points))
    return camera.to_world(points) + (normal + back) * lift


def batched(poses: Tensor | None, batch: int, count: int) -> Tensor:
    """``(B, I, 4, 4)`` poses of ``count`` instances for every picture.

    Raises:
        TypeError: they are no tensor.
        ValueError: they are of another shape, or absent where there are instances.
    """
    if poses is not None:
        check_kind(Tensor, "poses", poses, "; scene.poses(times) gives them")
    if poses is None and count == 0:
        poses = torch.zeros(count, 4, 4)
    if poses is None or poses.shape[-3:] != (count, 4, 4) or (poses.ndim == 4 and poses.shape[0] not in (1, batch)):
        got = "none" if poses is None else tuple(poses.shape)
        raise ValueError(f"poses must be ({count},4,4) or ({batch},{count},4,4), got {got}: scene.poses(times)")
    return poses.expand(batch, count, 4, 4)
