"""Depth as a file has it: a channel, whose sign may be either, or what the camera sees of positions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import torch
from torch import Tensor

from gbufrt.camera import Camera
from gbufrt.directions import length
from gbufrt.files.gbuffers.convert import FARTHEST, VIEWS, our_axes
from gbufrt.files.gbuffers.named import Named
from gbufrt.files.gbuffers.profile import AUTO, Profile

WHOLE, HALF = 0.98, 0.5  # share of a pixel that a surface fills: from the one on all, below the other it is the sky's
EDGE = 2  # pixels over which filters of renderers mix surfaces, or surface and sky
OFF = 0.05  # of the picture's width: how far from their pixels positions may lie


def stored_depth(named: Named, camera: Camera, *, posed: bool) -> tuple[Tensor, Profile]:
    """``(1, 1, H, W)`` depth in the kind and scale of a profile, 0 where nothing was hit; and that profile.

    Where the file has positions alone, or they come first, depth is planar, and of the spaces that they may lie in (the
    world with the axes that the profile allows, or the camera's) that one is taken in which they lie on their own
    pixels. Where they lie on them in none, the channel of depth serves.

    Args:
        named: channels of a file under the names of a profile.
        camera: of the picture.
        posed: whether the camera's pose is known; else positions in the world are of no use.

    Raises:
        ValueError: positions lie on their pixels in no space, and there is no channel of depth.
    """
    profile, keys, positions = named.profile, named.keys("depth"), named.keys("position")
    if keys and not (positions and profile.positions_first and posed):
        return _unmixed(_facing(named.layers.stack(keys), profile), named, profile), profile
    position = named.layers.stack(positions) * profile.depth_scale
    there = (position.abs() < FARTHEST).all(1, keepdim=True) & (position != 0).any(1, keepdim=True)
    best, off, seen = profile, torch.inf, position[:, 2:]
    for reading, points in _readings(torch.where(there, position, 1.0), profile, camera, posed=posed):
        found = _off_pixels(points, there, camera)
        if found < off:
            best, off, seen = reading, found, points[:, 2:]
    if off > OFF * camera.width and keys:
        return _unmixed(_facing(named.layers.stack(keys), profile), named, profile), profile
    if off > OFF * camera.width:
        settings = "check --camera, and up, handed and depth_scale of the profile"
        why = settings if posed else "those of the world need --camera"
        raise ValueError(f"{named.layers.path}: positions do not lie on the pixels that show them; {why}")
    return torch.where(there, seen / profile.depth_scale, 0.0), best


def _unmixed(raw: Tensor, named: Named, profile: Profile) -> Tensor:
    """Depth without the share of a sky of 0 that renderers average into pixels at silhouettes, or 0 where it is most.

    Such a pixel seems to lie far before all around it. The mean of its normals, which the sky has none of, is as short.
    """
    keys = named.keys("normal")
    if profile.sky != 0 or profile.depth_kind not in ("planar", "ray") or profile.normal_encoded or not keys:
        return raw
    side, share = 2 * EDGE + 1, length(named.layers.stack(keys)).nan_to_num(1.0)
    near_sky = torch.nn.functional.max_pool2d((raw == 0).to(raw), side, 1, EDGE) > 0
    farthest = torch.nn.functional.max_pool2d(raw.nan_to_num(0.0), side, 1, EDGE)
    alone = torch.where(share < HALF, 0.0, torch.minimum(raw / share.clamp_min(HALF), farthest))
    return torch.where(near_sky & (raw > 0) & (share < WHOLE), alone, raw)


def _facing(raw: Tensor, profile: Profile) -> Tensor:
    """Depth, negated where the profile allows either sign and most of it is negative, the sky apart."""
    below = raw.abs() < abs(profile.sky)
    down = profile.either_sign and int((below & (raw < 0)).sum()) > int((below & (raw > 0)).sum())
    return -raw if down else raw


def _readings(position: Tensor, profile: Profile, camera: Camera, *, posed: bool) -> Iterator[tuple[Profile, Tensor]]:
    """Positions in view space by each reading, and the profile in which it is settled."""
    ups = ("y", "z") if profile.up == AUTO else (profile.up,)
    for up in ups if posed else ():
        reading = replace(profile, up=up, depth_kind="planar")
        yield reading, camera.to_view(our_axes(position, reading))
    for space, signs in VIEWS.items():
        reading = replace(profile, depth_kind="planar")
        if space == "pbrt" and profile.normal_space == AUTO:  # where normals lie too
            reading = replace(reading, normal_space="pbrt")
        yield reading, position * position.new_tensor(signs).view(1, 3, 1, 1)


def _off_pixels(points: Tensor, there: Tensor, camera: Camera) -> float:
    """How far points in view space are from the pixels that show them: the median in pixels, inf behind the camera."""
    if not bool(there.any()):
        return 0.0
    off = length(camera.project(points) - camera.pixel_centers())
    return float(torch.where((points[:, 2:] > 0) & off.isfinite(), off, torch.inf)[there].median())
