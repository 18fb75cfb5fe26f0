"""Edge weights of filters: whether two pixels show the same surface, by plane distance and normal; and what kernels of
them are made for."""

from __future__ import annotations

from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt import Camera
from gbufrt.compute.resident import resident
from post.filters.constants import DEPTH, HIT, MOST_PLANES, NX, NY, NZ, ROUGHNESS, ROUGHNESS_SCALE

GAUSSIAN = (1 / 4, 1 / 2, 1 / 4)
SQUARINGS = (11, 7, 5, 4, 3)  # of the cosine between normals: powers that filters have: 2048, 128, 32, 16 and 8


@dataclass(frozen=True, eq=False)
class Surface:
    """Geometry prepared for the taps of a filter.

    Args:
        guide: ``(B, 5 or 6, H, W)``: depth, world normal, hit and, where given, roughness.
        plane: ``(B, 4, H, W)``: normal . ray, its change per pixel in x and in y, and pixels per world unit. Because
            normal . ray is affine in the pixel, the distance of a tap from the centre's plane costs one product.
        perspective: whether the camera is perspective.
    """

    guide: Tensor
    plane: Tensor
    perspective: bool

    @property
    def hit(self) -> Tensor:
        """``(B, 1, H, W)`` bool."""
        return self.guide[:, HIT : HIT + 1] > 0

    def scaled(self, x: int, y: int) -> Tensor:
        """``plane`` for taps that lie x and y pixels apart."""
        factors = resident((1.0, float(x), float(y), 1.0), self.plane)
        return self.plane * factors[None, :, None, None]


def surface_reference(depth: Tensor, normal: Tensor, hit: Tensor, camera: Camera, roughness: Tensor | None) -> Surface:
    """The definition of `post.filters.surfaces.surface`, in torch."""
    dtype = depth.dtype
    facing = camera.rotate_to_view(normal.to(dtype))
    focal = camera.lens.to(dtype)[:, :2, None, None]
    ray = camera.unproject(torch.ones_like(depth))
    along = facing[:, 2:] if camera.orthographic else (facing * ray).sum(1, keepdim=True)
    plane = torch.cat([along, facing[:, :2] / focal, camera.pixels_per_unit(depth)], dim=1)
    guide = [depth, normal.to(dtype), hit.to(dtype)] + ([] if roughness is None else [roughness.to(dtype)])
    return Surface(torch.cat(guide, dim=1), plane, not camera.orthographic)


def padded(planes: Tensor, margin: int) -> Tensor:
    """``planes`` with a margin of zeros, where nothing was hit."""
    return F.pad(planes, (margin, margin, margin, margin))


def windows(planes: Tensor, radius: int, step: int = 1, margin: int | None = None) -> list[Tensor]:
    """Views of planes padded by ``margin`` (by default just enough) from each tap of a (2 radius + 1) square.

    Padding happens outside compiled functions and slicing inside, so that a kernel reads one tensor. A margin common
    to several steps gives their views common strides.
    """
    margin = radius * step if margin is None else margin
    height, width = planes.shape[-2] - 2 * margin, planes.shape[-1] - 2 * margin
    views = []
    for dy, dx in offsets(radius):
        y, x = margin + dy * step, margin + dx * step
        views.append(planes[..., y : y + height, x : x + width])
    return views


def offsets(radius: int) -> list[tuple[int, int]]:
    """(dy, dx) of the taps of a (2 radius + 1) square, row by row."""
    reach = range(-radius, radius + 1)
    return [(dy, dx) for dy in reach for dx in reach]


def edge_weight(
    center: Tensor,
    tap: Tensor,
    plane: Tensor,
    dx: int | Tensor,
    dy: int | Tensor,
    *,
    perspective: bool,
    depth_sensitivity: float,
    normal_power: float,
) -> Tensor:
    """How well a tap matches the surface of the centre, 0 to 1.

    exp(-s d) of the tap's distance d from the centre's tangent plane in pixel footprints, times the cosine between
    normals to a power, times whether the tap hit anything and, where the guide has roughness, its similarity.

    Args:
        center: ``(B, K, H, W)`` guide of the centre.
        tap: the same, of the tap.
        plane: `Surface.plane`, scaled to the tap spacing.
        dx, dy: place of the tap in tap spacings; tensors ``(H, W)`` where it differs.
        perspective: `Surface.perspective`.
        depth_sensitivity: s, per pixel footprint.
        normal_power: exponent of the cosine.

    Returns:
        ``(B, H, W)``.
    """
    slope = plane[:, 1] * dx + plane[:, 2] * dy
    if perspective:
        distance = tap[:, DEPTH] * (plane[:, 0] + slope) - center[:, DEPTH] * plane[:, 0]
    else:
        distance = plane[:, 0] * (tap[:, DEPTH] - center[:, DEPTH]) + slope
    cosine = center[:, NX] * tap[:, NX] + center[:, NY] * tap[:, NY] + center[:, NZ] * tap[:, NZ]
    weight = torch.exp(-depth_sensitivity * distance.abs() * plane[:, 3])
    weight = tap[:, HIT] * weight * cosine.clamp(0.0, 1.0) ** normal_power
    if center.shape[1] > ROUGHNESS:
        weight = weight * torch.exp((center[:, ROUGHNESS] - tap[:, ROUGHNESS]).abs() / -ROUGHNESS_SCALE)
    return weight


def blurred(variance: Tensor) -> Tensor:
    """3x3 Gaussian: a single pixel's variance is too noisy to steer by."""
    planes = windows(padded(variance, 1), 1)
    weights = [GAUSSIAN[dy + 1] * GAUSSIAN[dx + 1] for dy, dx in offsets(1)]
    total = windows(padded(torch.ones_like(variance[:1]), 1), 1)
    norm = sum(w * t for w, t in zip(weights, total, strict=True))
    return sum((w * p for w, p in zip(weights, planes, strict=True)), torch.zeros_like(variance)) / norm


def fits_cuda(values: Tensor) -> bool:
    """Whether a thread of a GPU has room for the sums of so many channels."""
    return values.shape[1] <= MOST_PLANES


def squarings(power: float) -> tuple[int, ...]:
    """As many numbers as a kernel squares a cosine before it raises it to what is left of ``power``.

    Kernels are compiled for each length: few, so that few powers are compiled for.
    """
    return (0,) * next((count for count in SQUARINGS if power >= 2**count), 0)


def kinds_of(perspective: bool, power: float, guide: Tensor) -> tuple[tuple[int, ...], ...]:
    """Whether a camera is perspective, squarings leave something of a power, and a guide has roughness: as lengths."""
    left = power != 2 ** len(squarings(power))
    return (0,) * perspective, (0,) * left, (0,) * (guide.shape[1] > ROUGHNESS)
