"""Light on what the camera sees: the sun, emissive blocks, and the open sky, kept apart as passes need them."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from gbufrt import GBuffer
from gbufrt.noise import blue_noise
from tracer.emitters import Lamps, lamps_of
from tracer.form_factor import dot
from tracer.scene import Scene
from tracer.shadows import CHUNK, Surface, Through, arriving, lamp_source, sun_source
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
    poses = batched(poses, batch, len(scene.instances))
    diffuse = gbuffer.albedo / math.pi
    if gbuffer.metallic is not None:
        diffuse = diffuse * (1 - gbuffer.metallic)
    if gbuffer.opacity is not None:
        diffuse = diffuse * gbuffer.opacity
    points = lifted(gbuffer)
    noise = blue_noise(*camera.size, index=index, dims=3, seed=seed, device=camera.device)
    arrived = []
    for b in range(batch):
        surface = Surface(
            points=points[b].flatten(1).float(),
            normals=gbuffer.normal[b].flatten(1).float(),
            lit=(hit[b, 0] & (diffuse[b].amax(dim=0) > 0)).flatten(),
            size=camera.size,
        )
        arrived.append(_irradiance(scene, surface, poses[b], noise, samples))
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
    """``(3, H, W)`` from the sun and all lamps, for one picture."""

    def through(pixels: Tensor, directions: Tensor, distances: Tensor) -> Tensor:
        origins = surface.points[:, pixels].T
        return transmission(scene, origins, directions.T, poses=poses, t_max=distances).T

    arrived = torch.zeros_like(surface.points).view(3, *surface.size)
    if scene.sun is not None:
        wanted = surface.lit.view(surface.size)
        source = sun_source(scene.sun, surface)
        coming = arriving(source, through, wanted, wanted, noise[:2], samples=samples, start=0)
        arrived = coming * coming.new_tensor(scene.sun.irradiance)[:, None, None]
    lamps = lamps_of(scene, poses)
    return arrived + _lamp_light(lamps, surface, through, noise, samples, arrived) if len(lamps) else arrived


def _lamp_light(lamps: Lamps, surface: Surface, through: Through, noise: Tensor, samples: int, known: Tensor) -> Tensor:
    """``(3, H, W)`` irradiance from lamps, where ``known`` ``(3, H, W)`` comes from elsewhere."""
    tables = [t.permute(2, 1, 0) for t in (lamps.corner, lamps.edge_u, lamps.edge_v)]  # (3, K, L)
    counts = (lamps.edge_u.abs().sum(dim=2) > 0).sum(dim=1).tolist()
    lit = surface.lit.nonzero()[:, 0]
    levels, chosen, scale = _choices(lamps, surface, known.mean(dim=0).flatten(), noise[2].flatten())
    level, arrived = torch.zeros_like(surface.lit, dtype=torch.uint8), torch.zeros_like(known)
    for lamp, count in enumerate(counts):
        level[lit] = levels[lamp]
        own = [t[:, :count, lamp, None] for t in tables]
        source = lamp_source(surface, lambda _, own=own: own)
        wanted, fine = (level >= 1).view(surface.size), (level >= 2).view(surface.size)
        coming = arriving(source, through, wanted, fine, noise[:2], samples=samples, start=samples * lamp)
        arrived += coming * lamps.radiance[lamp][:, None, None]
    source = lamp_source(surface, lambda pixels: [t[:, :, chosen[pixels]] for t in tables])
    left = (scale > 0).view(surface.size)
    coming = arriving(source, through, left, left, noise[:2], samples=1, start=samples * len(lamps))
    return arrived + coming * (lamps.radiance[chosen].T * scale).view_as(coming)


def _choices(lamps: Lamps, surface: Surface, known: Tensor, dice: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Which lamps matter where.

    Returns:
        ``(L, M)`` uint8 for the M lit pixels: 0 not worth its own rays, 1 worth some, 2 worth all; and for all pixels
        the number ``(N,)`` of one lamp drawn from those of level 0, in proportion to what they send, with the ratio
        ``(N,)`` of what all of these send to what it sends.
    """
    lit = surface.lit.nonzero()[:, 0]
    levels = torch.zeros(len(lamps), len(lit), dtype=torch.uint8, device=lit.device)
    chosen, scale = torch.zeros_like(surface.lit, dtype=torch.long), torch.zeros_like(known)
    faces = [_faces(lamps, lamp) for lamp in range(len(lamps))]
    for begin in range(0, len(lit), CHUNK):
        part = lit[begin : begin + CHUNK]
        points, normals = surface.points[:, part], surface.normals[:, part]
        power = torch.stack([_importance(lamps, lamp, faces[lamp], points, normals) for lamp in range(len(lamps))])
        total = known[part] + power.sum(dim=0)
        levels[:, begin : begin + CHUNK] = (power > SHARE_ALONE * total).byte() + (power > SHARE_FINE * total).byte()
        rest = torch.where(power > SHARE_ALONE * total, 0.0, power)
        upto = rest.cumsum(dim=0)
        which = (dice[part] * upto[-1] >= upto).sum(dim=0).clamp_max(len(lamps) - 1)
        mine = rest.gather(0, which[None])[0]
        chosen[part] = which
        scale[part] = torch.where(mine > 0, upto[-1] / mine.clamp_min(1e-30), 0.0)
    return levels, chosen, scale


def _faces(lamps: Lamps, lamp: int) -> list[tuple[list[float], float]]:
    """Of every rectangle its outward normal, as long as its area, and that times its corner."""
    outward = torch.linalg.cross(lamps.edge_u[lamp], lamps.edge_v[lamp])
    offsets = (outward * lamps.corner[lamp]).sum(dim=1).tolist()
    return [(n, offset) for n, offset in zip(outward.tolist(), offsets, strict=True) if any(n)]


def _importance(
    lamps: Lamps, lamp: int, faces: list[tuple[list[float], float]], points: Tensor, normals: Tensor
) -> Tensor:
    """``(n,)``: roughly the irradiance that a lamp gives with nothing between; zero only where it gives none.

    All of it counts as if at its middle, but where the middle is below the surface's horizon the highest point of the
    bounding sphere still counts.
    """
    way = lamps.center[lamp][:, None] - points
    square = dot(way, way)
    distance = square.sqrt().clamp_min(1e-6)
    shown = torch.zeros_like(distance)
    for outward, offset in faces:  # most have one axis only: plane by plane that is cheap
        height = torch.full_like(shown, -offset)
        for axis, n in enumerate(outward):
            if n:
                height.add_(points[axis], alpha=n)
        shown += height.clamp_min_(0)
    cosine = dot(way, normals) / distance
    sine = (lamps.radius[lamp] / distance).clamp_max(1.0)
    cosine = torch.maximum(cosine, (cosine + sine).clamp_min(0) / 4)
    inside = lamps.radius[lamp] ** 2 / 4  # nearer than that it does not grow any more
    return shown * cosine / (distance * square.clamp_min(inside)) * lamps.radiance[lamp].mean()


def lifted(gbuffer: GBuffer) -> Tensor:
    """``(B, 3, H, W)`` world points a little above the surface, and nearer the camera, from where air was seen."""
    camera = gbuffer.camera
    points = gbuffer.points_view()
    normal = gbuffer.normal if gbuffer.normal_geo is None else gbuffer.normal_geo
    lift = LIFT + LIFT_RELATIVE * gbuffer.depth
    back = camera.rotate_to_world(camera.to_eye(points))
    return camera.to_world(points) + (normal + back) * lift


def batched(poses: Tensor | None, batch: int, count: int) -> Tensor:
    """``(B, I, 4, 4)`` poses of ``count`` instances for every picture.

    Raises:
        ValueError: they are of another shape, or absent where there are instances.
    """
    if poses is None and count == 0:
        poses = torch.zeros(count, 4, 4)
    if poses is None or poses.shape[-3:] != (count, 4, 4) or (poses.ndim == 4 and poses.shape[0] not in (1, batch)):
        got = "none" if poses is None else tuple(poses.shape)
        raise ValueError(f"poses must be ({count},4,4) or ({batch},{count},4,4), got {got}: scene.poses(times)")
    return poses.expand(batch, count, 4, 4)
