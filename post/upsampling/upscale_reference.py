"""Temporal upscaling in torch: the definition of `post.upsampling.upscale_op.upscaled`, with its gradients."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from gbufrt import Camera
from gbufrt.compute.resident import resident
from gbufrt.directions import length as size_of
from gbufrt.luminance import luminance
from gbufrt.sampling import inside, pixel_centers, sample
from post.history.constants import BRIGHTEST
from post.upsampling.accumulate import clipped, ellipses, ellipses_before, gathered, held, locked, mean_weight, shear
from post.upsampling.constants import (
    FASTEST,
    FEW,
    FOLLOWS,
    HID,
    KNOWN,
    LEAVES,
    LOCK_WIDENS,
    LOST_BETWEEN,
    LOST_MOVING,
    LOST_SHEARED,
    MATURE,
    MIRRORS,
    NEW_SHARE,
    STEADY,
    TRUSTED,
)
from post.upsampling.motion import upscaled_motion
from post.upsampling.remap import remapped
from post.upsampling.samples import Samples


class Small(NamedTuple):
    """What the small pictures tell; all ``(B, C, h, w)``."""

    toned: Tensor
    """3: tone-mapped colour."""
    surfaces: Tensor
    """9: see `post.upsampling.motion.moving_surfaces`."""
    depths: Tensor
    """2: see `post.upsampling.motion.depths_before`, of the frame before."""
    alike: Tensor
    """1: see `post.upsampling.accumulate.same_light`."""
    features: Tensor
    """1: see `post.upsampling.accumulate.thin_features`."""
    motion: Tensor
    """2: of each sample, in pixels of the small picture."""
    mirrored: Tensor
    """1: how far samples count alike, whatever their distance, as what mirrors show changes over areas."""
    reactive: Tensor
    """0, 1 or 3: how much less history each channel may hold."""


class Large(NamedTuple):
    """A history; all ``(B, C, H, W)``."""

    toned: Tensor
    """3: the picture, tone-mapped."""
    length: Tensor
    """1: weight of the samples in it."""
    planes: Tensor
    """6: mean movement by clipping, and of its size; locks, see `post.upsampling.accumulate.locked`."""


class Tunables(NamedTuple):
    """See `post.upscale`."""

    gamma: float
    frames: float
    lock: float
    stability: float


def upscaled_reference(
    small: Small, before: Large, at: Samples, camera: Camera, previous: Camera, tunables: Tunables
) -> tuple[Tensor, Large]:
    """Arguments and results are those of `post.upsampling.upscale_op.upscaled`."""
    size = before.length.shape[-2], before.length.shape[-1]
    gamma, frames, lock, stability = tunables
    there, seen, depth, depth_before, hidden = upscaled_motion(small.surfaces, small.depths, camera, previous, at, size)
    motion = there - pixel_centers(there)
    valid, samples = inside(there, size) & seen, samples_before(small.motion, camera, at, size)
    between = (there - 0.5) - torch.floor(there - 0.5)
    read = torch.where(valid, sample(torch.cat([before.length, before.planes], dim=1), there), 0.0)
    weight, drift, wobble, locks = read.split((1, 1, 1, 4), dim=1)
    weight = weight * (1 - LOST_BETWEEN * (4 * between * (1 - between)).mean(1, keepdim=True))
    weight = weight * within(there, size)
    apart = shear(small.motion * resident(at.ratio, weight)[None, :, None, None])
    apart = at.nearest(apart).clamp_max(FASTEST)
    weight = weight * (1 - (apart - LEAVES).clamp(0, 1) * (HID * hidden).clamp_max(1)) / (1 + LOST_SHEARED * apart)
    weight = weight / (1 + LOST_MOVING * size_of(motion).clamp_max(FASTEST))
    locks, alike = held(locks, depth, depth_before, motion), at.between(small.alike)
    weight, locks = weight * alike.square(), torch.cat([locks[:, :1] * alike, locks[:, 1:]], dim=1)
    old = remapped(before.toned, there)

    known = (sample(before.length, samples) / MATURE).clamp_max(1.0) * (1 - small.mirrored)
    shapes = torch.lerp(ellipses(small.toned), ellipses_before(before.toned, samples), known)
    now = gathered(small.toned, remapped(before.toned, samples), shapes, at, weight)
    react = at.between(small.reactive) if small.reactive.shape[1] else torch.zeros_like(weight)
    own, even = 1 - at.between(small.mirrored), torch.full_like(weight, mean_weight(at))
    counts = torch.lerp(even, now.weight, (weight / min(KNOWN, FEW * mean_weight(at))).clamp(0, 1) * own)
    spared = lock * locks[:, :1] * (1 - react.amax(1, keepdim=True)) * own
    calm = (1 - drift.abs() / wobble.clamp_min(STEADY)).clamp(0, 1) * (wobble > STEADY)
    color = now.color + FOLLOWS * weight / (weight + TRUSTED) * (old - now.expected)
    extent = (gamma + LOCK_WIDENS * spared + stability * calm) * (1 - MIRRORS * (1 - own))
    kept, moved, weight = clipped(old, now, extent, weight, at)
    moved = torch.where(weight > 0, moved.detach(), 0.0)
    most = torch.minimum(weight, (1 - react) * frames * mean_weight(at))
    kept = torch.lerp(kept, old, spared)
    mixed = torch.lerp(kept, color, counts / (most + counts))
    mixed = torch.minimum(torch.maximum(mixed, torch.minimum(kept, now.least)), torch.maximum(kept, now.most))
    result = torch.where(weight > 0, mixed, now.color)
    drift, wobble = torch.lerp(drift, moved, NEW_SHARE), torch.lerp(wobble, moved.abs(), NEW_SHARE)
    locks = locked(locks, small.features, at, now.weight, depth, motion)
    length = (weight + now.weight).clamp_max(frames * mean_weight(at))
    return light_of(result), Large(result, length, torch.cat([drift, wobble, locks], dim=1))


def within(px: Tensor, size: tuple[int, int]) -> Tensor:
    """``(B, 1, H, W)``: 1 where reads lie between pixels, down to 0 at the border, beyond which nothing was seen.

    Args:
        px: ``(B, 2, H, W)`` pixels.
        size: ``(H, W)`` of what is read.
    """
    end = px.new_tensor([size[1], size[0]])[None, :, None, None]
    return (2 * torch.minimum(px, end - px)).amin(1, keepdim=True).clamp(0, 1)


def samples_before(motion: Tensor, camera: Camera, at: Samples, size: tuple[int, int]) -> Tensor:
    """``(B, 2, h, w)``: where each sample was, in pixels of the large picture; beyond its border by one at most.

    Args:
        motion: see `Small`.
        camera: of this frame, small.
        at: the samples about each pixel.
        size: ``(H, W)`` of the large picture.
    """
    jitter = 0.0 if camera.jitter is None else camera.jitter.to(motion)[:, :, None, None]
    px = (pixel_centers(motion) + jitter + motion) * resident(at.ratio, motion)[None, :, None, None]
    return torch.stack([px[:, k].clamp(-1, size[1 - k] + 1) for k in (0, 1)], dim=1)


def begun(toned: Tensor, features: Tensor, depth: Tensor, at: Samples, size: tuple[int, int], frames: float) -> Large:
    """The history after a first frame.

    Args:
        toned: see `Small`, as ``features``.
        features: see ``toned``.
        depth: ``(B, 1, h, w)`` planar view z, world units.
        at: the samples about each pixel.
        size: ``(H, W)`` of the large picture.
        frames: see `post.upscale`.
    """
    none = toned.new_zeros(toned.shape[0], 1, *size)
    motion, depth = none.expand(-1, 2, -1, -1), at.nearest(depth.detach().to(toned))
    now = gathered(toned, toned, ellipses(toned), at, none)
    locks = locked(torch.cat([none, depth, motion], dim=1), features, at, now.weight, depth, motion)
    length = torch.full_like(none, min(frames, 1.0) * mean_weight(at))
    return Large(now.color, length, torch.cat([none, none, locks], dim=1))


def light_of(toned: Tensor) -> Tensor:
    """Linear radiance of tone-mapped colours ``(B, 3, H, W)``."""
    return toned / (1 - luminance(toned).clamp(0.0, BRIGHTEST))
