"""How far solids reach behind their visible fronts: along the depth axis, and along the view ray where they are round.

A box ends at its silhouette in an edge; a ball, a pillar or a head rounds off there. By the power of a point, a ray to
a ball meets its front and its back at distances whose product is that of any other ray, and at the rim both are one.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt.camera import Camera
from gbufrt.compute.dispatch import Form, form_of
from gbufrt.compute.resident import number, waits
from gbufrt.directions import length
from post.sweep.constants import UNBOUNDED
from post.sweep.op import bodies_cpu
from post.sweep.reference import bodies_reference

# Of a sweep's reach: how far apart rays may be that show one body. Of a quarter, half, all of it and no limit half has
# the least mean RMSE of AO within 0.5, and within 2 and 4, in six views of the built-in world at 240x135.
APART = 0.5

STEEP = 0.5  # cosine between ray and normal: rims of bodies eight pixels wide or more turn away further
TURN = 0.9995  # cosine between neighbouring normals below which a surface turns: rims of up to a thousand pixels do
ALIKE = 0.3  # least ratio of how far a front and a rim lie behind each other's planes: on a ball it is 1
LEAST = 1e-12


def planar_thickness(
    camera: Camera,
    depth: Tensor,
    hit: Tensor,
    thickness: Tensor | float,
    hidden: Tensor | float = 0.0,
    reach: Tensor | None = None,
    *,
    compiled: bool | None = None,
) -> Tensor:
    """Planar depth from front to back.

    Measured thickness ends where the view ray leaves the body, which at an edge or on a slope is soon after it enters.
    Rays of neighbouring pixels show that the body continues there: solids that overlap in depth are one body, which
    reaches as deep as the deepest of them. Rays that are far apart for a sweep's reach tell nothing.

    Args:
        camera: of the picture.
        depth: ``(B, 1, H, W)`` planar view z, world units.
        hit: ``(B, 1, H, W)`` bool.
        thickness: ``(B, 1, H, W)`` measured along the view ray, world units; or one assumed for everything, a number
            or 0-dim tensor, which is taken as it is.
        hidden: added to measured thickness, world units, for hidden geometry behind it.
        reach: of the sweep, a 0-dim tensor, world units; by default unlimited.
        compiled: see `gbufrt.compute.dispatch.form_of`.

    Returns:
        ``(B, 1, H, W)`` world units.
    """
    if not isinstance(thickness, Tensor) or thickness.ndim == 0:
        return _bounded(torch.as_tensor(thickness).to(depth).expand_as(depth), depth) * camera.along_axis(depth.dtype)
    thickness, lens = thickness.to(depth.dtype), camera.lens.to(depth.dtype)
    pixel = depth.new_zeros(len(depth), 2) if reach is None else _pixel(camera, depth) / (APART * reach.detach())
    if form_of(depth, thickness, lens, hidden, compiled=compiled, cuda=True) is not Form.REFERENCE:
        more = number(hidden, depth).reshape(1)
        return bodies_cpu(depth, hit, thickness, lens.expand(len(depth), 6), pixel, more, camera.orthographic)
    toward = camera.along_axis(depth.dtype)
    back = depth + _bounded(thickness, depth) * toward
    return bodies_reference(depth, hit, back, pixel) - depth + hidden * toward


def _bounded(thickness: Tensor, depth: Tensor) -> Tensor:
    return torch.minimum(thickness, (UNBOUNDED * depth).detach())


def _pixel(camera: Camera, depth: Tensor) -> Tensor:
    """``(B, 2)`` width of a pixel at depth 0, and its increase per unit of depth."""
    width = 1 / camera.pixels_per_unit(depth.new_ones(camera.batch))
    zero = torch.zeros_like(width)
    return torch.stack([width, zero] if camera.orthographic else [zero, width], dim=1)


class End(NamedTuple):
    """One end of each pixel's run. All of one height and width."""

    point: Tensor
    """``(B, 3, H, W)``, of the run's last pixel in that direction."""
    opened: Tensor
    """``(B, 1, H, W)`` bool: the pixel past it is farther away or belongs to another object, without a crease."""
    crease: Tensor
    """``(B, 1, H, W)`` bool: there is a crease between it and the pixel past it."""


def round_chord(
    point: Tensor,
    normal: Tensor,
    facing: Tensor,
    ends: tuple[End, End],
    runs: tuple[Tensor, Tensor],
    orthographic: bool,
) -> Tensor:
    """Along the view ray, from front to back of bodies that are round.

    Exact for balls, and for pillars that stand across the run. Differentiable in points and normals.

    Args:
        point: ``(B, 3, H, W)`` view space, world units.
        normal: ``(B, 3, H, W)`` view space, unit length.
        facing: ``(B, 1, H, W)`` cosine between it and the ray toward the eye.
        ends: of each pixel's run.
        runs: ``(B, 1, H, W)`` int64 each: their first and last pixels.
        orthographic: whether rays are parallel.

    Returns:
        ``(B, 1, H, W)`` world units; inf where no end of the run is a rim of the surface.
    """
    wide, turns = runs[1] - runs[0] > 1, _rounding(normal, facing)
    rims = [end.opened & wide & turn.gather(-1, place) for end, turn, place in zip(ends, turns, runs, strict=True)]
    if not (waits(wide) or bool((rims[0] | rims[1]).any())):
        return torch.full_like(facing, torch.inf)
    total, weights = torch.zeros_like(facing), torch.zeros_like(facing)
    for end, rim, place in zip(ends, rims, runs, strict=True):
        turned = normal.gather(-1, place.expand_as(normal))
        way, turn = end.point - point, length(turned - normal)
        front, beyond = -(way * normal).sum(1, keepdim=True), (way * turned).sum(1, keepdim=True)
        rim = rim & (front > ALIKE * beyond) & (beyond > ALIKE * front) & (turn > (2 - 2 * TURN) ** 0.5)
        far = length(way)
        chord = _behind(point, end.point, turned, far / turn.clamp_min(LEAST), orthographic)
        weight = torch.where(rim & (chord > 0), 1 / far.clamp_min(LEAST), 0.0)
        total, weights = total + weight * chord, weights + weight
    return torch.where(weights > 0, total / weights.clamp_min(LEAST), torch.inf)


def _rounding(normal: Tensor, facing: Tensor) -> tuple[Tensor, Tensor]:
    """Where rows turn away from the eye, to the left and to the right, over three pixels.

    Args:
        normal: ``(B, 3, H, W)`` view space, unit length.
        facing: ``(B, 1, H, W)`` cosine between it and the ray toward the eye.

    Returns:
        Two ``(B, 1, H, W)`` bool.
    """
    one, other, steep = normal[..., 1:], normal[..., :-1], facing < STEEP
    turns = one[:, :1] * other[:, :1] + one[:, 1:2] * other[:, 1:2] + one[:, 2:] * other[:, 2:] < TURN
    falls, rises = turns & (facing[..., 1:] < facing[..., :-1]), turns & (facing[..., 1:] > facing[..., :-1])
    left, right = F.pad(rises[..., 1:] & rises[..., :-1], (0, 2)), F.pad(falls[..., 1:] & falls[..., :-1], (2, 0))
    return left & steep, right & steep


def _behind(point: Tensor, rim: Tensor, turned: Tensor, radius: Tensor, orthographic: bool) -> Tensor:
    """From a front to the back, whose middle lies as deep as the rim: half a chord behind the rim's last pixel."""
    if orthographic:
        return 2 * (rim - point)[:, 2:] - 2 * radius * turned[:, 2:]
    near, edge = length(point).clamp_min(LEAST), length(rim).clamp_min(LEAST)
    chord = -2 * radius * (turned * rim).sum(1, keepdim=True) / edge
    return edge * (edge + chord.clamp_min(0.0)) / near - near
