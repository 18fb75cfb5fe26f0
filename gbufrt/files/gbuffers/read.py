"""An EXR file of another renderer as a frame."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from gbufrt.camera import Camera
from gbufrt.files.gbuffers.profile import SHIPPED, Profile, load_profile
from gbufrt.files.guard import MAX_PIXELS, read_parts
from gbufrt.frame import Frame
from gbufrt.gbuffer import GBuffer

SKY_SHARE = 0.99  # of the sky's depth, from which a pixel counts as sky
UNIT = 1e-3  # shorter normals are empty pixels


def read_gbuffer(
    path: str | Path,
    profile: str | Path = "auto",
    *,
    camera: Camera | None = None,
    fov: float | None = None,
    max_pixels: int = MAX_PIXELS,
) -> Frame:
    """A frame from an EXR file of another renderer, as a batch of one on the CPU.

    Direct light becomes ``radiance``; where the file has the finished picture alone, that becomes ``composite``, so
    that light is not added twice.

    Args:
        path: the file.
        profile: ``auto``, ``blender``, ``mitsuba``, or a TOML file with the fields of `Profile`.
        camera: the camera, in a world with y up.
        fov: vertical field of view in degrees, where there is no camera: the camera stands at the origin, and normals
            are estimated from depth, because those of the file lie in a world that is not known.
        max_pixels: the largest picture to accept.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file is damaged, no profile fits, or neither or both of camera and fov are given.
    """
    if (camera is None) == (fov is None):
        raise ValueError("read_gbuffer needs either camera or fov; pass one of them")
    if fov is not None and not 0 < fov < 180:
        raise ValueError(f"fov must lie between 0 and 180 degrees, got {fov}")
    layers = {n: c for p in read_parts(path, max_pixels=max_pixels) for n, c in p.channels.items()}
    chosen = _detect(path, layers) if profile == "auto" else load_profile(profile)
    raw = _first(layers, chosen.channels["depth"], 1)
    if raw is None:
        raise ValueError(f"{path} has no depth under {', '.join(chosen.channels['depth'])}; choose another profile")
    height, width = raw.shape[-2:]
    if camera is not None and camera.size != (height, width):
        raise ValueError(f"camera must be of size {(height, width)} as {path}, got {camera.size}")
    limit = chosen.sky * SKY_SHARE if chosen.sky > 0 else math.inf
    hit = (raw > 0) & (raw < limit)
    view = camera if camera is not None else _still(fov or 0.0, raw, hit)
    depth = torch.where(hit, raw, view.far)
    if chosen.depth_kind == "ray":
        depth = torch.where(hit, depth / view.unproject(torch.ones_like(depth)).norm(dim=1, keepdim=True), view.far)
    if bool((hit & (depth >= view.far)).any()):
        raise ValueError(f"camera.far must exceed every depth, got {view.far} and {float(depth.max()):g}; raise it")
    motion = _first(layers, chosen.channels.get("motion", []), 2)
    scale = torch.tensor(chosen.motion_scale).view(1, 2, 1, 1)
    roughness = _first(layers, chosen.channels.get("roughness", []), 1)
    albedo = _first(layers, chosen.channels.get("albedo", []), 3)
    radiance = _direct(layers, chosen)
    gbuffer = GBuffer(
        camera=view,
        depth=depth,
        hit=hit,
        normal=_normal(layers, chosen, view, depth, hit, posed=camera is not None),
        motion=None if motion is None else torch.where(hit, motion * scale, 0.0),
        albedo=None if albedo is None else torch.where(hit, albedo.clamp(0, 1), 0.0),
        roughness=None if roughness is None else torch.where(hit, roughness.clamp(0, 1), 1.0),
    )
    finished = None if radiance is not None else _first(layers, chosen.finished, 3)
    return Frame(gbuffer=gbuffer, radiance=radiance, composite=finished)


def _still(fov: float, raw: Tensor, hit: Tensor) -> Camera:
    """A camera at the origin that sees as far as the file reaches."""
    far = max(1000.0, 2 * float(torch.where(hit, raw, 0.0).max()))
    return Camera.look_at((0, 0, 0), (0, 0, -1), size=(raw.shape[-2], raw.shape[-1]), fov_y=fov, far=far)


def _detect(path: str | Path, layers: dict[str, np.ndarray]) -> Profile:
    found = {
        name: sum(_first(layers, n, 1) is not None for n in load_profile(name).channels.values()) for name in SHIPPED
    }
    fits = [name for name in SHIPPED if _first(layers, load_profile(name).channels["depth"], 1) is not None]
    if not fits:
        raise ValueError(f"{path} fits no profile ({', '.join(SHIPPED)}); write one and pass profile='own.toml'")
    return load_profile(max(fits, key=found.__getitem__))


def _first(layers: dict[str, np.ndarray], names: list[str] | tuple[str, ...], count: int) -> Tensor | None:
    """``(1, count, H, W)`` of the first name that the file has."""
    for name in names:
        for ends in ([""], [".X", ".Y", ".Z"], [".R", ".G", ".B"]):
            keys = [k for e in ends[:count] for k in layers if k == name + e or k.split(".", 1)[-1] == name + e]
            if len(keys) == min(count, 3):
                return torch.from_numpy(np.stack([layers[k].astype(np.float32) for k in keys]))[None]
    return None


def _direct(layers: dict[str, np.ndarray], profile: Profile) -> Tensor | None:
    total = None
    for names in profile.direct:
        factors = [_first(layers, [name], 3) for name in names]
        present = [f for f in factors if f is not None]
        if len(present) == len(factors):
            product = math.prod(present[1:], start=present[0])
            total = product if total is None else total + product
    return total


def _normal(
    layers: dict[str, np.ndarray], profile: Profile, view: Camera, depth: Tensor, hit: Tensor, *, posed: bool
) -> Tensor:
    estimate = view.normals_from_depth(depth)
    normal = _first(layers, profile.channels.get("normal", []), 3) if posed else None
    if normal is not None:
        x, y, z = normal.unbind(1)
        normal = torch.stack([x, z, -y], 1) if profile.up == "z" else normal
        size = normal.norm(dim=1, keepdim=True)
        estimate = torch.where(size > UNIT, normal / size.clamp_min(UNIT), estimate)
        eye = view.rotate_to_world(view.to_eye(view.unproject(depth)))
        estimate = torch.where((estimate * eye).sum(1, keepdim=True) < 0, -estimate, estimate)
    return torch.where(hit, estimate, 0.0)
