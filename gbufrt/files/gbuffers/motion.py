"""Motion of a file: as its profile says, as the cameras tell, or that of a world that stands still."""

from __future__ import annotations

import math
import warnings
from dataclasses import replace

import torch
from torch import Tensor

from gbufrt.camera import Camera
from gbufrt.directions import length
from gbufrt.files.gbuffers.convert import half_step_px, pixels_to_previous
from gbufrt.files.gbuffers.named import Named
from gbufrt.files.gbuffers.profile import AUTO, Profile
from gbufrt.files.gbuffers.surfaces import unmixed_motion
from gbufrt.validation.geometry import FEW

MOVES = 0.5  # pixels of the cameras' motion, from which on it tells anything
ALONG = 0.25  # pixels along an axis, from which on they tell its factor
CLOSE = 0.1  # of the cameras' motion that the file's may be off to agree with it, at least this many pixels
AGREE = 0.5  # share of the pixels that must agree: what moves by itself does not
FARTHER = 1e6  # times as far, where cameras that go on move nothing
STEPS = 4  # of the search for a factor on depth
STILL = (0.0, 0.5)  # what motion may hold where nothing moves


def motion_of(
    named: Named, view: Camera, previous: Camera | None, depth: Tensor, hit: Tensor
) -> tuple[Tensor | None, Tensor | None]:
    """Motion of the file, or of a static world; and that of z as the cameras tell it.

    What moves by itself has the cameras' own motion of z too: they know how far they went, and nothing tells the rest.
    Halves are coarse where motion is counted round 0.5: within their steps the cameras know better.

    Args:
        named: channels of a file under the names of a profile.
        view: the camera.
        previous: that of the frame before, if it is known.
        depth: ``(1, 1, H, W)`` planar, world units.
        hit: ``(1, 1, H, W)`` bool.

    Returns:
        ``(1, 2, H, W)`` previous minus current px, and ``(1, 1, H, W)`` that of view z; None where nothing tells them.
    """
    keys, profile = named.motion
    static, static_z = (None, None) if previous is None else view.static_motion(previous, depth, hit)
    raw = named.layers.stack(keys, view.size) if keys else None
    if raw is not None and static is not None and not bool(raw.any()) and int(_told(raw, static, hit).sum()) >= FEW:
        absent = "is 0 everywhere although the camera moves, as Blender's is with motion blur, and counts as absent"
        warnings.warn(f"{named.layers.path}: motion {absent}", stacklevel=5)
        raw = None
    if raw is not None and profile.motion_fitted:
        found = None if static is None else _fitted(raw, profile, static, hit)
        if found is not None:
            warnings.warn(f"motion is read with {_settings(found)}, by which it fits the cameras", stacklevel=5)
        elif profile.motion_fitted != AUTO:
            raw = None
        profile = found or profile
    if raw is None:
        return static, static_z
    motion = pixels_to_previous(raw, profile)
    known = hit & motion.isfinite().all(1, keepdim=True)
    motion = unmixed_motion(torch.where(known, motion, 0.0), depth, known)
    if lost := int((hit & ~known).sum()):
        what = "stands still" if static is None else "is that of a world that stands still"
        warnings.warn(f"{named.layers.path}: motion of {lost} pixels is not finite, and {what} there", stacklevel=5)
    if static is None or static_z is None:
        return torch.where(known, motion, 0.0), None
    if named.layers.is_half(keys):
        known = known & ((motion - static).abs() > half_step_px(raw, profile)).any(1, keepdim=True)
    return torch.where(known, motion, static), static_z


def fitted(named: Named, view: Camera, previous: Camera, depth: Tensor, hit: Tensor) -> Profile | None:
    """The profile with the motion by which a frame fits its cameras, be it its own; None where nothing tells it.

    Args: see `motion_of`.
    """
    keys, profile = named.motion
    if not keys or not profile.motion_fitted:
        return None
    static, _ = view.static_motion(previous, depth, hit)
    raw = named.layers.stack(keys, view.size)
    if profile.motion_fitted == AUTO and _agreeing(raw, profile, static, _told(raw, static, hit)) >= AGREE:
        found = replace(profile, motion_fitted=False)
    else:
        found = _fitted(raw, profile, static, hit)
    return found and replace(found, motion_target=named.profile.motion_target)


def depth_factor(motion: Tensor, view: Camera, previous: Camera, depth: Tensor, told: Tensor) -> float:
    """The factor on depth by which motion is most likely that of a static world: what is nearer moves more.

    Args:
        motion: ``(1, 2, H, W)`` previous minus current px.
        view: the camera.
        previous: that of the frame before.
        depth: ``(1, 1, H, W)`` planar, in any unit.
        told: ``(1, 1, H, W)`` bool, where motion tells something.

    Returns:
        It, or 1 where the camera only turns.
    """
    scale, depth = 1.0, depth.double()
    turned, _ = view.static_motion(previous, depth * FARTHER, told)
    rest = motion.double() - turned
    for _ in range(STEPS):
        gone = view.static_motion(previous, depth * scale, told)[0] - turned
        share = (rest * gone).sum(1, keepdim=True) / gone.square().sum(1, keepdim=True)
        nearer = float(share[told].median()) if bool(told.any()) else math.nan
        if not 0 < nearer < math.inf:
            return 1.0
        scale /= nearer
    return scale


def _fitted(raw: Tensor, profile: Profile, static: Tensor, hit: Tensor) -> Profile | None:
    """The profile with the factors by which most motion is that of a static world; None where there are none.

    None also where factors of its own may be right (``auto``), and are.
    """
    told = _told(raw, static, hit)
    read = [scaled for still in STILL if (scaled := _scaled(raw, profile, static, told, still)) is not None]
    if not read or (profile.motion_fitted == AUTO and _agreeing(raw, profile, static, told) >= AGREE):
        return None
    best = max(read, key=lambda scaled: _agreeing(raw, scaled, static, told))
    return best if _agreeing(raw, best, static, told) >= AGREE else None


def _told(raw: Tensor, static: Tensor, hit: Tensor) -> Tensor:
    """``(B, 1, H, W)`` where motion tells something: of surfaces that move on the screen."""
    return hit & (length(static) > MOVES) & raw.isfinite().all(1, keepdim=True)


def _scaled(raw: Tensor, profile: Profile, static: Tensor, told: Tensor, still: float) -> Profile | None:
    """The profile with the factors that take the middle pixel to a static world's motion."""
    scale, sign = [], -1 if profile.motion_target == "next" else 1
    for axis in (0, 1):
        wanted, there = static[:, axis : axis + 1], raw[:, axis : axis + 1] - still
        tells = told & (wanted.abs() > ALONG) & (there != 0)
        if int(tells.sum()) < FEW:
            return None
        scale.append(sign * float((wanted / there)[tells].median()))
    return replace(
        profile, motion_offset=(still, still), motion_scale=tuple(scale), motion_unit="pixels", motion_fitted=False
    )


def _agreeing(raw: Tensor, profile: Profile, static: Tensor, told: Tensor) -> float:
    """The share of the pixels whose motion is that of a static world."""
    off = length(pixels_to_previous(raw, profile) - static)
    return float((off < (CLOSE * length(static)).clamp_min(CLOSE))[told].float().mean())


def _settings(profile: Profile) -> str:
    """The lines of a profile that tell how motion is counted."""
    x, y = profile.motion_scale
    offset = f", motion_offset = {list(profile.motion_offset)}" if any(profile.motion_offset) else ""
    return f"motion_scale = [{x:.2g}, {y:.2g}]{offset}"
