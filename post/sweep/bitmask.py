"""Ambient occlusion by visibility bitmasks: taps cover sectors of each slice's arc."""

from __future__ import annotations

from typing import Any, NamedTuple

import torch
from torch import Tensor

from gbufrt.camera import Camera
from gbufrt.compute.dispatch import Form, form_of
from gbufrt.compute.fusion import fusible
from gbufrt.mending import held
from gbufrt.noise.noise import blue_noise
from gbufrt.sampling import gather
from post.sweep import arcs, slices
from post.sweep.chords import thickness_from_depth
from post.sweep.constants import EDGE, GROUPS
from post.sweep.layout import PaddedView, Receivers, Side, Tap
from post.sweep.op import sweep
from post.sweep.open_sky import Sky, leaves_hit, open_share, sky_beyond
from post.sweep.sectors import cover, no_cover, slice_sums
from post.sweep.thickness import planar_thickness

FADE = 0.1  # of the radius, to either side, over which detached occluders fade


class Front(NamedTuple):
    """The previous tap on the same side of a slice. Planes ``(B, h, w)``."""

    share: Tensor
    rise: Tensor
    run: Tensor
    distance: Tensor
    """0 for the receiver itself."""
    z: Tensor
    back_z: Tensor


class Cover(NamedTuple):
    """Shares of a side between which a tap occludes, and its weight within a radius, 0 to 1. Planes."""

    low: Tensor
    high: Tensor
    near: Tensor


def bitmask_ao(
    depth: Tensor,
    normal: Tensor,
    camera: Camera,
    *,
    hit: Tensor | None = None,
    thickness: Tensor | float | None = None,
    radius: float | Tensor | None = 0.5,
    directions: int = 4,
    steps: int = 12,
    scales: int = 1,
    hidden: float = 0.15,
    soft: bool | None = None,
    index: int = 0,
    seed: int = 0,
    compiled: bool | None = None,
) -> tuple[Tensor, Tensor]:
    """Ambient visibility within a radius, and the mean open direction.

    Every tap covers the sectors between the front and the back of its surface. Successive taps whose depth ranges
    overlap are one body without a gap. A body that crosses the radius covers sectors up to the crossing. Surfaces cut
    by the picture's border continue beyond it, see `post.sweep.margin`.

    Args:
        depth: ``(B, 1, H, W)`` planar view z, world units.
        normal: ``(B, 3, H, W)`` world space, unit length.
        camera: of the picture.
        hit: ``(B, 1, H, W)`` bool; by default every pixel.
        thickness: ``(B, 1, H, W)`` measured along the view ray, world units; or one assumed for everything; by default
            estimated, see `post.thickness_from_depth`.
        radius: world units; occluders farther away do not count. A 0-dim tensor to get its gradient; None for no limit:
            `post.sweep.open_sky` then estimates how open the uncovered directions are that leave the picture.
        directions: slices, each through the pixel to both sides.
        steps: taps on each side of a slice.
        scales: number of radii, each twice the one before; the result is their mean. All share the taps of one sweep.
        hidden: radii added behind measured backs, for hidden geometry there (see samples/fit_ao.py).
        soft: fractional coverage of edge sectors, differentiable in depth, normal, thickness and radius; by default
            where gradients are wanted. Otherwise edges are dithered.
        index: frame number, for the noise.
        seed: another seed, another noise.
        compiled: whether to use the kernel; by default for float32 on the CPU, where edges are dithered, no gradient is
            wanted and fusion is off.

    Returns:
        ao ``(B, 1, H, W)``, 1 open (also where nothing was hit); bent_normal ``(B, 3, H, W)``, world space, unit
        length, 0 where nothing was hit.

    Raises:
        ValueError: directions, steps, scales or radius are not positive, or a kernel is requested with soft edges, or
                for tensors that it does not take.

    Source: Therrien et al. 2023, "Screen Space Indirect Lighting with Visibility Bitmask".
    """
    slices.check_sweep(camera, directions, steps, radius, scales, depth=depth, normal=normal, hit=hit)
    hit = torch.ones_like(depth, dtype=torch.bool) if hit is None else hit
    depth, hit, normal = held(depth, hit, normal, camera.far)
    reach = None if radius is None else torch.as_tensor(radius, dtype=depth.dtype, device=depth.device)
    radii = () if reach is None else tuple(reach * 2**scale for scale in range(scales))
    thickness = thickness_from_depth(depth, normal, camera, hit=hit) if thickness is None else thickness
    unseen = 0.0 if reach is None else hidden * reach
    solid = planar_thickness(camera, depth, hit, thickness, unseen)
    around = slices.scene(camera, depth, normal, hit, solid)
    at = slices.receivers(camera, depth, normal)
    if soft is None:
        soft = torch.is_grad_enabled() and any(
            t is not None and t.requires_grad for t in (around.picture, at.nx, reach)
        )
    sky = None if radii else sky_beyond(camera, hit, normal)
    noise = blue_noise(*camera.size, index=index, dims=3, seed=seed, device=depth.device).to(depth.dtype)
    sizes: dict[str, Any] = {"directions": directions, "steps": steps, "parallel": camera.orthographic}
    if compiled and soft:
        raise ValueError("soft edges have no compiled form; leave compiled at None or False")
    wish = False if soft else compiled
    if form_of(around.picture, around.origin_x, at.x, at.nx, reach, compiled=wish, fuses=True) is Form.REFERENCE:
        every = _sweep(around, at, noise, radii, sky, **sizes, soft=soft)
    else:
        every = sweep(around, at, hit, noise, radii, sky, **sizes)
    found = [arcs.finish(at, camera, hit, sums, normal) for sums in every]
    return arcs.mean_of_scales(found, hit, normal)


def _sweep(
    around: PaddedView,
    at: Receivers,
    noise: Tensor,
    radii: tuple[Tensor, ...],
    sky: Sky | None,
    *,
    directions: int,
    steps: int,
    parallel: bool,
    soft: bool,
) -> Tensor:
    """``(radii or 1, 8, B, h, w)``: the sums of `arcs.finish`, for each radius."""
    rows = []
    for cut, band in slices.bands(at):
        sums = torch.zeros(max(len(radii), 1), 8, *band.z.shape, dtype=at.z.dtype, device=at.z.device)
        for which in range(directions):
            random = slices.slice_noise(noise[:, cut], which, directions)
            sums = sums + _slice(around, band, *random, radii, sky, steps, parallel, soft)
        rows.append(sums)
    return torch.cat(rows, dim=3)


@fusible
def _slice(
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
    """The contribution of one slice to the sums of `arcs.finish`, for each radius."""
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
    openness: Tensor | float = 1.0
    if sky is not None:
        hits = leaves_hit(around, at, right), leaves_hit(around, at, left)
        openness = open_share(sky, cut, GROUPS, left.whole, hits)
    return torch.stack([slice_sums(cut, sectors, openness) for sectors in covered])


def start(at: Receivers, side: Side, solid: Tensor) -> Front:
    """The receiver itself, as the tap before the first."""
    zero = torch.zeros_like(at.z)
    return Front(side.whole, zero, zero, zero, at.z, at.z + solid)


def own_solid(around: PaddedView, at: Receivers) -> Tensor:
    """Planar depth from front to back at the receivers."""
    return gather(around.picture[:, 1:2], at.column.int(), at.row.int())[:, 0]


def blocked(
    tap: Tap, before: Front, side: Side, radii: tuple[Tensor, ...], soft: bool, same: Tensor | None = None
) -> tuple[list[Cover], Front]:
    """The part that a tap occludes within each radius, from smallest to largest, or without limit if there is none.

    ``same`` is 1 where the tap is known to continue the surface of the one before.
    """
    joined = arcs.step(overlap(tap, before))
    joined = joined if same is None else torch.maximum(joined, same)
    rise, run = tap.front_rise, tap.front_run
    distance = (rise * rise + run * run + 1e-20).sqrt() if radii else joined
    front = arcs.arc_measure(rise, run, side)
    back = arcs.arc_measure(tap.back_rise, tap.back_run, side)
    high = back + (torch.maximum(back, before.share) - back) * joined
    crossed = _front_at_the_radius(tap, before, side, radii, distance) if radii else front
    covers = []
    for radius in radii or (None,):
        near, crossing = torch.ones_like(joined), torch.zeros_like(joined)
        if radius is not None:
            inside = arcs.step(radius - distance)
            was_inside = arcs.step(radius - before.distance) * arcs.step(before.distance)
            crossing = joined * was_inside * (1 - inside)
            faded = ((radius - distance) / (2 * FADE * radius) + 0.5).clamp(0, 1) if soft else inside
            near = torch.maximum(faded, crossing)
        first = front + (crossed - front) * crossing
        low = first + (torch.minimum(first, before.share) - first) * joined
        if same is not None:
            low = (low - (before.share - first).clamp_min(0) * same * (1 - crossing) * EDGE).clamp_min(0)
        covers.append(Cover(low, high, near))
    return covers, Front(front, tap.front_rise, tap.front_run, distance, tap.z, tap.back_z)


def overlap(tap: Tap, before: Front) -> Tensor:
    """Overlap of the depth ranges of two taps, world units: above 0 they are one body."""
    return torch.minimum(tap.back_z, before.back_z) - torch.maximum(tap.z, before.z)


def _front_at_the_radius(tap: Tap, before: Front, side: Side, radii: tuple[Tensor, ...], distance: Tensor) -> Tensor:
    """Share of the side up to where the line from the previous tap crosses the first radius beyond that tap."""
    radius = radii[-1]
    for smaller in reversed(radii[:-1]):
        radius = radius + (smaller - radius) * arcs.step(smaller - before.distance)
    left = (distance - radius) / (distance - before.distance).abs().clamp_min(1e-9)
    rise, run = tap.front_rise, tap.front_run
    return arcs.arc_measure(rise + (before.rise - rise) * left, run + (before.run - run) * left, side)
