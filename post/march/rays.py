"""Screen-space rays: where a ray in view space hits on-screen surfaces.

Each pixel is a piece of the plane through its point with its normal, and a solid behind it of known or assumed
thickness. Over such a plane, and along a ray, nearness ``q`` (1 / z, or -z for an orthographic camera) is linear in the
picture. A ray therefore crosses a pixel's plane at the root of a linear equation, to a fraction of a pixel and without
a search, and a ray that leaves a flat surface cannot hit that surface again. A pyramid of the nearest front and the
farthest back lets rays skip surfaces that they pass in front of or behind. The surface that a ray passes before it goes
behind an occluder is taken to continue there, so that the sky does not shine through hidden geometry.

Source: McGuire and Mara 2014 (rays linear in the picture, thickness); Stachowiak 2015 and AMD FidelityFX SSSR
(traversal of a min-z pyramid).
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from gbufrt import Camera
from gbufrt.compute.resident import resident_on
from gbufrt.demands.pictures import check_pictures
from gbufrt.numeric import check_counts, check_numbers
from gbufrt.sampling import gather
from post.march.constants import BLOCKED, HIT, SPENT
from post.march.hierarchy import levels_of
from post.march.op import hierarchy_of, march


class Hierarchy(NamedTuple):
    """The data that `march_rays` traverses; made by `depth_hierarchy`."""

    planes: Tensor
    """``(B, H, W, 4)`` float32: q at the pixel centre, its change per pixel in x and y, q of the back."""
    pyramid: Tensor
    """``(B, N, 2)`` float32: greatest front q and smallest back q of each cell, levels from 1 up."""
    table: Tensor
    """``(levels + 1, 2)`` int64: where a level begins in ``pyramid``, and its width."""


class Hits(NamedTuple):
    """How each ray ended. Positions carry no gradient: shade with values read at ``px``."""

    px: Tensor
    """``(B, 2, h, w)`` where to read pictures: bilinear reads there stay on the surface that was hit. Without a
    hit, the centre of the last pixel that the ray was in front of before it left or went behind something for good."""
    hit: Tensor
    """``(B, 1, h, w)`` bool: the ray hit an on-screen surface from its front."""
    blocked: Tensor
    """``(B, 1, h, w)`` bool: the ray ended at hidden geometry: a side, or a surface that seems to continue behind its
    occluder; ``px`` is the pixel nearest to it."""
    spent: Tensor
    """``(B, 1, h, w)`` bool: the ray travelled the whole distance inside the picture."""
    distance: Tensor
    """``(B, 1, h, w)`` world units travelled."""
    agreement: Tensor
    """``(B, 1, h, w)`` in [0, 1]: how well depth supports the hit; for rays blocked by sides, how near the front."""


@torch.no_grad()
def depth_hierarchy(
    depth: Tensor,
    normal: Tensor,
    camera: Camera,
    *,
    hit: Tensor | None = None,
    thickness: Tensor | float = 0.5,
    compiled: bool | None = None,
) -> Hierarchy:
    """Prepare a depth picture for `march_rays`.

    Args:
        depth: ``(B, 1, H, W)`` planar view z, world units.
        normal: ``(B, 3, H, W)`` world space, unit; the geometric one where there is a choice.
        camera: of these pictures.
        hit: ``(B, 1, H, W)`` bool; False marks the sky, which stops no ray; by default every pixel.
        thickness: how far solids reach behind their fronts: ``(B, 1, H, W)`` along the view ray as in the
            G-buffer, or one assumed length for all. World units.
        compiled: see `gbufrt.compute.dispatch.form_of`.

    Returns:
        The hierarchy.

    Raises:
        TypeError: not a tensor, or of the wrong kind of number.
        ValueError: a shape does not fit the camera, or a kernel is requested where there is none.
    """
    check_pictures(camera, depth=depth, normal=normal, hit=hit, thickness=thickness)
    hit = torch.ones_like(depth, dtype=torch.bool) if hit is None else hit
    levels = ((0, camera.width), *((start, width) for start, _, width in levels_of(*camera.size)))
    table = resident_on(depth.device, levels, torch.int64)
    return Hierarchy(*hierarchy_of(depth, normal, hit, thickness, camera, compiled=compiled), table)


@torch.no_grad()
def march_rays(
    hierarchy: Hierarchy,
    origins: Tensor,
    directions: Tensor,
    camera: Camera,
    *,
    steps: int = 64,
    distance: float = 60.0,
    compiled: bool | None = None,
) -> Hits:
    """Follow rays until they hit a surface, pass behind the eye, leave the picture, or spend their steps or distance.

    Args:
        hierarchy: see `depth_hierarchy`.
        origins: ``(B, 3, h, w)`` view space, world units; a ray never hits the pixel that it starts in.
        directions: ``(B, 3, h, w)`` view space, unit; a zero vector sends no ray.
        camera: the camera of the hierarchy.
        steps: number of pixels a ray may be compared with one by one; those skipped in the pyramid do not count.
        distance: how far it may go, world units.
        compiled: whether to use the kernel; by default on the CPU. The reference runs elsewhere.

    Returns:
        See `Hits`.

    Raises:
        ValueError: steps or distance is not positive, or a kernel is requested on a device that has none.
    """
    check_reach(steps, distance)
    out = march(
        *hierarchy,
        lens_of(camera),
        origins.float(),
        directions.float(),
        float(camera.near),
        camera.orthographic,
        float(distance),
        int(steps),
        compiled=compiled,
    ).to(origins.dtype)
    status = out[:, 4:5]
    return Hits(out[:, :2], status == HIT, status == BLOCKED, status == SPENT, out[:, 2:3], out[:, 3:4])


def off_edge(hits: Hits, hierarchy: Hierarchy, camera: Camera, begun: Tensor) -> Hits:
    """Read the light of hidden geometry a pixel away from the edge next to it.

    Where pictures are anti-aliased, pixels at an edge hold light of both its sides, and all of a hidden surface would
    take it from one of them.

    Args:
        hits: those that are ``blocked`` move: at a side on along the ray, at a continued surface back, by a pixel, if
            the surface goes on there.
        hierarchy: see `depth_hierarchy`.
        camera: of the hierarchy.
        begun: ``(B, 2, h, w)`` centres of the pixels that the rays began in, at least two pixels away.

    Returns:
        The hits, with other ``px``.
    """
    planes, way = hierarchy.planes.permute(0, 3, 1, 2), hits.px - begun
    onward = 2 * (hits.agreement > 0).to(way) - 1
    step = onward / way.abs().amax(1, keepdim=True).clamp_min(1.0)
    column, row = hits.px[:, 0].floor(), hits.px[:, 1].floor()
    beside = (hits.px + step * way).floor()
    across, down = beside.unbind(1)
    q, gx, gy, _ = gather(planes, column, row).split(1, dim=1)
    expected = q + gx * (across - column)[:, None] + gy * (down - row)[:, None]
    side = (1 if camera.orthographic else q.abs()) / camera.intrinsics[:, 1, 1].view(-1, 1, 1, 1)
    inside = ((across >= 0) & (across < camera.width) & (down >= 0) & (down < camera.height))[:, None]
    goes_on = (gather(planes[:, :1], across, down) - expected).abs() <= 0.25 * side
    return hits._replace(px=torch.where(hits.blocked & inside & goes_on, beside + 0.5, hits.px))


def check_reach(steps: int, distance: float) -> None:
    """Raise a ValueError unless rays take a step and go somewhere, and a TypeError where one is no number."""
    check_counts(steps=steps)
    check_numbers(distance=distance)
    if steps < 1 or not distance > 0:
        raise ValueError(f"steps must be at least 1 and distance positive, got steps={steps}, distance={distance}")


def lens_of(camera: Camera) -> Tensor:
    """``(B, 4)`` float64: focal lengths and principal point, pixels, in the picture that was sampled."""
    focal, center, jitter = camera.lens.double().split(2, dim=1)
    return torch.cat([focal, center - jitter], dim=1)  # positions as camera.project(jittered=True) gives them
