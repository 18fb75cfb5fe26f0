"""An EXR file of another renderer as a frame."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import torch
from torch import Tensor

from gbufrt.camera import Camera
from gbufrt.demands.pictures import check_camera
from gbufrt.files.gbuffers.carried import carried_camera
from gbufrt.files.gbuffers.convert import distances, linear, planar, told, world_normals
from gbufrt.files.gbuffers.depths import stored_depth
from gbufrt.files.gbuffers.detect import detect, named_by
from gbufrt.files.gbuffers.layers import Layers
from gbufrt.files.gbuffers.light import is_eevee, light_of, opaque
from gbufrt.files.gbuffers.motion import motion_of
from gbufrt.files.gbuffers.named import Named
from gbufrt.files.gbuffers.profile import Profile, load_profile
from gbufrt.files.gbuffers.sequence import shot_parts
from gbufrt.files.gbuffers.settle import settled
from gbufrt.files.gbuffers.sky import COUNTED
from gbufrt.files.gbuffers.surfaces import hit_of, unmixed
from gbufrt.frame import Frame
from gbufrt.gbuffer import GBuffer
from gbufrt.numeric import check_counts, check_numbers

MOST_AWAY = 0.5  # share of normals that may face away, as back faces' do; more are a wrong sign, left to be seen
INSTEAD = {"albedo": 0.0, "roughness": 1.0, "metallic": 0.0}
OVERSHOOT = 1.05  # of albedo, roughness and metallic: filters and losses overshoot by less
BYTES = 8.0  # above it colours count to 255, dark ones too; below it what lies behind surfaces may add up
MANY_OVER = 0.01  # share of the surfaces that may be larger
BETTER = "G-buffers with ZIP, PIZ or PXR24"
EEVEE = (
    "Glossy Direct of EEVEE holds all its mirrors show, to which reflections add: leave them out (--without reflection)"
)
NO_CAMERA = "carries no camera; give one, or a field of view for a camera that stands still"


def read_gbuffer(
    path: str | Path | Sequence[Path],
    profile: str | Path | Profile = "auto",
    *,
    camera: Camera | None = None,
    previous_camera: Camera | None = None,
    fov: float | None = None,
    index: int = 0,
    whole: bool = False,
) -> Frame:
    """A frame from an EXR file of another renderer, as a batch of one on the CPU.

    It tests only whether the file can be read; `gbufrt inspect` and `post` test whether its channels agree.

    Direct light becomes ``radiance``, and ``emission`` is the part of it that has lit other surfaces already. Where the
    file has the finished picture alone, or it is asked for, that becomes ``composite``, so that light is not added
    twice. Where direct light holds the sky and lamps in mirrors already, as Blender's Glossy Direct does,
    ``environment`` is black, and ``emitters_mirrored`` is set. A warning says which passes of the direct light are
    missing. Where the file has no normal, the one of the depth is taken, and the extra signal ``normal_estimated`` is
    1.

    Args:
        path: the file, or the files of a frame whose passes have one each, named ``SHOT.PASS.NUMBER.exr`` or alike.
        profile: ``auto``, the name of a shipped one, a TOML file with the fields of `Profile`, or one.
        camera: the camera, in a world with y up; by default the one that the file carries. Its ``near`` is lowered
            and its ``far`` raised where the file reaches nearer or farther.
        previous_camera: that of the frame before. With it a file without motion gets that of a static world, and
            ``motion_z`` is that of a static world, of what moves by itself too.
        fov: vertical field of view in degrees, where there is no camera: the camera stands at the origin, and normals
            in the world's space, which is not known, are estimated from depth.
        index: of the frame.
        whole: take the finished picture where the file has passes of direct light too, for what adds no light to it.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file is damaged, no profile fits, both of camera and fov are given, or neither is and the file
            carries no camera.
    """
    for name, given in (("camera", camera), ("previous_camera", previous_camera)):
        if given is not None:
            check_camera(given, name)
    if camera is not None and fov is not None:
        raise ValueError("read_gbuffer takes either camera or fov; pass one of them")
    if previous_camera is not None and fov is not None:
        raise ValueError("previous_camera needs a camera with a pose; leave fov out")
    check_numbers(fov=0.0 if fov is None else fov)
    if fov is not None and not 0 < fov < 180:
        raise ValueError(f"fov must lie between 0 and 180 degrees, got {fov}")
    check_counts(index=index)
    if not isinstance(path, (str, Path, Iterable)):
        raise TypeError(f"path must be a path, or those of one frame, got {type(path).__name__}")
    files = [Path(file) for file in ([path] if isinstance(path, str | Path) else path)]
    path = files[0]
    layers = Layers(path, shot_parts(files))
    if not isinstance(profile, Profile):
        profile = load_profile(detect(files).name if profile == "auto" else profile)
    named = named_by(layers, profile)
    if camera is None and fov is None and (camera := carried_camera(layers.header, profile, layers.size)) is None:
        raise ValueError(f"{path} {NO_CAMERA}")
    if layers.views:
        warnings.warn(f"{path} holds the views {', '.join(layers.views)}; took {layers.views[0]}", stacklevel=2)
    if named.chosen:
        warnings.warn(f"{path}: {named.chosen}", stacklevel=2)
    return _frame(named, camera, previous_camera, fov or 0.0, index, whole)


def _frame(named: Named, camera: Camera | None, previous: Camera | None, fov: float, index: int, whole: bool) -> Frame:
    path, size = named.layers.path, named.layers.part(named.depth[0]).whole
    if camera is not None and (camera.size, camera.batch) != (size, 1):
        raise ValueError(f"camera must be one of size {size} as {path}, got {camera.batch} of {camera.size}")
    if lossy := named.layers.lossy([*named.depth, *named.keys("normal"), *named.motion[0]]):
        layers = ", ".join(dict.fromkeys(key.rpartition(".")[0] or key for key in lossy))
        warnings.warn(f"{layers}: packed with losses, wrong at edges; write {BETTER}", stacklevel=4)
    view = camera if camera is not None else still_camera(fov, size, named.layers.pixel_aspect)
    named = settled(named, view, posed=camera is not None)
    raw, profile = stored_depth(named, view, posed=camera is not None)
    facing = named.keys("normal")
    hit = hit_of(raw, profile, named.layers.stack(facing, size) if facing else None)
    if not bool(hit.any()):
        warnings.warn(f"{path} {nothing_hit(named.layers, raw, profile, named.depth[0])}", stacklevel=4)
    far = torch.where(hit, distances(raw, profile), 0.0)
    depth = torch.where(hit, planar(far, profile, view), 0.0)
    view = _reaching(view, depth[hit])
    depth = torch.where(hit, depth, view.far)
    normal, estimated = _normal(named, view, depth, hit, posed=camera is not None)
    motion, motion_z = motion_of(named, view, previous, depth, hit)
    albedo, roughness, metallic = (_channel(named, name, size, hit) for name in INSTEAD)
    albedo = opaque(albedo, named, size)
    lamps = named.keys("emission")
    emission = named.layers.stack(lamps, size) if lamps else None
    if roughness is not None and profile.shaded is not None:
        colors = [named.layers.stack(keys, size) for name in profile.shaded if (keys := named.find((name,), 3))]
        shaded = torch.cat([roughness, *colors], 1).abs().sum(1, keepdim=True) > 0
        roughness = torch.where(shaded, roughness, 1.0)
    radiance, finished, mirrors = light_of(named, size, whole, hit)
    if mirrors and is_eevee(named.layers.header, raw, hit):
        warnings.warn(EEVEE, stacklevel=4)
    gbuffer = GBuffer(
        camera=view,
        previous_camera=previous,
        depth=depth,
        hit=hit,
        normal=normal,
        motion=motion,
        motion_z=motion_z,
        albedo=None if albedo is None else torch.where(hit, linear(albedo, profile), 0.0),
        roughness=None if roughness is None else torch.where(hit, roughness.clamp(0, 1), 1.0),
        metallic=None if metallic is None else torch.where(hit, metallic.clamp(0, 1), 0.0),
        emission=None if emission is None else torch.where(hit, emission, 0.0),
    )
    extra = {"normal_estimated": estimated.to(depth.dtype)} if bool(estimated.any()) else {}
    counted = torch.zeros(COUNTED) if mirrors else None
    return Frame(
        gbuffer=gbuffer,
        index=index,
        emitters_mirrored=mirrors,
        radiance=radiance,
        environment=counted,
        composite=finished,
        extra=extra,
    )


def _reaching(view: Camera, depth: Tensor) -> Camera:
    """The camera with all ``depth`` between its near and its far: files seldom tell them, nor how long a unit is."""
    nearest, farthest = (float(depth.min()), float(depth.max())) if depth.numel() else (view.near, 0.0)
    near = view.near if nearest > view.near else nearest / 2
    return replace(view, near=near, far=view.far if farthest < view.far else 2 * farthest)


def nothing_hit(layers: Layers, raw: Tensor, profile: Profile, key: str) -> str:
    """What to say of depth without a surface."""
    if apart := layers.apart(key):
        return f"has no surface: {apart}"
    there = raw[torch.isfinite(raw)]
    if (
        there.numel()
        and bool((there * profile.depth_scale < 0).any())
        and not bool((there * profile.depth_scale > 0).any())
    ):
        return f"has no surface: all of {key} is negative; set depth_scale = -1 in a profile where it counts down"
    span = f"{float(there.min()):g} to {float(there.max()):g}" if there.numel() else "not finite"
    return f"has no surface: {key} is {span}, which is all sky by sky = {profile.sky:g}; set sky = in a profile"


def _channel(named: Named, name: str, size: tuple[int, int], hit: Tensor) -> Tensor | None:
    """``(1, C, H, W)`` as the file holds it; where it is not finite on surfaces, what is said instead."""
    keys = named.keys(name)
    if not keys:
        return None
    pixels = named.layers.stack(keys, size)
    lost = hit & ~pixels.isfinite().all(1, keepdim=True)
    if count := int(lost.sum()):
        instead = f"{INSTEAD[name]:g} there"
        warnings.warn(f"{named.layers.path}: {name} of {count} pixels is not finite, and {instead}", stacklevel=5)
    pixels = torch.where(lost, INSTEAD[name], pixels)
    over = (pixels > OVERSHOOT).any(1, keepdim=True) & hit
    if int(over.sum()) > MANY_OVER * int(hit.sum()):
        most = float(pixels[:, :, hit[0, 0]].max())
        why = "divide it if it counts to 255" if most > BYTES else "what is seen through another surface may add to it"
        warnings.warn(f"{named.layers.path}: {name} reaches {most:g}, and is clamped to 1; {why}", stacklevel=5)
    return pixels


def still_camera(fov: float, size: tuple[int, int], pixel_aspect: float = 1.0) -> Camera:
    """A camera at the origin, for a picture of ``(H, W)`` whose pixels are ``pixel_aspect`` times as wide as high."""
    camera = Camera.look_at((0, 0, 0), (0, 0, -1), size=size, fov_y=fov)
    intrinsics = camera.intrinsics.clone()
    intrinsics[:, 0, 0] /= pixel_aspect
    return replace(camera, intrinsics=intrinsics)


def _normal(named: Named, view: Camera, depth: Tensor, hit: Tensor, *, posed: bool) -> tuple[Tensor, Tensor]:
    """Normals, and where they are estimates; those of the file lie in the camera's space, or its pose is known."""
    eye, there = view.rotate_to_world(view.to_eye(view.unproject(depth))), torch.zeros_like(hit)
    normal = view.normals_from_depth(depth) if min(view.size) > 1 else eye
    keys = named.keys("normal") if posed or named.profile.normals_turn else []
    if keys:
        raw = named.layers.stack(keys, view.size)
        if bool(hit.any()) and not told(raw):
            value = ", ".join(f"{v:g}" for v in raw[0, :, 0, 0].tolist())
            warnings.warn(f"{named.layers.path}: normals are {value} everywhere, and count as absent", stacklevel=5)
            return torch.where(hit, normal, 0.0), hit
        if bool(hit.any()) and (most := float(raw.abs().amax(1)[hit[:, 0]].median())) > BYTES:
            warnings.warn(
                f"{named.layers.path}: normals reach {most:g}; write them from -1 to 1, or 0 to 1", stacklevel=5
            )
        given, long = world_normals(raw, named.profile, view)
        there = long > 0
        normal = torch.where(there, unmixed(given, long, depth, hit, view), normal)
        away = hit & ((normal * eye).sum(1, keepdim=True) < 0)
        if int(away.sum()) < MOST_AWAY * int(hit.sum()):
            normal = torch.where(away, -normal, normal)
    return torch.where(hit, normal, 0.0), hit & ~there
