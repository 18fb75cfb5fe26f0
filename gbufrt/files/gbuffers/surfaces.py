"""Which pixels of a file's depth show a surface and which the sky; normals and motion of those that show two."""

from __future__ import annotations

import math

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt.camera import Camera
from gbufrt.directions import length
from gbufrt.files.gbuffers.convert import FARTHEST, distances
from gbufrt.files.gbuffers.profile import Profile
from gbufrt.files.precision import MOST_HALF
from gbufrt.sampling import shifted

SHARES = ("device", "normalised")  # kinds of depth from near to far
SKY_SHARE = 0.99  # of the sky's depth, from which a pixel counts as sky
ALIKE = 0.001  # share of the pixels that hold the largest depth exactly, where it is the sky's
BEYOND = 1000.0  # how many times farther than surfaces such a sky is at least
MANY = 0.02  # share of the surfaces' pixels that may not be lost to the sky of halves
MOST_NOISE = 1e-6  # of the largest depths: negative ones below it are what lossy compression leaves of 0
NOISE = 4.0  # how many times larger than the negative ones positive leavings may be
ENOUGH = 1 << 20  # pixels that quantiles are taken of
MIXED = 0.9  # of the usual length of a file's normals: the mean of two that are 50 degrees apart
NEAR = 0.02  # relative difference in depth of pixels on one surface
EVEN = 0.75  # pixels by which the motion of neighbours on one surface differs at most
OFF = 1.0  # pixels that motion may be off what its surface's neighbours tell, plus
OFF_SHARE = 0.25  # of that
AROUND = [(i // 3, i % 3) for i in range(9) if i != 4]


def hit_of(raw: Tensor, profile: Profile, normal: Tensor | None = None) -> Tensor:
    """``(B, 1, H, W)`` where depth is a surface's: positive, nearer than `FARTHEST`, and not the sky's.

    Args:
        raw: ``(B, 1, H, W)`` depth as ``profile`` has it.
        profile: by which depth is read.
        normal: ``(B, 3, H, W)`` of the file, which is 0 in the sky.
    """
    near_enough = distances(raw, profile) < FARTHEST  # not so of NaN
    raw = raw * profile.depth_scale
    bare = torch.zeros_like(raw, dtype=torch.bool) if normal is None else (normal == 0).all(1, keepdim=True)
    sky = _sky_of(raw, bare, profile)
    hit = near_enough & (raw > _leavings(raw)) & (raw < sky * SKY_SHARE if abs(profile.sky) > 1 else raw != sky)
    if profile.depth_kind in SHARES and not profile.reversed:
        hit = hit & (raw < 1)
    return hit


def unmixed(normal: Tensor, size: Tensor, depth: Tensor, hit: Tensor, camera: Camera) -> Tensor:
    """Normals, where the file has the mean of two surfaces' that of the neighbour in whose plane the pixel lies.

    Renderers average normals over a pixel, but not depth. Such a mean is shorter than 1, and the plane that it makes
    of a pixel at an edge stands in the way of reflected rays.

    Args:
        normal: ``(1, 3, H, W)`` world space, unit length.
        size: ``(1, 1, H, W)`` length of the file's normals; 0 where it holds none.
        depth: ``(1, 1, H, W)`` planar view z, world units.
        hit: ``(1, 1, H, W)`` bool.
        camera: of the picture.

    Returns:
        ``(1, 3, H, W)`` as ``normal``.
    """
    there = hit & (size > 0)
    mixed = there & (size < MIXED * _quantile(size[there], 0.5)) if bool(there.any()) else there
    if not bool(mixed.any()):
        return normal
    point = camera.unproject(depth)
    planes = torch.cat([camera.rotate_to_view(normal), point, (there & ~mixed).to(depth), normal], dim=1)
    (height, width), around = camera.size, F.pad(planes, (1, 1, 1, 1))
    best, nearest = normal, torch.full_like(depth, torch.inf)
    for down, right in AROUND:
        beside = around[..., down : down + height, right : right + width]
        facing, other, sure, found = beside.split((3, 3, 1, 3), dim=1)
        off = ((point - other) * facing).sum(1, keepdim=True).abs()
        closer = mixed & (sure > 0) & (off < nearest)
        nearest, best = torch.where(closer, off, nearest), torch.where(closer, found, best)
    return best


def unmixed_motion(motion: Tensor, depth: Tensor, hit: Tensor) -> Tensor:
    """Motion, where the file has the mean of two surfaces' that which two neighbours on the pixel's own surface tell.

    Renderers average motion over a pixel, but not depth. Such a mean is nobody's motion: blur leaves an outline of what
    flies past where it was, and histories are read at the wrong place.

    Args:
        motion: ``(1, 2, H, W)`` pixels.
        depth: ``(1, 1, H, W)`` planar view z, world units.
        hit: ``(1, 1, H, W)`` bool.

    Returns:
        ``(1, 2, H, W)`` as ``motion``.
    """
    planes = torch.cat([motion, torch.where(hit, depth, FARTHEST).log()], dim=1)
    best, nearest = motion, torch.full_like(depth, torch.inf)
    edge, told_so = torch.zeros_like(hit), torch.zeros_like(hit)
    for down, right in AROUND:
        beside, beyond = (shifted(planes, n * (right - 1), n * (down - 1)) for n in (1, 2))
        off, further = ((at[:, 2:] - planes[:, 2:]).abs() for at in (beside, beyond))
        edge = edge | (off > NEAR)
        sure = (off < NEAR) & (further < NEAR) & (length(beside[:, :2] - beyond[:, :2]) < EVEN)
        found = 2 * beside[:, :2] - beyond[:, :2]
        told_so = told_so | (sure & (length(found - motion) < OFF + OFF_SHARE * length(found)))
        closer = sure & (off < nearest)
        nearest, best = torch.where(closer, off, nearest), torch.where(closer, found, best)
    return torch.where(edge & ~told_so, best, motion)


def _sky_of(raw: Tensor, bare: Tensor, profile: Profile) -> float:
    """From which depth on, scaled as the profile says, a pixel shows the sky: the profile's, if the pixels allow it.

    A largest depth that many pixels share is a sky that the profile does not know, such as the far plane of Blender's
    EEVEE, where it is far beyond all others, or where they, and not all others, are ``bare`` of normals.
    The largest half, as the sky of a profile, is that of halves: no sky where float depths of many surfaces are larger.
    """
    sky = profile.sky * profile.depth_scale
    sky = math.inf if sky <= 0 else sky
    there = raw[(raw > 0) & (raw < FARTHEST)]
    if profile.depth_kind in (*SHARES, "reciprocal") or not there.numel():
        return sky
    last = float(there.max())
    others = there[there < last]
    if not others.numel():
        return sky
    shared = there.numel() - others.numel() > ALIKE * raw.numel()
    empty = shared and bool(bare[raw == last].all()) and not bool(bare[raw < last].all())
    middle, most = (_quantile(others, share) for share in (0.5, 1 - MANY))
    if profile.sky == MOST_HALF:
        lost = (others >= sky * SKY_SHARE) & (others < BEYOND * middle)
        if int(lost.sum()) > MANY * others.numel():
            sky = math.inf if not shared else last
    if empty:
        return min(sky, last)
    return min(sky, math.sqrt(most * last)) if shared and last > BEYOND * most else sky


def _leavings(raw: Tensor) -> float:
    """Up to which depth a pixel is empty: 0, but for what lossy compression makes of it, which is negative as often."""
    below = -float(torch.where(raw.isfinite(), raw, 0.0).min()) if raw.numel() else 0.0
    there = raw[(raw > 0) & raw.isfinite()]
    return NOISE * below if there.numel() and 0 < below < MOST_NOISE * float(there.max()) else 0.0


def _quantile(values: Tensor, share: float) -> float:
    some = values[:: values.numel() // ENOUGH + 1]
    return float(some.kthvalue(max(1, round(share * some.numel()))).values)
