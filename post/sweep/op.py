"""Slice sweeps as a torch operator: the kernel on the CPU, the torch reference elsewhere and for gradients."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch import Tensor

from gbufrt.compute.dispatch import Form, form_of
from post.margin.view import PaddedView
from post.sweep import arcs
from post.sweep.constants import GROUPS, LIGHT, STRIDES, SUMS
from post.sweep.layout import Receivers
from post.sweep.open_sky import Sky
from post.sweep.reference import bodies_reference, sweep_reference
from post.sweep.turns import table


@torch.library.custom_op("gbufrt::sweep", mutates_args=())
def sweep_cpu(
    picture: Tensor,
    rays: Tensor,
    planes: Tensor,
    hit: Tensor,
    turns: Tensor,
    noise: Tensor,
    radii: Tensor,
    sky: Tensor,
    terms: Tensor,
    margin: int,
    directions: int,
    steps: int,
    parallel: bool,
    gathers: bool,
) -> Tensor:
    """``(radii or 1, 8, B, h, w)``: the sums of `arcs.finish`; 11 with gathered light.

    Args:
        picture: ``(B, H', W', C)``: that of `slices.PaddedView`, channels last.
        rays: ``(B, 5)``: its origins and pitches, and the aspect of `slices.Receivers`.
        planes: ``(12, B, h, w)``: the other planes of the receivers.
        hit: ``(B, h, w)`` bool.
        turns: see `turns.table`.
        noise: ``(3, h, w)`` in [0, 1).
        radii: ``(R,)``, from the smallest to the largest.
        sky: ``(B, 5)``, see `open_sky.Sky`, or ``(B, 0)``.
        terms: see `arcs.direction_polynomials`.
        margin: of the scene, pixels.
        directions: number of slices.
        steps: taps on each side of a slice.
        parallel: whether the camera is orthographic.
        gathers: whether light is gathered.
    """
    from gbufrt.compute.kernel import array, threads
    from post.sweep.drivers import sweep_all

    (batch, *size), count = hit.shape, SUMS + LIGHT * gathers
    out = planes.new_empty((max(len(radii), 1) * count, batch, size[0] * size[1]), dtype=torch.float32)
    limits = radii if len(radii) else radii.new_tensor([torch.inf])
    flat = planes.flatten(2), hit, turns, noise.flatten(1)
    inputs = [array(t) for t in (out, picture, rays, *flat, limits, sky, terms)]
    inputs[1] = inputs[1].view(np.int64)  # two numbers are read at once
    sweep_all(*inputs, margin, directions, steps, len(radii) > 0, parallel, gathers, threads())
    return out.view(-1, count, batch, *size)


@sweep_cpu.register_fake
def _(picture, rays, planes, hit, turns, noise, radii, sky, terms, margin, directions, steps, parallel, gathers):
    return planes.new_empty((max(len(radii), 1), SUMS + LIGHT * gathers, *planes.shape[1:]))


def sweep(
    around: PaddedView,
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
    soft: bool = False,
    compiled: bool | None = None,
) -> Tensor:
    """``(radii or 1, 8, B, h, w)``: the sums of `arcs.finish`; 11 where light is gathered, its three channels last.

    Where gathered light alone wants a gradient, the numbers are the kernel's and the gradient is the reference's.

    Args:
        around: what taps read.
        at: the receivers.
        hit: ``(B, 1, h, w)`` bool: where False, the kernel sweeps nothing and the sums are those of a black hemisphere.
        noise: ``(3, h, w)`` in [0, 1).
        radii: from the smallest to the largest; none for no limit. At most one where light is gathered.
        sky: beyond the border, or None if all that is not covered is open.
        directions: number of slices.
        steps: taps on each side of a slice.
        parallel: whether the camera is orthographic.
        gathers: whether light is gathered.
        soft: fractional coverage of edge sectors, which has no kernel; otherwise edges are dithered.
        compiled: see `gbufrt.compute.dispatch.form_of`.
    """
    sizes: dict[str, Any] = {"directions": directions, "steps": steps, "parallel": parallel, "gathers": gathers}
    lit = gathers and not soft and torch.is_grad_enabled() and around.picture.requires_grad
    with torch.set_grad_enabled(torch.is_grad_enabled() and not lit):
        form = form_of(around.picture, around.origin_x, at.x, at.nx, *radii, compiled=compiled, fuses=True)
    if form is Form.REFERENCE:
        return sweep_reference(around, at, noise, radii, sky, **sizes, soft=soft)
    with torch.no_grad():
        found = _sweep_cpu(around, at, hit, noise, radii, sky, **sizes)
    if lit:
        sums = sweep_reference(around, at, noise, radii, sky, **sizes, soft=soft)
        return sums + (found - sums).detach()
    return found


def _sweep_cpu(
    around: PaddedView,
    at: Receivers,
    hit: Tensor,
    noise: Tensor,
    radii: tuple[Tensor, ...],
    sky: Sky | None,
    *,
    directions: int,
    steps: int,
    parallel: bool,
    gathers: bool,
) -> Tensor:
    batch, empty = at.z.shape[0], at.z.new_empty(at.z.shape[0], 0)
    rays = (around.origin_x, around.origin_y, around.pitch_x, around.pitch_y, at.aspect)
    return sweep_cpu(
        around.picture.movedim(1, -1),
        torch.cat([t.expand(batch, 1, 1).flatten(1) for t in rays], dim=1),
        torch.stack(at[:-1]),
        hit[:, 0],
        torch.from_numpy(table()),
        noise,
        torch.stack(radii) if radii else at.z.new_empty(0),
        empty if sky is None else torch.cat([t.expand(batch, 1, 1).flatten(1) for t in sky], dim=1),
        torch.tensor(arcs.direction_polynomials(GROUPS), dtype=at.z.dtype),
        around.margin,
        directions,
        steps,
        parallel,
        gathers,
    )


@torch.library.custom_op("gbufrt::bodies", mutates_args=())
def bodies_cpu(depth: Tensor, hit: Tensor, back: Tensor) -> Tensor:
    """See `bodies`."""
    from gbufrt.compute.kernel import array, threads
    from post.sweep.drivers import bodies_rows

    fixed, near = (array(depth[:, 0]), array(hit[:, 0])), back
    for stride in STRIDES:
        far = near.new_empty(near.shape)
        bodies_rows(array(far[:, 0]), *fixed, array(near[:, 0]), stride, threads())
        near = far
    return near


@bodies_cpu.register_fake
def _(depth, hit, back):
    return back.new_empty(back.shape)


def bodies(depth: Tensor, hit: Tensor, back: Tensor, *, compiled: bool | None = None) -> Tensor:
    """Depth of the back of each pixel's body, from all surrounding pixels whose solids overlap with its own.

    Args:
        depth: ``(B, 1, H, W)`` planar view z of fronts, world units.
        hit: ``(B, 1, H, W)`` bool.
        back: as ``depth``, of backs.
        compiled: see `gbufrt.compute.dispatch.form_of`.

    Returns:
        As ``back``.
    """
    if form_of(depth, back, compiled=compiled) is Form.REFERENCE:
        return bodies_reference(depth, hit, back)
    return bodies_cpu(depth, hit, back)
