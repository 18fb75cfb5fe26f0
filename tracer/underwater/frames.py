"""Frames of cameras in water: what they see through its surface, and light that has come down through it."""

from __future__ import annotations

import math
from typing import Any

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt import Frame, GBuffer
from gbufrt.compute.resident import places, resident
from gbufrt.environment import environment_directions
from tracer.lights.haze import sky_behind
from tracer.lights.sky import sky_irradiance, sun_radiance
from tracer.lights.stars import stars
from tracer.sampling.scatter import mirrored
from tracer.scene.scene import MASK_PRIMARY, MASK_SHADOW, Scene
from tracer.texture import look
from tracer.traversal.rays import trace, transmission
from tracer.underwater.medium import Medium
from tracer.underwater.surface import LIFT, leaves, past_borders, reflectance, refracted


def submerged(scene: Scene, frame: Frame, *, poses: Tensor) -> Frame:
    """A frame as its cameras see it that are in water; others as they are.

    Sky light on surfaces is what is left of it at their depth. Where nothing was hit there is water, and mirrors that
    see nothing else see it too. Through the surface of the water lies what refraction shows.

    Args:
        scene: that it shows.
        frame: what the tracer saw, lit as if all were in the air.
        poses: ``(B, I, 4, 4)`` of the scene's instances.
    """
    g, behind = frame.gbuffer, frame.behind
    medium = Medium.of(scene, g.camera.position, poses)
    if medium is None or behind is None:
        return frame
    directions = g.camera.rays()[1].permute(0, 3, 1, 2)
    points, wet = g.camera.to_world(g.points_view()), medium.wet.view(-1, 1, 1, 1)
    radiance = torch.where(wet & ~g.hit, _water(medium, directions), frame.read("radiance"))
    changed: dict[str, Any] = {"ambient": frame.read("ambient") * medium.lit(points[:, 1])}
    if (picture := frame.environment) is not None:
        around = environment_directions((picture.shape[2], picture.shape[3]), device=picture.device).expand_as(picture)
        changed["environment"] = torch.where(wet, _water(medium, around), picture)
    shows = _surface(scene, g) & wet
    through, mirror = _beyond(scene, medium, g, points, directions, shows, poses)
    away = (points - g.camera.position[..., None, None]).norm(dim=1)
    mirror = mirror * medium.clear(g.depth[:, 0] if g.camera.orthographic else away)
    changed["radiance"] = radiance + mirror
    changed["behind"] = behind.replace(radiance=torch.where(shows, through, behind.read("radiance")))
    assert g.emission is not None
    return frame.replace(gbuffer=g.replace(emission=g.emission + mirror), **changed)


def _water(medium: Medium, directions: Tensor) -> Tensor:
    """Radiance of water without end, up to its surface, along ``directions`` ``(B, 3, ...)``."""
    return medium.scattered(directions[:, 1], torch.full_like(directions[:, 1], torch.inf))


def _surface(scene: Scene, g: GBuffer) -> Tensor:
    """``(B, 1, H, W)`` bool: where it is the surface of water from below, see `tracer.underwater.surface.Below`."""
    assert g.material_id is not None
    assert g.metallic is not None
    return g.hit & scene.materials.water[g.material_id.long()] & (g.metallic == 1)


def _beyond(
    scene: Scene, medium: Medium, g: GBuffer, points: Tensor, directions: Tensor, shows: Tensor, poses: Tensor
) -> tuple[Tensor, Tensor]:
    """Two of ``(B, 3, H, W)``: radiance of what lies beyond the surface where it ``shows``, and of what it reflects."""
    light = torch.zeros_like(points), torch.zeros_like(points)
    flat = g.normal if g.normal_geo is None else g.normal_geo
    for b in range(g.batch):
        rows = places(shows[b, 0])
        if not len(rows[0]):
            continue
        here, mask = (b, slice(None), *rows), shows[b, 0][rows]
        way, normal, at, out = directions[here].T, g.normal[here].T, points[here].T, flat[here].T * LIFT
        far, focal = torch.where(mask, g.camera.far, 0.0), g.camera.intrinsics[b, 1, 1]
        given = {"far": far, "focal": focal, "parallel": g.camera.orthographic, "poses": poses[b : b + 1]}
        share = torch.where(mask, reflectance(-(way * normal).sum(dim=1)), 0.0)
        sky = _along(scene, None, at - out, refracted(way, normal), **given)
        floor = _along(scene, medium.at(b), at + out, mirrored(way, normal), **given)
        light[0][here] = torch.where(mask[:, None], sky, 0.0).T
        light[1][here] = (share[:, None] * floor).T
    return light


def _along(
    scene: Scene,
    medium: Medium | None,
    origins: Tensor,
    ways: Tensor,
    *,
    far: Tensor,
    focal: Tensor,
    parallel: bool,
    poses: Tensor,
) -> Tensor:
    """``(N, 3)`` radiance along rays in the air, or in water: of surfaces in the light of the sun and the open sky.

    ``focal`` is in pixels at depth 1, or of ``parallel`` rays in pixels a world unit, at any distance.
    """
    hits = trace(scene, origins[None], ways[None], poses=poses, mask=MASK_PRIMARY, t_max=far[None])
    if medium is not None:
        within, given = torch.ones_like(hits.hit), {"poses": poses, "t_max": far[None]}
        hits = past_borders(scene, origins[None], ways[None], hits, within, **given)
        hits = hits.without(leaves(scene, hits))
    hits = hits.at((0,))
    points = origins + ways * torch.where(hits.hit, hits.t, 0.0)[:, None]
    spanned = focal.expand_as(hits.t) if parallel else focal / hits.t.clamp_min(1e-3)
    seen = look(scene, hits, ways, spanned, poses=poses[0])
    arriving = sky_irradiance(scene, seen.normal.T[None, :, None])[0, :, 0].T
    if medium is not None:
        arriving = arriving * medium.lit(points[None, :, 1])[0].T
    if scene.sun is not None:
        toward = F.normalize(resident(scene.sun.direction, ways), dim=0)
        begin, sunward = points + hits.normal * LIFT, toward.expand_as(points)
        sees = transmission(scene, begin, sunward, poses=poses[0], mask=MASK_SHADOW)
        cosine = (seen.normal @ toward).clamp_min(0)[:, None]
        arriving = arriving + sees * cosine * resident(scene.sun.irradiance, ways)
    diffuse = seen.albedo * (1 - seen.metallic[:, None]) * scene.materials.opacity[hits.material.long()][:, None]
    light = seen.emission + diffuse * arriving / math.pi
    if medium is None:
        return torch.where(hits.hit[:, None], light, _sky(scene, ways, None if parallel else 1 / focal))
    whole = torch.where(hits.hit, hits.t, torch.inf)[None]
    scattered = medium.scattered(ways[None, :, 1], whole, origins[None, :, 1])[0].T
    return torch.where(hits.hit[:, None], light * medium.clear(whole)[0].T, 0.0) + scattered


def _sky(scene: Scene, ways: Tensor, pixel: Tensor | None) -> Tensor:
    """``(N, 3)`` radiance of the sky as cameras see it, with sun, and stars where a pixel spans an angle."""
    rows = ways.T[None]
    sky = sky_behind(scene, rows)
    if scene.sky.stars is not None and pixel is not None:
        sky = sky + torch.where(rows[:, 1:2] > 0, stars(rows, scene.sky.stars, pixel), 0.0)
    if scene.sun is not None:
        sky = sky + sun_radiance(scene.sun, rows)
    return sky[0].T
