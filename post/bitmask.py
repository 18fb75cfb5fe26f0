"""Ambient occlusion by visibility bitmasks: each slice's arc is cut into sectors that taps cover one by one."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from gbufrt.camera import Camera
from gbufrt.fusion import fusible
from gbufrt.noise import blue_noise
from gbufrt.sampling import gather
from post import horizon, slices
from post.horizon import Side, Tap
from post.slices import Receivers, Scene, Slice

SECTORS = 30  # of equal cosine-weighted measure; fits a signed 32-bit mask
GROUPS = 6  # of sectors, one mean direction each
PER_GROUP = SECTORS // GROUPS
FIRST_BITS = sum(1 << (PER_GROUP * g) for g in range(GROUPS))
EDGE = 0.3  # of the rise since the tap before: how far a surface goes on, on average, past the last tap to meet it
FADE = 0.1  # of the radius, to either side, over which detached occluders fade
THICKNESS = 1.0  # assumed, in radii (in world units without a radius), where there is neither measurement nor guess


class Front(NamedTuple):
    """The tap before, on the same side of a slice. Planes ``(B, h, w)``."""

    share: Tensor
    rise: Tensor
    run: Tensor
    distance: Tensor
    inside: Tensor
    """1 within the radius (and not the receiver itself), else 0."""
    z: Tensor
    back_z: Tensor


def bitmask_ao(
    depth: Tensor,
    normal: Tensor,
    camera: Camera,
    *,
    hit: Tensor | None = None,
    thickness: Tensor | float | None = None,
    radius: float | Tensor | None = 0.5,
    directions: int = 4,
    steps: int = 6,
    soft: bool | None = None,
    index: int = 0,
    seed: int = 0,
) -> tuple[Tensor, Tensor]:
    """Ambient visibility within a radius, and the mean open direction.

    Every tap covers the sectors from the front to the back of what it sees. Taps in a row whose depth ranges overlap
    are one body and leave no gap between them; a body that crosses the radius covers up to where it crosses.

    Args:
        depth: ``(B, 1, H, W)`` planar view z, world units.
        normal: ``(B, 3, H, W)`` world space, unit length.
        camera: of the picture.
        hit: ``(B, 1, H, W)`` bool; by default every pixel.
        thickness: ``(B, 1, H, W)`` measured along the view ray, world units; or one assumed for everything; by default
            the radius.
        radius: world units; occluders farther away do not count. A 0-dim tensor to get its gradient; None for no limit.
        directions: slices, each through the pixel to both sides.
        steps: taps on each side of a slice.
        soft: fractional coverage of edge sectors, which has gradients in depth, normal, thickness and radius; by
            default where gradients are wanted. Otherwise edges are dithered.
        index: frame number, for the noise.
        seed: another seed, another noise.

    Returns:
        ao ``(B, 1, H, W)``, 1 open (also where nothing was hit); bent_normal ``(B, 3, H, W)``, world space, unit
        length, 0 where nothing was hit.

    Raises:
        ValueError: directions, steps or radius are not positive.

    Source: Therrien et al. 2023, "Screen Space Indirect Lighting with Visibility Bitmask".
    """
    slices.check_sweep(camera, directions, steps, radius, depth=depth, normal=normal, hit=hit)
    hit = torch.ones_like(depth, dtype=torch.bool) if hit is None else hit
    reach = None if radius is None else torch.as_tensor(radius, dtype=depth.dtype, device=depth.device)
    if thickness is None:
        thickness = THICKNESS if reach is None else THICKNESS * reach
    around = slices.scene(camera, depth, hit, slices.planar_thickness(camera, depth, thickness))
    at = slices.receivers(camera, depth, normal)
    if soft is None:
        soft = torch.is_grad_enabled() and any(
            t is not None and t.requires_grad for t in (around.picture, at.nx, reach)
        )
    noise = blue_noise(*camera.size, index=index, dims=3, seed=seed, device=depth.device).to(depth.dtype)
    rows = []
    for cut, band in slices.bands(at):
        sums = torch.zeros(8, *band.z.shape, dtype=depth.dtype, device=depth.device)
        for which in range(directions):
            random = slices.slice_noise(noise[:, cut], which, directions)
            sums = sums + _slice(around, band, *random, reach, steps, camera.orthographic, soft)
        rows.append(sums)
    return horizon.finish(at, camera, hit, torch.cat(rows, dim=2), normal)


@fusible
def _slice(
    around: Scene,
    at: Receivers,
    cos_psi: Tensor,
    sin_psi: Tensor,
    jitter: Tensor,
    dither: Tensor,
    radius: Tensor | None,
    steps: int,
    parallel: bool,
    soft: bool,
) -> Tensor:
    """What one slice adds to the sums of `horizon.finish`."""
    cut = slices.cut_slice(at, cos_psi, sin_psi)
    size = (around.picture.shape[-2] - 2, around.picture.shape[-1] - 2)
    covered = no_cover(at.z, soft)
    own = own_solid(around, at)
    right, left = horizon.sides(at, cut, size)
    for side in (right, left):
        reach_px = side.border if radius is None else torch.minimum(radius * side.length, side.border)
        before = start(at, side, own)
        for i in range(steps):
            px = 1.0 + reach_px.detach() * ((i + jitter) / steps)
            tap = horizon.look(around, at, side, px, parallel)
            front, back, near, *state = blocked(tap, before, side, radius, soft)
            before = Front(*state)
            low, high = (
                (left.whole + front, left.whole + back) if side is right else (left.whole - back, left.whole - front)
            )
            covered, _ = cover(covered, low, high, near, dither)
    return slice_sums(cut, covered)


def start(at: Receivers, side: Side, solid: Tensor) -> Front:
    """The receiver itself, as what comes before the first tap."""
    zero = torch.zeros_like(at.z)
    return Front(side.whole, zero, zero, zero, zero, at.z, at.z + solid)


def own_solid(around: Scene, at: Receivers) -> Tensor:
    """Planar depth from front to back at the receivers."""
    return gather(around.picture[:, 1:2], at.column.int() + 1, at.row.int() + 1)[:, 0]


def blocked(
    tap: Tap, before: Front, side: Side, radius: Tensor | None, soft: bool, same: Tensor | None = None
) -> tuple[Tensor, ...]:
    """Shares of the side between which a tap blocks, how far it counts (0 to 1), and what `Front` holds of it.

    ``same`` is 1 where the tap is known to continue the surface of the one before.
    """
    overlap = torch.minimum(tap.back_z, before.back_z) - torch.maximum(tap.z, before.z)
    joined = horizon.step(overlap) if same is None else torch.maximum(horizon.step(overlap), same)
    rise, run = tap.front_rise, tap.front_run
    near, distance, inside, crossing = torch.ones_like(joined), joined, joined, torch.zeros_like(joined)
    if radius is not None:
        distance = (rise * rise + run * run + 1e-20).sqrt()
        inside = horizon.step(radius - distance)
        crossing = joined * before.inside * (1 - inside)
        left = (distance - radius) / (distance - before.distance).clamp_min(1e-9) * crossing
        rise, run = rise + (before.rise - rise) * left, run + (before.run - run) * left
        faded = ((radius - distance) / (2 * FADE * radius) + 0.5).clamp(0, 1) if soft else inside
        near = torch.maximum(faded, crossing)
    front = horizon.arc_measure(rise, run, side)
    back = horizon.arc_measure(tap.back_rise, tap.back_run, side)
    low = front + (torch.minimum(front, before.share) - front) * joined
    if same is not None:
        low = (low - (before.share - front).clamp_min(0) * same * (1 - crossing) * EDGE).clamp_min(0)
    high = back + (torch.maximum(back, before.share) - back) * joined
    return low, high, near, front, tap.front_rise, tap.front_run, distance, inside, tap.z, tap.back_z


def no_cover(like: Tensor, soft: bool) -> Tensor:
    """Sectors none of which is covered: a mask ``(B, h, w)``, or fractions ``(SECTORS, B, h, w)`` when soft."""
    if soft:
        return like.new_zeros(SECTORS, *like.shape)
    return torch.zeros_like(like, dtype=torch.int32)


def cover(covered: Tensor, low: Tensor, high: Tensor, near: Tensor, dither: Tensor) -> tuple[Tensor, Tensor]:
    """Cover the sectors between two shares of the arc; also returns what is new in the cover."""
    if covered.dtype == torch.int32:
        first = (low * SECTORS + dither).int()
        last = torch.maximum((high * SECTORS + dither).int(), first)
        one = torch.ones_like(covered)
        bits = ((one << last) - (one << first)) * near.int()
        return covered | bits, bits & ~covered
    edge = torch.arange(SECTORS, dtype=low.dtype, device=low.device).view(-1, 1, 1, 1)
    part = ((high * SECTORS - edge).clamp(0, 1) - (low * SECTORS - edge).clamp(0, 1)).clamp_min(0) * near
    after = torch.maximum(covered, part)
    return after, after - covered


def group_shares(sectors: Tensor) -> Tensor:
    """``(GROUPS, B, h, w)``: share of each group's sectors that is set."""
    if sectors.dtype == torch.int32:
        counts = sum(((sectors >> bit) & FIRST_BITS for bit in range(1, PER_GROUP)), sectors & FIRST_BITS)
        field = (1 << PER_GROUP) - 1
        counts = torch.stack([(counts >> (PER_GROUP * g)) & field for g in range(GROUPS)])
        return counts.to(torch.get_default_dtype()) / PER_GROUP
    return sectors.unflatten(0, (GROUPS, PER_GROUP)).mean(1)


def share(sectors: Tensor) -> Tensor:
    """``(B, h, w)``: share of all sectors that is set."""
    if sectors.dtype != torch.int32:
        return sectors.mean(0)
    counts = sum(((sectors >> bit) & FIRST_BITS for bit in range(1, PER_GROUP)), sectors & FIRST_BITS)
    field = (1 << PER_GROUP) - 1
    halves = counts + (counts >> (SECTORS // 2))  # sums of up to 10 still fit a field
    total = (halves & field) + ((halves >> PER_GROUP) & field) + ((halves >> (2 * PER_GROUP)) & field)
    return total.to(torch.get_default_dtype()) / SECTORS


def slice_sums(cut: Slice, covered: Tensor) -> Tensor:
    """One slice's part of the sums of `horizon.finish`."""
    open_groups = 1 - group_shares(covered).to(cut.n.dtype)
    rise, run = horizon.mean_directions(cut.sin_n, GROUPS)
    rises = torch.stack([(open_groups * rise).mean(0), rise.mean(0)]) * cut.weight
    runs = torch.stack([(open_groups * run).mean(0), run.mean(0)]) * cut.weight
    lift, slide = torch.stack([cut.hx, cut.hy, cut.hz]), torch.stack([cut.tx, cut.ty, cut.tz])
    return torch.cat(
        [
            torch.stack([cut.weight, open_groups.mean(0) * cut.weight]),
            rises[0] * lift + runs[0] * slide,
            rises[1] * lift + runs[1] * slide,
        ]
    )
