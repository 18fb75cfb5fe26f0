"""The slice sweeps in torch: the definition of `post.sweep.op.sweep`, with its gradients."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor

from post.margin.view import PaddedView
from post.sweep import arcs, slices
from post.sweep.constants import ALIKE, FLATNESS, GROUPS, LEDGE, STRIDES
from post.sweep.layout import Receivers, Side, Slice, Tap
from post.sweep.occluders import blocked, overlap, own_solid, start
from post.sweep.open_sky import Sky, leaves_hit, open_share
from post.sweep.sectors import cover, no_cover, share, slice_sums


def sweep_reference(
    around: PaddedView,
    at: Receivers,
    noise: Tensor,
    radii: tuple[Tensor, ...],
    sky: Sky | None,
    *,
    directions: int,
    steps: int,
    parallel: bool,
    gathers: bool,
    soft: bool,
) -> Tensor:
    """``(radii or 1, 8 or 11, B, h, w)``. Arguments and result are those of `post.sweep.op.sweep`."""
    add_slice, rows = _gather if gathers else _occlude, []
    for cut, band in slices.bands(at):
        sums = torch.zeros((), dtype=at.z.dtype, device=at.z.device)
        for which in range(directions):
            random = slices.slice_noise(band, noise[:, cut], which, directions)
            sums = sums + add_slice(around, band, *random, radii, sky, steps, parallel, soft)
        rows.append(sums)
    return torch.cat(rows, dim=3)


def _occlude(
    around: PaddedView,
    at: Receivers,
    cos_psi: Tensor,
    sin_psi: Tensor,
    jitter: Tensor,
    dither: Tensor,
    radii: tuple[Tensor, ...],
    sky: Sky | None,
    steps: int,
    parallel: bool,
    soft: bool,
) -> Tensor:
    """What one slice adds to the sums of `arcs.finish`, for each radius."""
    cut = slices.cut_slice(at, cos_psi, sin_psi)
    covered = [no_cover(at.z, soft) for _ in radii or (None,)]
    own = own_solid(around, at)
    right, left = arcs.sides(around, at, cut)
    for side in (right, left):
        reach_px = torch.minimum(radii[-1] * side.length, side.border) if radii else side.frame
        before = start(at, side, own)
        for i in range(steps):
            px = slices.tap_pixels(reach_px.detach(), i, jitter, steps, slices.WITHIN if radii else slices.BEYOND)
            tap = arcs.look(around, at, side, px, parallel)
            covers, before = blocked(tap, before, side, radii, soft)
            for s, (low, high, near) in enumerate(covers):
                ends = (left.whole + low, left.whole + high) if side is right else (left.whole - high, left.whole - low)
                covered[s], _ = cover(covered[s], *ends, near, dither)
    openness = _openness(around, at, cut, right, left, sky)
    return torch.stack([slice_sums(cut, sectors, openness) for sectors in covered])


def _gather(
    around: PaddedView,
    at: Receivers,
    cos_psi: Tensor,
    sin_psi: Tensor,
    jitter: Tensor,
    dither: Tensor,
    radii: tuple[Tensor, ...],
    sky: Sky | None,
    steps: int,
    parallel: bool,
    soft: bool,
) -> Tensor:
    """What one slice adds to the sums of `arcs.finish`, and the light that it gathers."""
    cut = slices.cut_slice(at, cos_psi, sin_psi)
    covered, own = no_cover(at.z, soft), own_solid(around, at)
    gathered = at.z.new_zeros(3, *at.z.shape)
    right, left = arcs.sides(around, at, cut)
    own_plane = at.x, at.y, at.z, at.nx, at.ny, at.nz
    for side in (right, left):
        farthest = torch.minimum(side.frame, radii[0] * side.length) if radii else side.frame
        before, plane = start(at, side, own), own_plane
        for i in range(steps):
            px = slices.tap_pixels(farthest.detach(), i, jitter, steps, slices.BEYOND)
            tap = arcs.look(around, at, side, px, parallel)
            next_plane = _plane(tap, parallel)
            ledge = LEDGE * arcs.step(overlap(tap, before)) * _edge_on(next_plane, plane, at)
            ((low, high, near),), before = blocked(tap, before, side, radii, soft, _flat(next_plane, plane))
            plane = next_plane
            ends = (left.whole + low, left.whole + high) if side is right else (left.whole - high, left.whole - low)
            covered, fresh = cover(covered, *ends, near, dither)
            sends = torch.maximum(_facing(plane, at), ledge) * (1 - _flat(plane, own_plane))
            lit = share(fresh) * sends
            gathered = gathered + lit * tap.rest[:, :3].movedim(1, 0)
    sums = slice_sums(cut, covered, _openness(around, at, cut, right, left, sky))
    return torch.cat([sums, gathered * cut.weight])[None]


def _openness(
    around: PaddedView, at: Receivers, cut: Slice, right: Side, left: Side, sky: Sky | None
) -> Tensor | float:
    """``(GROUPS, B, h, w)``: how open what is not covered is; 1 where nothing limits the sky."""
    if sky is None:
        return 1.0
    hits = leaves_hit(around, at, right), leaves_hit(around, at, left)
    return open_share(sky, cut, GROUPS, left.whole, hits)


def _plane(tap: Tap, parallel: bool) -> tuple[Tensor, ...]:
    """Point and normal of a tap in view space, six planes."""
    x, y = (tap.x, tap.y) if parallel else (tap.x * tap.z, tap.y * tap.z)
    return x, y, tap.z, *tap.rest[:, 3:].unbind(1)


def _flat(one: tuple[Tensor, ...], other: tuple[Tensor, ...]) -> Tensor:
    """1 where two points lie in each other's planes, else 0."""
    dx, dy, dz = one[0] - other[0], one[1] - other[1], one[2] - other[2]
    off = torch.maximum(
        (dx * one[3] + dy * one[4] + dz * one[5]).abs(), (dx * other[3] + dy * other[4] + dz * other[5]).abs()
    )
    alike = arcs.step(one[3] * other[3] + one[4] * other[4] + one[5] * other[5] - 0.5)
    return arcs.step(FLATNESS * (dx * dx + dy * dy + dz * dz + 1e-20).sqrt() - off) * alike


def _edge_on(plane: tuple[Tensor, ...], before: tuple[Tensor, ...], at: Receivers) -> Tensor:
    """1 where a tap and the one before are parallel to the receiver, and what joins tap and receiver faces the eye."""
    parallel = arcs.step(_cosine(plane[3:], at) - ALIKE) * arcs.step(_cosine(before[3:], at) - ALIKE)
    dx, dy, dz = at.x - plane[0], at.y - plane[1], at.z - plane[2]
    toward_eye = dx * at.vx + dy * at.vy + dz * at.vz
    off_plane = (dx * at.nx + dy * at.ny + dz * at.nz) * (at.nx * at.vx + at.ny * at.vy + at.nz * at.vz)
    return parallel * arcs.step(toward_eye - off_plane)


def _cosine(normal: tuple[Tensor, ...], at: Receivers) -> Tensor:
    return normal[0] * at.nx + normal[1] * at.ny + normal[2] * at.nz


def _facing(plane: tuple[Tensor, ...], at: Receivers) -> Tensor:
    """1 where the receiver lies above a tap's plane, else 0."""
    x, y, z, nx, ny, nz = plane
    return arcs.step((at.x - x) * nx + (at.y - y) * ny + (at.z - z) * nz)


def bodies_reference(depth: Tensor, hit: Tensor, back: Tensor, pixel: Tensor) -> Tensor:
    """Depth of the back of each pixel's body, from all surrounding pixels whose solids overlap with its own.

    Args:
        depth: ``(B, 1, H, W)`` planar view z of fronts, world units.
        hit: ``(B, 1, H, W)`` bool.
        back: as ``depth``, of backs.
        pixel: ``(B, 2)``: the width of a pixel at depth 0 and its increase per unit of depth, as shares of how far
            apart the rays to one body may be; 0 for any distance.

    Returns:
        As ``back``.
    """
    height, width = depth.shape[-2:]
    narrowest, growth = pixel[..., None, None, None].unbind(1)
    wide = narrowest + growth * depth
    for stride in STRIDES:
        fronts = F.pad(torch.where(hit, depth, torch.inf), (stride,) * 4, value=torch.inf)
        backs = F.pad(torch.where(hit, back, -torch.inf), (stride,) * 4, value=-torch.inf)
        deepest = back
        for dy in (0, stride, 2 * stride):
            for dx in (0, stride, 2 * stride):
                place = (..., slice(dy, dy + height), slice(dx, dx + width))
                one = (fronts[place] <= back) & (depth <= backs[place])
                one = one & (wide * wide * ((dx - stride) ** 2 + (dy - stride) ** 2) <= 1)
                deepest = torch.where(one, torch.maximum(deepest, backs[place]), deepest)
        back = deepest
    return back
