"""Primary visibility: the visible surfaces of a scene, as G-buffers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from gbufrt import Camera, GBuffer
from gbufrt.compute.resident import places, sent
from gbufrt.gbuffer import CHANNELS
from tracer.lights.haze import Air, range_of
from tracer.motion import motion_of
from tracer.scene.checks import check_scene, check_seen_by
from tracer.scene.material import MaterialTable
from tracer.scene.scene import MASK_PRIMARY, Scene
from tracer.scene.times import seconds
from tracer.texture import look
from tracer.traversal.hits import Hits
from tracer.traversal.panes import through_panes
from tracer.traversal.rays import run_lengths, trace
from tracer.underwater.air import air_before
from tracer.underwater.medium import Medium
from tracer.underwater.surface import Below, below, past_borders
from tracer.weather.waves import on_waves
from tracer.weather.wet import wet

MAX_THICKNESS = 64.0
"""World units beyond which a solid counts as infinitely thick."""


def gbuffer(
    scene: Scene,
    camera: Camera,
    *,
    previous_camera: Camera | None = None,
    time: float | Tensor | Sequence[float] = 0.0,
    previous_time: float | Tensor | Sequence[float] | None = None,
) -> GBuffer:
    """The first surface at each pixel, with every channel.

    Args:
        scene: what is there.
        camera: B cameras; their jitter is honoured.
        previous_camera: where they were a frame ago; by default where they are.
        time: seconds, one number or B.
        previous_time: of the frame before; by default ``time``, so that nothing moves.

    Returns:
        The G-buffer of the cameras, with exact motion and thickness.

    Raises:
        TypeError: no scene, or no camera.
        ValueError: no voxels, or times or cameras that do not fit each other.
    """
    return layers(scene, camera, previous_camera=previous_camera, time=time, previous_time=previous_time)[0]


def layers(
    scene: Scene,
    camera: Camera,
    *,
    previous_camera: Camera | None = None,
    time: float | Tensor | Sequence[float] = 0.0,
    previous_time: float | Tensor | Sequence[float] | None = None,
) -> tuple[GBuffer, GBuffer | None]:
    """The first surface at each pixel, and what lies straight behind it where it is transmissive.

    Args:
        scene: see `gbuffer`, as the rest.

    Returns:
        Two G-buffers with every channel. The second shows what is opaque: of transmissive surfaces before it, such as a
        second pane, only what they take from its light is left, in the first one's ``transmittance``. Its ``hit`` is
        False where the first surface is opaque or there is nothing behind it, and lengths are counted from its own
        surface. It is None where no material of the scene is transmissive.

    Raises:
        TypeError: no scene, or no camera.
        ValueError: no voxels, or times or cameras that do not fit each other.
    """
    check_scene(scene)
    check_seen_by(scene, camera)
    if previous_camera is not None:
        check_seen_by(scene, previous_camera, "previous_camera")
        previous_camera = single(previous_camera)
    camera = single(camera)
    rays = _primary_rays(scene, camera, previous_camera, time, previous_time)
    second = rises = under = None
    medium = Medium.of(scene, camera.position, rays.poses)
    far = rays.far if medium is None else torch.minimum(rays.far, medium.reach[:, None, None])
    given: dict[str, Any] = {"poses": rays.poses, "t_max": far}
    first = trace(scene, rays.origins, rays.directions, mask=MASK_PRIMARY, t_min=rays.near, **given)
    if medium is not None:
        first = past_borders(scene, rays.origins, rays.directions, first, medium.wet[:, None, None], **given)
    if scene.materials.transmissive:
        second = trace(scene, rays.origins, rays.directions, mask=MASK_PRIMARY, beyond=first, **given)
    if second is not None and scene.waves is not None:
        moments = {"times": rays.times, "before": rays.times_before, "eyes": camera.position}
        first, second, rises = on_waves(scene, rays.origins, rays.directions, first, second, **given, **moments)
    through = None
    if second is not None and medium is not None:
        under = below(scene, medium, rays.origins, rays.directions, first, rays.times, camera.position)
        second = second.without(under.shows)  # refraction leads elsewhere, see `tracer.underwater.frames`
    if second is not None:
        second, through = through_panes(scene, rays.origins, rays.directions, second, **given)
    air = air_before(scene, medium, rays.directions, first)
    solid, run = run_lengths(scene, rays.origins, rays.directions, first, poses=rays.poses, cap=MAX_THICKNESS)
    run = torch.where(first.back_face, first.t, run)  # the camera itself is in the medium whose back it shows
    if second is None or through is None:
        return _gbuffer(scene, rays, first, solid, run, air), None
    solid_behind, run_behind = run_lengths(
        scene, rays.origins, rays.directions, second, poses=rays.poses, cap=MAX_THICKNESS
    )
    inner = torch.where(first.back_face, run, torch.minimum(run, second.t - first.t))
    front = _gbuffer(scene, rays, first, solid, inner, air, rises, under)
    assert front.transmittance is not None
    front = front.replace(transmittance=front.transmittance * _planes(through))
    return front, _gbuffer(scene, rays, second, solid_behind, run_behind)


@dataclass(frozen=True, eq=False, kw_only=True)
class _PrimaryRays:
    """Cameras, the rays through their pixels, and where the instances are and were."""

    camera: Camera
    previous: Camera
    origins: Tensor
    directions: Tensor
    along: Tensor
    """``(B, H, W)`` planar depth of a world unit along each."""
    near: Tensor
    far: Tensor
    poses: Tensor
    poses_before: Tensor
    times: list[float]
    times_before: list[float]


def _primary_rays(
    scene: Scene,
    camera: Camera,
    previous: Camera | None,
    time: float | Tensor | Sequence[float],
    previous_time: float | Tensor | Sequence[float] | None,
) -> _PrimaryRays:
    origins, directions = camera.rays()
    along = (directions * camera.forward[:, None, None, :]).sum(-1)
    far = camera.far / along
    times = seconds(time, camera.batch)
    before = times if previous_time is None else seconds(previous_time, camera.batch, "previous_time")
    poses = sent(scene.poses(times), origins)
    return _PrimaryRays(
        camera=camera,
        previous=camera if previous is None else previous,
        origins=origins,
        directions=directions,
        along=along,
        near=camera.near / along,
        far=far if scene.haze is None else torch.minimum(far, range_of(scene.haze, directions)),
        poses=poses,
        times=times,
        times_before=before,
        poses_before=poses if before == times else sent(scene.poses(before), origins),
    )


def single(camera: Camera) -> Camera:
    """The camera in float32, in which rays are traced: matrices often come in float64."""
    return camera if camera.intrinsics.dtype == torch.float32 else camera.to(torch.float32)


def _gbuffer(
    scene: Scene,
    rays: _PrimaryRays,
    hits: Hits,
    thickness: Tensor,
    run: Tensor,
    air: Air | None = None,
    rises: Tensor | None = None,
    under: Below | None = None,
) -> GBuffer:
    """The channels of one layer.

    ``run`` is how far light from behind goes through the material that was hit, and ``rises`` how much higher the
    surface was a frame ago, where it is not an instance that moves.
    """
    camera, table = rays.camera, scene.materials
    hit = hits.hit[:, None]
    depth = torch.where(hits.hit, hits.t * rays.along, camera.far)[:, None]
    motion, motion_z = motion_of(scene, camera, rays.previous, hits, depth, poses=rays.poses_before, rises=rises)
    pixels = camera.pixels_per_unit(depth)[:, 0]
    seen = look(scene, hits, rays.directions, pixels, poses=rays.poses)
    seen = wet(scene, rays.origins, rays.directions, hits, seen, pixels, poses=rays.poses, times=rays.times)
    values = {
        "depth": depth,
        "normal": _planes(seen.normal),
        "normal_geo": _planes(hits.normal),
        "motion_z": motion_z,
        "albedo": _planes(seen.albedo),
        "roughness": seen.roughness[:, None],
        "metallic": seen.metallic[:, None],
        "emission": _planes(seen.emission),
        "opacity": table.each("opacity", hits.material)[:, None],
        "transmittance": _planes(_transmittance(table, hits, run)),
        "material_id": hits.material[:, None],
        "object_id": hits.instance[:, None],
        "thickness": thickness[:, None],
    }
    for lies_over in (under, air):
        values |= {} if lies_over is None else lies_over.over(values)
    for name, value in values.items():
        if name not in ("depth", "motion_z"):
            values[name] = torch.where(hit, value, CHANNELS[name].clear).to(value.dtype)
    if seen.normal is hits.normal:
        values["normal_geo"] = values["normal"]
    return GBuffer(camera=camera, previous_camera=rays.previous, hit=hit, motion=motion, **values)


def _transmittance(table: MaterialTable, hits: Hits, run: Tensor) -> Tensor:
    """``(B, H, W, 3)`` share of light that comes through; powers take long, so only where surfaces transmit."""
    which = hits.material.flatten()
    rows = places(hits.hit.flatten() & (table.each("opacity", which) < 1))[0]
    share = table.passing(which.index_select(0, rows), run.flatten().index_select(0, rows))
    return share.new_zeros(len(which), 3).index_copy(0, rows, share).view(*run.shape, 3)


def _planes(values: Tensor) -> Tensor:
    """(B, H, W, C) as (B, C, H, W)."""
    return values.permute(0, 3, 1, 2).contiguous()
