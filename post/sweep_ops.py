"""The compiled sweeps as CPU operators: what `post.bitmask` and `post.ssgi` run where no gradient is wanted."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numba import prange
from torch import Tensor

from gbufrt import kernel
from post import horizon, sectors, slices, sweep_kernel
from post.open_sky import Sky
from post.slices import Receivers, Scene

SUMS = 8  # of `horizon.finish`


@kernel.scalar
def _receiver(planes, b, y, x, aspect):
    return Receivers(
        planes[0, b, y, x],
        planes[1, b, y, x],
        planes[2, b, y, x],
        planes[3, b, y, x],
        planes[4, b, y, x],
        planes[5, b, y, x],
        planes[6, b, y, x],
        planes[7, b, y, x],
        planes[8, b, y, x],
        planes[9, b, y, x],
        planes[10, b, y, x],
        planes[11, b, y, x],
        aspect,
    )


def _compiled(sources: int) -> tuple[Any, ...]:
    """The drivers, compiled anew when ``sources`` change; see `gbufrt.kernel`."""

    @kernel.driver
    def occlude_all(out, picture, rays, planes, hit, random, radii, sky, terms, margin, steps, parallel, threads):
        _, batch, height, width = planes.shape
        for thread in prange(threads):
            sums, groups = np.empty(out.shape[:2], np.float32), np.empty((terms.shape[1] // 2, 3), np.float32)
            covered, spread = np.empty(out.shape[0], np.int32), np.empty(steps, np.float32)
            for row in range(thread, batch * height, threads):
                b, y = row // height, row % height
                seen, ray, beyond = picture[b], rays[b], sky[b]
                for x in range(width):
                    sums[:] = 0
                    sums[:, 0] = not hit[b, y, x]
                    if hit[b, y, x]:
                        at = _receiver(planes, b, y, x, ray[4])
                        for which in range(random.shape[0]):
                            dice = random[which, y, x, 0], random[which, y, x, 1], random[which, y, x, 2], random[which, y, x, 3]
                            sweep_kernel.occlude(
                                sums, covered, groups, spread, seen, ray, at, dice, radii, beyond, terms, margin, parallel
                            )
                    out[:, :, b, y, x] = sums
        return sources

    @kernel.driver
    def gather_all(out, picture, rays, planes, hit, random, radii, sky, terms, margin, steps, parallel, threads):
        _, batch, height, width = planes.shape
        for thread in prange(threads):
            sums, groups = np.empty(out.shape[0], np.float32), np.empty((terms.shape[1] // 2, 3), np.float32)
            light, spread = np.empty(3, np.float32), np.empty(steps, np.float32)
            for row in range(thread, batch * height, threads):
                b, y = row // height, row % height
                seen, ray, beyond = picture[b], rays[b], sky[b]
                for x in range(width):
                    sums[:] = 0
                    sums[0] = not hit[b, y, x]
                    if hit[b, y, x]:
                        at = _receiver(planes, b, y, x, ray[4])
                        for which in range(random.shape[0]):
                            dice = random[which, y, x, 0], random[which, y, x, 1], random[which, y, x, 2], random[which, y, x, 3]
                            sweep_kernel.gather(
                                sums, light, groups, spread, seen, ray, at, dice, radii, beyond, terms, margin, parallel
                            )
                    out[:, b, y, x] = sums
        return sources

    return occlude_all, gather_all


_occlude_all, _gather_all = _compiled(sweep_kernel.SOURCES)


@torch.library.custom_op("gbufrt::occlude", mutates_args=())
def occlude_cpu(
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
) -> Tensor:
    """``(radii or 1, 8, B, h, w)``: the sums of `horizon.finish`. Inputs as `laid_out` gives them."""
    out = np.empty((max(len(radii), 1), SUMS, *planes.shape[1:]), dtype=np.float32)
    inputs = [kernel.array(t) for t in (picture, rays, planes, hit, random, radii, sky, terms)]
    _occlude_all(out, *inputs, margin, steps, parallel, kernel.threads())
    return torch.from_numpy(out)


@occlude_cpu.register_fake
def _(picture, rays, planes, hit, random, radii, sky, terms, margin, steps, parallel):
    return planes.new_empty((max(len(radii), 1), SUMS, *planes.shape[1:]))


@torch.library.custom_op("gbufrt::gather_light", mutates_args=())
def gather_light_cpu(
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
) -> Tensor:
    """``(11, B, h, w)``: the sums of `horizon.finish`, and the light. Inputs as `laid_out` gives them."""
    out = np.empty((SUMS + 3, *planes.shape[1:]), dtype=np.float32)
    inputs = [kernel.array(t) for t in (picture, rays, planes, hit, random, radii, sky, terms)]
    _gather_all(out, *inputs, margin, steps, parallel, kernel.threads())
    return torch.from_numpy(out)


@gather_light_cpu.register_fake
def _(picture, rays, planes, hit, random, radii, sky, terms, margin, steps, parallel):
    return planes.new_empty((SUMS + 3, *planes.shape[1:]))


def laid_out(
    around: Scene,
    at: Receivers,
    hit: Tensor,
    noise: Tensor,
    radii: tuple[Tensor, ...],
    sky: Sky | None,
    directions: int,
) -> tuple[Tensor, ...]:
    """What the operators read, as arrays.

    Args:
        around: what taps read.
        at: the pixels that look around them.
        hit: ``(B, 1, h, w)`` bool: where False, the sums are those of one slice that sees nothing at all.
        noise: ``(3, h, w)`` in [0, 1).
        radii: from the smallest to the largest; none for no limit.
        sky: beyond the border, or None where what is not covered is open.
        directions: number of slices.

    Returns:
        picture ``(B, H', W', C)``, rays ``(B, 5)``, planes ``(12, B, h, w)``, hit ``(B, h, w)``, random
        ``(directions, h, w, 4)``, radii ``(R,)``, sky ``(B, 5)`` or ``(B, 0)``, terms of the mean directions.
    """
    batch = at.z.shape[0]
    rays = (around.origin_x, around.origin_y, around.pitch_x, around.pitch_y, at.aspect)
    dice = [torch.stack(slices.slice_noise(noise, which, directions), dim=-1) for which in range(directions)]
    return (
        around.picture.movedim(1, -1),
        torch.cat([t.expand(batch, 1, 1).flatten(1) for t in rays], dim=1),
        torch.stack(at[:-1]),
        hit[:, 0],
        torch.stack(dice),
        torch.stack(radii) if radii else at.z.new_empty(0),
        at.z.new_empty(batch, 0) if sky is None else torch.cat([t.expand(batch, 1, 1).flatten(1) for t in sky], dim=1),
        torch.tensor(horizon.direction_polynomials(sectors.GROUPS), dtype=at.z.dtype),
    )
