"""Light on what the camera sees: the sun, emissive blocks, and the open sky, kept apart as passes need them."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from gbufrt import GBuffer
from gbufrt.noise import blue_noise
from tracer.emitters import Lamps, lamps_of
from tracer.form_factor import cross, dot
from tracer.scene import Scene
from tracer.shadows import Surface, Through, arriving, lamp_source, sun_source, toward
from tracer.sky import sky_irradiance, sky_radiance, sun_radiance
from tracer.traversal import transmission

LIFT = 1e-3  # world units that shadow rays begin above a surface and before it, and
LIFT_RELATIVE = 2e-6  # of the depth, whose rounding grows with it
SHARE_ALONE = 1 / 128  # a lamp that may give a pixel no more of its light shares one ray with others like it
SHARE_FINE = 1 / 32  # a lamp that may give a pixel no more gets a quarter of the samples


def light(
    scene: Scene, gbuffer: GBuffer, *, poses: Tensor | None = None, samples: int = 16, index: int = 0, seed: int = 0
) -> tuple[Tensor, Tensor]:
    """Direct light and sky light that leave every pixel's surface toward the camera.

    ``radiance`` is emission + diffuse albedo / pi x irradiance from the sun's disc and from emissive blocks, both with
    soft shadows; where nothing was hit it is the sky, with the sun's disc. ``ambient`` is diffuse albedo / pi x
    irradiance of the sky as if nothing blocked it. Diffuse albedo is albedo x (1 - metallic) x opacity: metals only
    reflect, and a transmissive surface shows its own share, to which the light from behind it, times the
    transmittance, is added later.

    Light that no shadow touches is exact; noise is left in penumbrae alone (see `tracer.shadows.arriving`). No lamp is
    cut off: those that may give a pixel at most 1/128 of the light it could get are represented by one of them, drawn
    in proportion, and those below 1/32 get a quarter of the samples.

    Args:
        scene: what is there, and its sun and sky.
        gbuffer: what the cameras see of it, with ``albedo``.
        poses: ``(B, I, 4, 4)`` or ``(I, 4, 4)`` of the instances; may be left out where there are none.
        samples: most shadow rays a pixel to the sun, and to each lamp that matters there.
        index: frame number, from which the noise comes.
        seed: another seed, another noise.

    Returns:
        ``radiance`` and ``ambient``, both ``(B, 3, H, W)`` outgoing linear radiance.

    Raises:
        ValueError: ``samples`` is below 1, there is no albedo, or the poses do not fit.
    """
    if samples < 1:
        raise ValueError(f"samples must be at least 1, got {samples}")
    if gbuffer.albedo is None:
        raise ValueError("gbuffer must have albedo to be lit; it has " + ", ".join(gbuffer.present))
    batch, camera, hit = gbuffer.batch, gbuffer.camera, gbuffer.hit
    poses = _batched(poses, batch, len(scene.instances))
    diffuse = gbuffer.albedo / math.pi
    if gbuffer.metallic is not None:
        diffuse = diffuse * (1 - gbuffer.metallic)
    if gbuffer.opacity is not None:
        diffuse = diffuse * gbuffer.opacity
    points = _lifted(gbuffer)
    noise = blue_noise(*camera.size, index=index, dims=4, seed=seed, device=camera.device)
    arrived = []
    for b in range(batch):
        surface = Surface(
            points=points[b].flatten(1),
            normals=gbuffer.normal[b].flatten(1),
            lit=(hit[b, 0] & (diffuse[b].amax(dim=0) > 0)).flatten(),
            size=camera.size,
        )
        arrived.append(_irradiance(scene, surface, poses[b], noise, samples).view(3, *camera.size))
    directions = camera.rays()[1].permute(0, 3, 1, 2)
    sky = sky_radiance(scene, directions)
    if scene.sun is not None:
        sky = sky + sun_radiance(scene.sun, directions)
    shown = diffuse * torch.stack(arrived)
    if gbuffer.emission is not None:
        shown = shown + gbuffer.emission
    ambient = diffuse * sky_irradiance(scene, gbuffer.normal)
    return torch.where(hit, shown, sky), torch.where(hit, ambient, 0.0)


def _irradiance(scene: Scene, surface: Surface, poses: Tensor, noise: Tensor, samples: int) -> Tensor:
    """``(3, N)`` from the sun and all lamps, for one picture."""

    def through(pixels: Tensor, directions: Tensor, distances: Tensor) -> Tensor:
        origins = surface.points[:, pixels].T
        return transmission(scene, origins, directions.T, poses=poses, t_max=distances).T

    arrived = torch.zeros_like(surface.points)
    if scene.sun is not None:
        wanted = surface.lit.view(surface.size)
        source = sun_source(scene.sun, surface)
        coming = arriving(source, through, wanted, wanted, noise[:2], samples=samples, start=0)
        arrived = arrived + coming * coming.new_tensor(scene.sun.irradiance)[:, None]
    lamps = lamps_of(scene, poses)
    return (
        arrived + _lamp_light(lamps, surface, through, noise, samples, arrived.mean(dim=0)) if len(lamps) else arrived
    )


def _lamp_light(lamps: Lamps, surface: Surface, through: Through, noise: Tensor, samples: int, known: Tensor) -> Tensor:
    """``(3, N)`` irradiance from lamps, where ``known`` ``(N,)`` comes from elsewhere."""
    total = known.clone()
    for lamp in range(len(lamps)):
        total += _bound(lamps, lamp, surface)
    arrived = torch.zeros_like(surface.points)
    rest, chosen = torch.zeros_like(known), torch.zeros_like(known, dtype=torch.long)
    weight, dice = torch.zeros_like(known), noise[3].flatten().clone()
    for lamp in range(len(lamps)):
        bound = _bound(lamps, lamp, surface)
        share = bound / total.clamp_min(1e-20)
        alone = (share > SHARE_ALONE).view(surface.size)
        source = lamp_source(lamps, lamp, surface)
        fine = (share > SHARE_FINE).view(surface.size)
        coming = arriving(source, through, alone, fine, noise[:2], samples=samples, start=samples * lamp)
        arrived += coming * lamps.radiance[lamp][:, None]
        # one of the rest stays in proportion to its bound, and what is left of the dice serves the next choice
        other = (bound > 0) & ~alone.flatten()
        rest += torch.where(other, bound, 0.0)
        chance = bound / rest.clamp_min(1e-20)
        taken = other & (dice < chance)
        chosen, weight = torch.where(taken, lamp, chosen), torch.where(taken, bound, weight)
        again = torch.where(taken, dice / chance.clamp_min(1e-20), (dice - chance) / (1 - chance).clamp_min(1e-20))
        dice = torch.where(other, again, dice)
    pixels = (weight > 0).nonzero()[:, 0]
    scale = rest[pixels] / weight[pixels]
    arrived[:, pixels] += scale * _one_sample(lamps, chosen[pixels], pixels, surface, through, noise[1:3])
    return arrived


def _one_sample(
    lamps: Lamps, chosen: Tensor, pixels: Tensor, surface: Surface, through: Through, noise: Tensor
) -> Tensor:
    """``(3, n)`` irradiance from the lamp chosen for each pixel, by one ray to an even choice of its rectangles."""
    if not len(pixels):
        return surface.points.new_zeros(3, 0)
    u = noise.flatten(1)[:, pixels]
    count = (lamps.edge_u.abs().sum(dim=2) > 0).sum(dim=1)[chosen]
    place = u[0] * count
    which = place.long().clamp_max(count - 1)
    corner, edge_u, edge_v = (table[chosen, which].T for table in (lamps.corner, lamps.edge_u, lamps.edge_v))
    target = corner + edge_u * (place - which) + edge_v * u[1]
    directions, distances, form = toward(surface, pixels, target, cross(edge_u, edge_v))
    return lamps.radiance[chosen].T * (form * count) * through(pixels, directions, distances)


def _bound(lamps: Lamps, lamp: int, surface: Surface) -> Tensor:
    """``(N,)``: no lamp gives more than if its bounding sphere shone, at the best cosine within it."""
    way = lamps.center[lamp][:, None] - surface.points
    distance = dot(way, way).sqrt().clamp_min(1e-6)
    sine = (lamps.radius[lamp] / distance).clamp_max(1.0)
    cosine = (dot(way, surface.normals) / distance).clamp(-1.0, 1.0)
    edge = (1 - sine * sine).sqrt()
    best = torch.where(cosine > edge, 1.0, cosine * edge + (1 - cosine * cosine).sqrt() * sine)
    best = torch.where(sine < 1.0, best, 1.0).clamp_min(0.0)
    return torch.where(surface.lit, math.pi * lamps.radiance[lamp].mean() * sine * sine * best, 0.0)


def _lifted(gbuffer: GBuffer) -> Tensor:
    """``(B, 3, H, W)`` world points a little above the surface, and nearer the camera, from where air was seen."""
    camera = gbuffer.camera
    points = gbuffer.points_view()
    normal = gbuffer.normal if gbuffer.normal_geo is None else gbuffer.normal_geo
    lift = LIFT + LIFT_RELATIVE * gbuffer.depth
    back = camera.rotate_to_world(camera.to_eye(points))
    return camera.to_world(points) + (normal + back) * lift


def _batched(poses: Tensor | None, batch: int, count: int) -> Tensor:
    if poses is None and count == 0:
        poses = torch.zeros(count, 4, 4)
    if poses is None or poses.shape[-3:] != (count, 4, 4) or (poses.ndim == 4 and poses.shape[0] not in (1, batch)):
        got = "none" if poses is None else tuple(poses.shape)
        raise ValueError(f"poses must be ({count},4,4) or ({batch},{count},4,4), got {got}: scene.poses(times)")
    return poses.expand(batch, count, 4, 4)
