"""The compiled sweeps as a CPU operator: what `post.sweep.bitmask` and `post.ssgi` run where no gradient is wanted."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numba import prange
from torch import Tensor

from gbufrt.compute import kernel
from post.sweep import arcs as horizon
from post.sweep import sectors, slices, sweep_kernel
from post.sweep.open_sky import Sky
from post.sweep.slice_kernel import Around
from post.sweep.slices import Receivers, Scene
from post.sweep.sweep_kernel import Scratch

SUMS, LIGHT = 8, 3  # of `horizon.finish`; channels of light that follow


@kernel.scalar
def _receiver(planes, aspect, b, y, x):
    one = planes[:, b, y, x]
    return Receivers(
        one[0], one[1], one[2], one[3], one[4], one[5], one[6], one[7], one[8], one[9], one[10], one[11], aspect
    )


@kernel.scalar
def _dice(random, which, y, x):
    """See `slices.slice_noise`."""
    return random[which, y, x, 0], random[which, y, x, 1], random[which, y, x, 2], random[which, y, x, 3]


@kernel.scalar
def _scratch(radii, groups, steps):
    """What one thread works in."""
    covered, light = np.empty(max(radii.shape[0], 1), np.int32), np.empty(LIGHT, np.float32)
    return Scratch(covered, light, np.empty((groups, 3), np.float32), np.empty(steps, np.float32))


@kernel.scalar
def _start(sums, hit):
    """Zero; where nothing was hit, a weight by which what comes after can divide."""
    sums[:] = 0
    sums[:, 0] = not hit


def _compiled(sources: int) -> Any:
    """The driver, compiled anew when ``sources`` change; see `gbufrt.compute.kernel`."""

    @kernel.driver
    def sweep_all(
        out, picture, rays, planes, hit, random, radii, sky, terms, margin, steps, parallel, gathers, threads
    ):
        _, batch, height, width = planes.shape
        for thread in prange(threads):
            sums, scratch = np.empty(out.shape[:2], np.float32), _scratch(radii, terms.shape[1] // 2, steps)
            for row in range(thread, batch * height, threads):
                b, y = row // height, row % height
                around = Around(picture[b], rays[b], radii, sky[b], terms, margin, parallel)
                for x in range(width):
                    _start(sums, hit[b, y, x])
                    if hit[b, y, x]:
                        at = _receiver(planes, rays[b, 4], b, y, x)
                        for which in range(random.shape[0]):
                            dice = _dice(random, which, y, x)
                            if gathers:
                                sweep_kernel.gather(sums, scratch, around, at, dice)
                            else:
                                sweep_kernel.occlude(sums, scratch, around, at, dice)
                    out[:, :, b, y, x] = sums
        return sources

    return sweep_all


_sweep_all = _compiled(sweep_kernel.SOURCES)


@torch.library.custom_op("gbufrt::sweep", mutates_args=())
def sweep_cpu(
    picture: Tensor,
    rays: Tensor,
    planes: Tensor,
    hit: Tensor,
    random: Tensor,
    radii: Tensor,
    sky: Tensor,
    terms: Tensor,
    margin: int,
    steps: int,
    parallel: bool,
    gathers: bool,
) -> Tensor:
    """``(radii or 1, 8, B, h, w)``: the sums of `horizon.finish`; 11 with the light, where that is gathered.

    Args:
        picture: ``(B, H', W', C)``: that of `slices.Scene`, channels last.
        rays: ``(B, 5)``: its origins and pitches, and the aspect of `slices.Receivers`.
        planes: ``(12, B, h, w)``: the other planes of the receivers.
        hit: ``(B, h, w)`` bool.
        random: ``(directions, h, w, 4)``: see `slices.slice_noise`.
        radii: ``(R,)``, from the smallest to the largest.
        sky: ``(B, 5)``, see `open_sky.Sky`, or ``(B, 0)``.
        terms: see `horizon.direction_polynomials`.
        margin: of the scene, pixels.
        steps: taps on each side of a slice.
        parallel: whether the camera is orthographic.
        gathers: whether light is gathered.
    """
    out = np.empty((max(len(radii), 1), SUMS + LIGHT * gathers, *planes.shape[1:]), dtype=np.float32)
    inputs = [kernel.array(t) for t in (picture, rays, planes, hit, random, radii, sky, terms)]
    _sweep_all(out, *inputs, margin, steps, parallel, gathers, kernel.threads())
    return torch.from_numpy(out)


@sweep_cpu.register_fake
def _(picture, rays, planes, hit, random, radii, sky, terms, margin, steps, parallel, gathers):
    return planes.new_empty((max(len(radii), 1), SUMS + LIGHT * gathers, *planes.shape[1:]))


def sweep(
    around: Scene,
    at: Receivers,
    hit: Tensor,
    noise: Tensor,
    radii: tuple[Tensor, ...],
    sky: Sky | None,
    *,
    directions: int,
    steps: int,
    parallel: bool,
    gathers: bool = False,
) -> Tensor:
    """What `post.sweep.bitmask` and, where light is gathered, `post.ssgi` sum over their slices; see `sweep_cpu`.

    Args:
        around: what taps read.
        at: the pixels that look around them.
        hit: ``(B, 1, h, w)`` bool: where False, nothing is swept and the sums are those of a black hemisphere.
        noise: ``(3, h, w)`` in [0, 1).
        radii: from the smallest to the largest; none for no limit.
        sky: beyond the border, or None where what is not covered is open.
        directions: number of slices.
        steps: taps on each side of a slice.
        parallel: whether the camera is orthographic.
        gathers: whether light is gathered.
    """
    batch, empty = at.z.shape[0], at.z.new_empty(at.z.shape[0], 0)
    rays = (around.origin_x, around.origin_y, around.pitch_x, around.pitch_y, at.aspect)
    dice = [torch.stack(slices.slice_noise(noise, which, directions), dim=-1) for which in range(directions)]
    return sweep_cpu(
        around.picture.movedim(1, -1),
        torch.cat([t.expand(batch, 1, 1).flatten(1) for t in rays], dim=1),
        torch.stack(at[:-1]),
        hit[:, 0],
        torch.stack(dice),
        torch.stack(radii) if radii else at.z.new_empty(0),
        empty if sky is None else torch.cat([t.expand(batch, 1, 1).flatten(1) for t in sky], dim=1),
        torch.tensor(horizon.direction_polynomials(sectors.GROUPS), dtype=at.z.dtype),
        around.margin,
        steps,
        parallel,
        gathers,
    )
