"""Slice sweeps as a torch operator: kernels on the CPU and on CUDA, the torch reference elsewhere and for gradients."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from gbufrt.compute.dispatch import Form, form_of
from gbufrt.compute.operators import operator
from gbufrt.compute.resident import resident
from post.margin.view import PaddedView
from post.sweep import arcs
from post.sweep.constants import FOUND, GROUPS, LIGHT, MOST_RADII, MOST_STEPS, STRIDES, SUMS
from post.sweep.layout import Receiving
from post.sweep.open_sky import Sky
from post.sweep.reference import sweep_reference
from post.sweep.slices import receivers
from post.sweep.turns import table


@operator("gbufrt::sweep")
def sweep_cpu(
    picture: Tensor,
    rays: Tensor,
    depth: Tensor,
    normal: Tensor,
    lens: Tensor,
    pose: Tensor,
    hit: Tensor,
    turns: Tensor,
    noise: Tensor,
    radii: Tensor,
    sky: Tensor,
    terms: Tensor,
    margin: int,
    stride: int,
    offset: list[int],
    directions: int,
    steps: int,
    parallel: bool,
    gathers: bool,
) -> Tensor:
    """``(radii or 1, 4, B, h, w)``: visibility and bent normals; 7 with gathered light.

    Args:
        picture: ``(B, H', W', C)``: that of `slices.PaddedView`, channels last.
        rays: ``(B, 5)``: its origins and pitches, and the aspect of `slices.Receivers`.
        depth: ``(B, H, W)``.
        normal: ``(B, 3, H, W)`` world space.
        lens: ``(B, 6)``, see `Camera.lens`.
        pose: ``(B, 3, 3)``: rotation to view space.
        hit: ``(B, h, w)`` bool.
        turns: see `turns.table`.
        noise: ``(3, h, w)`` in [0, 1).
        radii: ``(R,)``, from the smallest to the largest.
        sky: ``(B, 5)``, see `open_sky.Sky`, or ``(B, 0)``.
        terms: see `arcs.direction_polynomials`.
        margin: of the scene, pixels.
        stride: of `Receiving`, as ``offset``.
        offset: first row and column.
        directions: number of slices.
        steps: taps on each side of a slice.
        parallel: whether the camera is orthographic.
        gathers: whether light is gathered.
    """
    from gbufrt.compute.each import counted
    from gbufrt.compute.kernel import array, threads
    from post.sweep import drivers

    (batch, *size), count = hit.shape, FOUND + LIGHT * gathers
    out = depth.new_empty((max(len(radii), 1) * count, batch, size[0] * size[1]))
    limits = radii if len(radii) else radii.new_full((1,), torch.inf)
    pairs = picture.contiguous().view(torch.int64).flatten(1, 2)  # two numbers are read at once
    given = (out, pairs, rays, depth, normal, lens, pose, hit, turns, noise.flatten(1), limits, sky, terms)
    sizes = (picture.shape[2], margin, stride, *offset, directions, steps, len(radii) > 0, parallel)
    if form_of(depth, cuda=_fits_cuda(steps, len(radii))) is Form.CUDA:
        counts = counted(len(limits)), counted(LIGHT * gathers)
        drivers.sweep_each(batch * size[0] * size[1], *given, *sizes, *counts)
    else:
        drivers.sweep_all(*map(array, given), *sizes, gathers, threads())
    return out.view(-1, count, batch, *size)


@sweep_cpu.register_fake
def _(
    picture, rays, depth, normal, lens, pose, hit, turns, noise, radii, sky, terms, margin, stride, offset, directions,
    steps, parallel, gathers,
):  # fmt: skip
    return depth.new_empty((max(len(radii), 1), FOUND + LIGHT * gathers, *hit.shape))


def sweep(
    around: PaddedView,
    pixels: Receiving,
    noise: Tensor,
    radii: tuple[Tensor, ...],
    sky: Sky | None,
    *,
    directions: int,
    steps: int,
    gathers: bool = False,
    soft: bool = False,
    compiled: bool | None = None,
) -> Tensor:
    """``(radii or 1, B, 4, h, w)``: visibility and bent normals, see `arcs.finish`; 7 with the mean gathered light.

    Where gathered light alone wants a gradient, the numbers are the kernel's and the gradient is the reference's.

    Args:
        around: what taps read.
        pixels: the receivers; where they hit nothing, the kernel sweeps nothing and gathers nothing.
        noise: ``(3, h, w)`` in [0, 1).
        radii: from the smallest to the largest; none for no limit. At most one where light is gathered.
        sky: beyond the border, or None if all that is not covered is open.
        directions: number of slices.
        steps: taps on each side of a slice.
        gathers: whether light is gathered.
        soft: fractional coverage of edge sectors, which has no kernel; otherwise edges are dithered.
        compiled: see `gbufrt.compute.dispatch.form_of`.
    """
    sizes: dict[str, Any] = {"directions": directions, "steps": steps, "gathers": gathers}
    lit = gathers and not soft and torch.is_grad_enabled() and around.picture.requires_grad
    with torch.set_grad_enabled(torch.is_grad_enabled() and not lit):
        inputs = (around.picture, around.origin_x, pixels.depth, pixels.normal, *radii)
        form = form_of(*inputs, compiled=compiled, cuda=_fits_cuda(steps, len(radii)))
    if form is Form.REFERENCE:
        return _by_reference(around, pixels, noise, radii, sky, **sizes, soft=soft)
    with torch.no_grad():
        found = _by_kernel(around, pixels, noise, radii, sky, **sizes)
    if lit:
        known = _by_reference(around, pixels, noise, radii, sky, **sizes, soft=soft)
        return known + (found - known).detach()
    return found


def _fits_cuda(steps: int, radii: int) -> bool:
    return steps <= MOST_STEPS and radii <= MOST_RADII


def _by_reference(
    around: PaddedView, pixels: Receiving, noise: Tensor, radii: tuple[Tensor, ...], sky: Sky | None, **sizes: Any
) -> Tensor:
    at = receivers(pixels)
    found = []
    for sums in sweep_reference(around, at, noise, radii, sky, **sizes, parallel=pixels.camera.orthographic):
        light = torch.where(pixels.of(pixels.hit), (sums[SUMS:] / sums[0]).movedim(0, 1), 0.0)
        found.append(torch.cat([*arcs.finish(at, pixels, sums[:SUMS]), light], dim=1))
    return torch.stack(found)


def _by_kernel(
    around: PaddedView,
    pixels: Receiving,
    noise: Tensor,
    radii: tuple[Tensor, ...],
    sky: Sky | None,
    *,
    directions: int,
    steps: int,
    gathers: bool,
) -> Tensor:
    camera, depth = pixels.camera, pixels.depth
    batch, empty = depth.shape[0], depth.new_empty(depth.shape[0], 0)
    lens = camera.lens.to(depth.dtype)
    aspect = (lens[:, 1] / lens[:, 0])[:, None, None]
    rays = (around.origin_x, around.origin_y, around.pitch_x, around.pitch_y, aspect)
    found = sweep_cpu(
        around.picture.movedim(1, -1),
        torch.cat([t.expand(batch, 1, 1).flatten(1) for t in rays], dim=1),
        depth[:, 0],
        pixels.normal,
        lens,
        camera.rotation_to_view.to(depth.dtype),
        pixels.of(pixels.hit)[:, 0],
        resident(table, depth),
        noise,
        torch.stack(radii) if radii else depth.new_empty(0),
        empty if sky is None else torch.cat([t.expand(batch, 1, 1).flatten(1) for t in sky], dim=1),
        resident(arcs.direction_polynomials(GROUPS), depth),
        around.margin,
        pixels.stride,
        list(pixels.offset),
        directions,
        steps,
        camera.orthographic,
        gathers,
    )
    return found.movedim(2, 1)


@operator("gbufrt::bodies")
def bodies_cpu(
    depth: Tensor, hit: Tensor, thickness: Tensor, lens: Tensor, pixel: Tensor, hidden: Tensor, parallel: bool
) -> Tensor:
    """See `post.sweep.thickness.planar_thickness`.

    Args:
        depth: ``(B, 1, H, W)``.
        hit: ``(B, 1, H, W)`` bool.
        thickness: ``(B, 1, H, W)`` along the view ray.
        lens: ``(B, 6)``, see `Camera.lens`.
        pixel: ``(B, 2)``, see `post.sweep.reference.bodies_reference`.
        hidden: ``(1,)``.
        parallel: whether the camera is orthographic.
    """
    from gbufrt.compute.kernel import array, threads
    from post.sweep import drivers

    on_gpu, back = form_of(depth, cuda=True) is Form.CUDA, depth.new_empty(depth.shape)
    planes, view = [t[:, 0] for t in (back, depth, thickness)], (lens, parallel)
    if on_gpu:
        drivers.backs_each(back.numel(), *planes, *view)
    else:
        drivers.backs_rows(*map(array, planes), array(lens), parallel, threads())
    for stride in STRIDES:
        out, last = back.new_empty(back.shape), stride == STRIDES[-1]
        planes = [t[:, 0] for t in (out, depth, hit, back)]
        if on_gpu:
            drivers.bodies_each(out.numel(), *planes, pixel, stride, hidden, *view, last)
        else:
            given = (*map(array, (*planes, pixel)), stride, *map(array, (hidden, lens)))
            drivers.bodies_rows(*given, parallel, last, threads())
        back = out
    return back


@bodies_cpu.register_fake
def _(depth, hit, thickness, lens, pixel, hidden, parallel):
    return depth.new_empty(depth.shape)
