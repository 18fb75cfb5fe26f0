"""Ambient occlusion with bent normals: horizons (GTAO) or visibility bitmasks, at one or several scales."""

from __future__ import annotations

import math
from functools import partial
from typing import Any, Literal

import torch
from torch import Tensor

from gbufrt import Frame, Pass
from gbufrt.camera import Camera
from gbufrt.compute.resident import number
from gbufrt.demands.pictures import check_pictures
from gbufrt.mending import held
from gbufrt.noise.noise import blue_noise
from gbufrt.numeric import check_between, check_counts
from post.margin.op import scene
from post.margin.view import PaddedView
from post.passes.light.fresh import by_history, times
from post.sweep import arcs, slices
from post.sweep.arcs import Side
from post.sweep.bitmask import bitmask_ao
from post.sweep.chords import known_thickness
from post.sweep.layout import Receivers, Receiving, Slice

FALLOFF = 0.615  # share of the reach over which occluders fade (XeGTAO)
REACH = 1.457  # radii: fading occluders up to here occlude about as much as all within the radius (XeGTAO)


def gtao(
    depth: Tensor,
    normal: Tensor,
    camera: Camera,
    *,
    hit: Tensor | None = None,
    thickness: Tensor | float | None = None,
    radius: float | Tensor = 0.5,
    directions: int = 4,
    steps: int = 12,
    scales: int = 1,
    method: Literal["bitmask", "horizon"] = "bitmask",
    hidden: float = 0.15,
    index: int | Tensor = 0,
    seed: int = 0,
) -> tuple[Tensor, Tensor]:
    """Ambient visibility and the mean open direction.

    Several scales average the visibility at radius, 2 radius, 4 radius..., and their open directions: near occluders
    count in every scale, far ones in the wide scales alone.

    Args:
        depth: ``(B, 1, H, W)`` planar view z, world units.
        normal: ``(B, 3, H, W)`` world space, unit length.
        camera: of the picture.
        hit: ``(B, 1, H, W)`` bool; by default every pixel.
        thickness: for the bitmask: ``(B, 1, H, W)`` measured along the view ray, world units, or one assumed for
            everything; by default guessed, see `post.thickness_from_depth`. Horizons take everything to be
            infinitely thick.
        radius: world units; a 0-dim tensor to get its gradient. Of a bitmask that is torch code, which takes over a
            hundred times as long as the kernel; without ``requires_grad``, or under ``torch.no_grad``, it is as fast as
            a number.
        directions: slices through each pixel.
        steps: taps on each side of a slice.
        scales: how many radii, at most 16.
        method: ``bitmask`` (see `post.bitmask_ao`) or ``horizon`` (Jimenez et al. 2016).
        hidden: for the bitmask: radii added behind measured backs, see `post.bitmask_ao`.
        index: frame number, for the noise.
        seed: another seed, another noise.

    Returns:
        ao ``(B, 1, H, W)``, 1 open (also where nothing was hit); bent_normal ``(B, 3, H, W)``, world space, unit
        length, 0 where nothing was hit.

    Raises:
        TypeError: what must be a tensor or a number is none, or kinds of floats are mixed.
        ValueError: directions, steps, scales or radius are not positive, thickness or hidden is negative, scales too
            many, a picture is of another size, or there is no such method.

    Source: Therrien et al. 2023 for ``bitmask``; Jimenez et al. 2016 for ``horizon``.
    """
    if method not in ("bitmask", "horizon"):
        raise ValueError(f"method must be 'bitmask' or 'horizon', got {method!r}")
    sweep: dict[str, Any] = {"hit": hit, "radius": radius, "directions": directions, "steps": steps}
    sweep |= {"scales": scales, "index": index, "seed": seed}
    check_between(0, math.inf, hidden=hidden)
    if method == "horizon":
        check_pictures(camera, thickness=thickness)  # it needs none, but takes one that the bitmask takes too
        return horizon_ao(depth, normal, camera, **sweep)
    return bitmask_ao(depth, normal, camera, thickness=thickness, hidden=hidden, **sweep)


def horizon_ao(
    depth: Tensor,
    normal: Tensor,
    camera: Camera,
    *,
    hit: Tensor | None = None,
    radius: float | Tensor = 0.5,
    directions: int = 4,
    steps: int = 12,
    scales: int = 1,
    index: int | Tensor = 0,
    seed: int = 0,
) -> tuple[Tensor, Tensor]:
    """Ambient visibility above the horizons of each slice, and the mean open direction.

    The horizon of each side is the highest tap; taps fade toward the hemisphere's own horizon about the
    radius: they begin to count at 1.46 radii and count in full within 0.56.
    Arguments, results and errors as `gtao`.

    Source: Jimenez et al. 2016, "Practical Real-Time Strategies for Accurate Indirect Occlusion"; XeGTAO.
    """
    slices.check_sweep(camera, directions, steps, radius, scales, depth=depth, normal=normal, hit=hit)
    check_counts(seed=seed)
    hit = torch.ones_like(depth, dtype=torch.bool) if hit is None else hit
    depth, hit, normal = held(depth, hit, normal, camera.far)
    reach = number(radius, depth) * REACH
    around = scene(camera, depth, normal, hit, torch.ones_like(depth))
    pixels = Receiving(camera, depth, normal, hit)
    at = slices.receivers(pixels)
    found, how = [], (directions, steps, camera.orthographic)
    for scale in range(scales):
        places = {"index": index, "dims": 3, "seed": seed * scales + scale, "device": depth.device}
        sums = _sweep(around, at, blue_noise(*camera.size, **places).to(depth), reach * 2**scale, *how)
        found.append(arcs.finish(at, pixels, sums))
    return arcs.mean_of_scales(found, hit, normal)


def _sweep(
    around: PaddedView, at: Receivers, noise: Tensor, reach: Tensor, directions: int, steps: int, parallel: bool
) -> Tensor:
    """``(8, B, h, w)``: the sums of `arcs.finish`."""
    rows = []
    for cut, band in slices.bands(at):
        sums = torch.zeros(8, *band.z.shape, dtype=band.z.dtype, device=band.z.device)
        for which in range(directions):
            cos_psi, sin_psi, jitter, _ = slices.slice_noise(band, noise[:, cut], which, directions)
            sums = sums + _slice(around, band, cos_psi, sin_psi, jitter, reach, steps, parallel)
        rows.append(sums)
    return torch.cat(rows, dim=2)


def _slice(
    around: PaddedView,
    at: Receivers,
    cos_psi: Tensor,
    sin_psi: Tensor,
    jitter: Tensor,
    radius: Tensor,
    steps: int,
    parallel: bool,
) -> Tensor:
    """What one slice adds to the sums of `arcs.finish`."""
    cut = slices.cut_slice(at, cos_psi, sin_psi)
    total = torch.zeros(8, *at.z.shape, dtype=at.z.dtype, device=at.z.device)
    for side in arcs.sides(around, at, cut):
        reach_px = torch.minimum(radius * side.length, side.border).detach()
        lowest = -side.cut.sin_n  # cosine of the hemisphere's own horizon, n + pi/2 from the eye
        highest = lowest
        for i in range(steps):
            tap = arcs.look(around, at, side, slices.tap_pixels(reach_px, i, jitter, steps, slices.WITHIN), parallel)
            distance = (tap.front_rise * tap.front_rise + tap.front_run * tap.front_run + 1e-20).sqrt()
            cosine = (tap.front_rise * side.cut.cos_n - tap.front_run * side.cut.sin_n) / distance
            weight = ((radius - distance) / (FALLOFF * radius)).clamp(0, 1) * (tap.back_z - tap.z)
            weight = weight * arcs.step(tap.front_rise)
            highest = torch.maximum(highest, lowest + (cosine - lowest) * weight)
        total = total + _arc_sums(side, cut, highest)
    return total


def _arc_sums(side: Side, cut: Slice, highest: Tensor) -> Tensor:
    """One side's part of the sums of `arcs.finish`, open from the eye's direction down to a horizon."""
    limit = 1 - 1e-6
    end = side.cut.n + math.pi / 2
    theta = torch.minimum(highest.clamp(-limit, limit).acos(), end)
    rise, run = _arc_direction(side, theta)
    whole_rise, whole_run = _arc_direction(side, end)
    opened = (theta.sin() * (theta - side.cut.n).sin() + theta * side.cut.sin_n) * side.half
    opened = torch.where(highest > -side.cut.sin_n, opened, side.whole)
    lift, slide = torch.stack([cut.hx, cut.hy, cut.hz]), torch.stack([side.cut.tx, side.cut.ty, side.cut.tz])
    norm = cut.weight * side.half * 2
    return torch.cat(
        [
            torch.stack([side.whole * cut.weight, opened * cut.weight]),
            (rise * lift + run * slide) * norm,
            (whole_rise * lift + whole_run * slide) * norm,
        ]
    )


def _arc_direction(side: Side, theta: Tensor) -> tuple[Tensor, Tensor]:
    """Integral of cos(t - n) sin(t) times the direction at t, for t from 0 to theta.

    Given along the projected normal and across it.
    """
    n, cos_n, sin_n = side.cut.n, side.cut.cos_n, side.cut.sin_n
    toward = -((3 * theta - n).cos() / 3 + (theta - n).cos()) / 2 + sin_n * theta.sin() + cos_n * (2 / 3)
    across = ((theta - n).sin() - (3 * theta - n).sin() / 3) / 2 - sin_n * theta.cos() + sin_n * (4 / 3)
    return (toward * cos_n + across * sin_n) / 2, (across * cos_n - toward * sin_n) / 2


class GTAO(Pass):
    """Ambient occlusion and bent normals. See `gtao`.

    A ``thickness`` channel takes precedence over the tunable, and the tunable over a guess. A frame with none before it
    is swept with ``fresh`` times as many directions.

    Args:
        fresh: factor on directions in a frame with none before it.
        radius: see `gtao`, as the rest.
    """

    reads = frozenset({"depth", "hit", "normal"})
    optional = frozenset({"thickness", "object_id"})
    writes = frozenset({"ao", "bent_normal"})

    def __init__(
        self,
        *,
        radius: float = 0.5,
        directions: int = 4,
        fresh: int = 1,
        steps: int = 12,
        scales: int = 1,
        method: Literal["bitmask", "horizon"] = "bitmask",
        hidden: float = 0.15,
        thickness: float | None = None,
        seed: int = 0,
    ) -> None:
        super().__init__()
        self.radius, self.directions, self.fresh, self.steps, self.scales = radius, directions, fresh, steps, scales
        self.method, self.hidden, self.thickness, self.seed = method, hidden, thickness, seed

    def forward(self, frame: Frame) -> Frame:
        g = frame.gbuffer
        solid = self.thickness if self.method == "horizon" else known_thickness(g, thickness=self.thickness)
        tunables = {**self.tunables(), "thickness": solid}
        directions, fresh = tunables.pop("directions"), tunables.pop("fresh")
        sweep = partial(gtao, g.depth, g.normal, g.camera, hit=g.hit, index=frame.index, **tunables)
        ao, bent_normal = by_history(
            frame, lambda count: sweep(directions=count), first=times(directions, fresh), later=directions
        )
        return frame.replace(ao=ao, bent_normal=bent_normal)
