"""Depth, normals, motion and colour of a profile's conventions by ours."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt.camera import Camera
from gbufrt.directions import length
from gbufrt.files.gbuffers.profile import Profile

FARTHEST = 1e12  # world units; what claims to be farther is a sky, or damaged
UNIT = 1e-3  # shorter normals are empty pixels
OFF_UNIT = 0.1  # how far from 1 the length of a normal may be: 8 bits and lossy compression leave less, 0.5 is 0.13 off
VIEWS = {"opencv": (1.0, 1.0, 1.0), "opengl": (1.0, -1.0, -1.0), "pbrt": (1.0, -1.0, 1.0)}
"""Factors on x, y and z of camera spaces that make them OpenCV's; pbrt's is x right, y up, z forward."""


def distances(raw: Tensor, profile: Profile) -> Tensor:
    """Depth as a distance, of the plane or along the ray; what was not hit may hold anything."""
    raw = raw * profile.depth_scale
    if profile.depth_kind == "reciprocal":
        return 1 / raw
    if profile.depth_kind == "device":
        share = raw if profile.reversed else 1 - raw  # 1 at the near plane, and linear in 1 / z
        return 1 / (1 / profile.far + share.double() * (1 / profile.near - 1 / profile.far)).to(raw)
    if profile.depth_kind == "normalised":
        return profile.near + (1 - raw if profile.reversed else raw) * (profile.far - profile.near)
    return raw


def planar(distance: Tensor, profile: Profile, camera: Camera) -> Tensor:
    """Planar view z from `distances`."""
    if profile.depth_kind != "ray" or camera.orthographic:
        return distance
    return distance / length(camera.unproject(torch.ones_like(distance)))


def world_normals(raw: Tensor, profile: Profile, camera: Camera) -> tuple[Tensor, Tensor]:
    """``(B, 3, H, W)`` unit normals in our world; ``(B, 1, H, W)`` their length in the file, 0 where it holds none."""
    encoded = profile.normal_encoded
    if encoded == "auto":
        encoded = _units(2 * raw - 1) > _units(raw)
    raw = (2 * raw - 1 if encoded else raw) * raw.new_tensor(profile.normal_scale).view(1, 3, 1, 1)
    size = length(raw)
    unit = raw / size.clamp_min(UNIT)
    if profile.normal_space in VIEWS:
        unit = camera.rotate_to_world(unit * unit.new_tensor(VIEWS[profile.normal_space]).view(1, 3, 1, 1))
    else:
        unit = our_axes(unit, profile)
    return unit, torch.where((size > UNIT) & size.isfinite(), size, 0.0)


def our_axes(vectors: Tensor, profile: Profile) -> Tensor:
    """``(B, 3, H, W)`` of the file's world in ours."""
    mirror, (x, y, z) = -1.0 if profile.handed == "left" else 1.0, vectors.unbind(1)
    return torch.stack([x, z, -mirror * y] if profile.up == "z" else [x, y, mirror * z], 1)


def their_axes(vectors: Tensor, profile: Profile, camera: Camera) -> Tensor:
    """``(B, 3, H, W)`` of our world in the space that the file's normals are in: what `world_normals` has turned."""
    if profile.normal_space in VIEWS:
        signs = vectors.new_tensor(VIEWS[profile.normal_space]).view(1, 3, 1, 1)
        return camera.rotate_to_view(vectors) * signs
    mirror, (x, y, z) = -1.0 if profile.handed == "left" else 1.0, vectors.unbind(1)
    return torch.stack([x, -mirror * z, y] if profile.up == "z" else [x, y, mirror * z], 1)


def told(raw: Tensor) -> bool:
    """Whether a layer holds normals: not one value everywhere that is none, as AOVs that nobody wrote."""
    return bool((raw != raw[:, :, :1, :1]).any()) or _units(raw) + _units(2 * raw - 1) > 0


def _units(vectors: Tensor) -> int:
    """How many vectors have unit length. A background of 0, 0.5 or 1 has it neither as it is nor decoded."""
    return int(((length(vectors) - 1).abs() < OFF_UNIT).sum())


def pixels_to_previous(raw: Tensor, profile: Profile) -> Tensor:
    """``(B, 2, H, W)`` previous minus current px."""
    return (raw - raw.new_tensor(profile.motion_offset).view(1, 2, 1, 1)) * _pixels(raw, profile)


def half_step_px(raw: Tensor, profile: Profile) -> Tensor:
    """``(B, 2, H, W)`` how many pixels of motion the next half is away."""
    steps = torch.ldexp(torch.ones_like(raw), torch.frexp(raw).exponent - 11).clamp_min(2.0**-24)
    return (steps * _pixels(raw, profile)).abs()


def _pixels(raw: Tensor, profile: Profile) -> Tensor:
    """Factors that make pixels to the frame before of the file's motion."""
    height, width = raw.shape[-2:]
    unit = (width, height) if profile.motion_unit == "uv" else (1, 1)
    sign = -1 if profile.motion_target == "next" else 1
    factors = [sign * scale * size for scale, size in zip(profile.motion_scale, unit, strict=True)]
    return raw.new_tensor(factors).view(1, 2, 1, 1)


def linear(colour: Tensor, profile: Profile) -> Tensor:
    """Albedo, linear in [0, 1]. Source of the curve: IEC 61966-2-1."""
    colour = colour.clamp(0, 1)
    if profile.albedo_space == "linear":
        return colour
    return torch.where(colour <= 0.04045, colour / 12.92, ((colour + 0.055) / 1.055) ** 2.4)
