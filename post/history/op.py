"""Histories as torch operators: kernels on the CPU and on CUDA, else the torch reference."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from gbufrt import GBuffer
from gbufrt.compute.dispatch import Form, form_of
from post.filters.edges import Surface
from post.filters.fits import fits_cuda
from post.history.antilag import accumulate_reference
from post.history.constants import WINDOW
from post.history.correspondence import correspondence
from post.history.reproject import find_taps
from post.history.taa_reference import anti_alias_reference, longest


class Reading(NamedTuple):
    """A picture of the previous frame, read at this frame's pixels."""

    image: Tensor
    """``(B, C, H, W)``; zero where not valid."""
    support: Tensor
    """``(B, 1, H, W)`` in [0, 1]: how much of the bilinear footprint showed this surface."""
    valid: Tensor
    """``(B, 1, H, W)`` bool: whether there is any history."""


@torch.library.custom_op("gbufrt::read_history", mutates_args=())
def read_history_cpu(
    image: Tensor, now: Tensor, before: Tensor, shift: Tensor, plane: float, normal: float, search: bool, sharp: bool
) -> Tensor:
    """``(B, C + 2, H, W)``: the picture, the support, and 1 where it is valid.

    Args:
        image: ``(B, C, H, W)``.
        now: as `correspondence_reference` gives it, as ``before`` and ``shift``.
        before: see ``now``.
        shift: see ``now``.
        plane: ``plane_tolerance`` of `read_history`.
        normal: ``normal_tolerance``.
        search: see `read_history`.
        sharp: see `read_history`.
    """
    from gbufrt.compute.kernel import array, threads
    from post.history.drivers import read_each, read_rows

    batch, channels, height, width = image.shape
    out = image.new_empty(batch, channels + 2, height, width)
    pictures, options = (out, image, now, before, shift), (plane, normal, search, sharp)
    if form_of(image, cuda=True) is Form.CUDA:
        read_each(batch * height * width, *pictures, *options)
    else:
        read_rows(*map(array, pictures), *options, threads())
    return out


@read_history_cpu.register_fake
def _(image, now, before, shift, plane, normal, search, sharp):
    return image.new_empty(image.shape[0], image.shape[1] + 2, *image.shape[2:])


@torch.library.custom_op("gbufrt::accumulate", mutates_args=())
def accumulate_cpu(
    signal: Tensor, state: Tensor, longest: Tensor, guide: Tensor, plane: Tensor, perspective: bool, lead: int,
    clamp: float, firefly: float,
) -> tuple[Tensor, Tensor]:  # fmt: skip
    """See `accumulate`; ``guide`` and ``plane`` are those of `Surface`."""
    from gbufrt.compute.kernel import array, threads
    from post.history.accumulate_drivers import blend_each, blend_rows, fast_each, fast_rows, sample_each, sample_rows

    out, sample = state.new_empty(state.shape), signal.new_empty(signal.shape)
    noise, fast = signal.new_empty(signal[:, 0].shape), signal.new_empty(signal.shape[0], lead + 2, *signal.shape[2:])
    now, geometry = (sample, noise, torch.empty_like(noise, dtype=torch.int32)), (guide, plane)
    count, longest = noise.numel(), longest[:, 0]
    if form_of(signal, cuda=fits_cuda(signal)) is Form.CUDA:
        sample_each(count, *now, signal, state, *geometry, perspective, lead, firefly, clamp > 0)
        fast_each(count, fast, *now, state, lead, clamp)
        blend_each(count, out, fast, *now, state, longest, lead, clamp)
    else:
        given, done, wide = array(state), [array(x) for x in now], threads()
        sample_rows(*done, array(signal), given, *map(array, geometry), perspective, lead, firefly, clamp > 0, wide)
        fast_rows(array(fast), *done, given, lead, clamp, wide)
        blend_rows(array(out), array(fast), *done, given, array(longest), lead, clamp, wide)
    return out, sample


@accumulate_cpu.register_fake
def _(signal, state, longest, guide, plane, perspective, lead, clamp, firefly):
    return state.new_empty(state.shape), signal.new_empty(signal.shape)


@torch.library.custom_op("gbufrt::anti_alias", mutates_args=())
def anti_alias_cpu(
    color: Tensor,
    weights: Tensor,
    depth: Tensor,
    motion: Tensor,
    before: Tensor,
    age: Tensor,
    blend: float,
    gamma: float,
) -> tuple[Tensor, Tensor, Tensor]:
    """See `anti_alias`; ``weights`` ``(B, 2, 3)`` are shares of the columns and rows around a pixel in its value."""
    from gbufrt.compute.kernel import array, threads
    from post.history.drivers import alias_each, anti_alias_rows, tone_each, tone_rows

    toned, new, out = (torch.empty_like(color, memory_format=torch.contiguous_format) for _ in range(3))
    length, options = torch.empty_like(age, memory_format=torch.contiguous_format), (longest(blend), gamma)
    pictures = (out, new, length[:, 0], toned, weights, depth[:, 0], motion, before, age[:, 0])
    if form_of(color, cuda=True) is Form.CUDA:
        tone_each(age.numel(), toned, color)
        alias_each(age.numel(), *pictures, *options)
    else:
        tone_rows(array(toned), array(color), threads())
        anti_alias_rows(*map(array, pictures), *options, threads())
    return out, new, length


@anti_alias_cpu.register_fake
def _(color, weights, depth, motion, before, age, blend, gamma):
    out = torch.empty_like(color, memory_format=torch.contiguous_format)
    return out, torch.empty_like(out), torch.empty_like(age, memory_format=torch.contiguous_format)


def read_history(
    gbuffer: GBuffer,
    previous: GBuffer,
    image: Tensor,
    *,
    length: Tensor | None = None,
    motion: Tensor | None = None,
    plane_tolerance: float = 2.0,
    normal_tolerance: float = 0.9,
    search: bool = True,
    sharp: bool = False,
    compiled: bool | None = None,
) -> Reading:
    """Read a picture of the previous frame where this frame's surfaces were.

    Each of the four pixels around the reprojected position counts only if it shows the same surface: the same hit
    flag and object, a similar normal, and a point within ``plane_tolerance`` of the surface's tangent plane at that
    time. Where none does, the 3x3 pixels around are searched for the nearest that does. Sky matches sky.

    History lives on the pixel grid without jitter: a still camera fetches each pixel from itself, jittered or not.

    Args:
        gbuffer: of this frame.
        previous: of the frame before, with its own camera.
        image: ``(B, C, H, W)`` of the frame before.
        length: ``(B, 1, H, W)`` history length of the frame before; pixels of length zero are not used.
        motion: see `correspondence_reference`.
        plane_tolerance: allowed distance from the plane, in pixel footprints.
        normal_tolerance: smallest allowed cosine between normals.
        search: whether to search the neighbours of failures.
        sharp: read with Catmull-Rom weights where all four pixels show the surface; outer taps that do not show it
            give their share to the nearest of the four. A history that moves every frame keeps its detail.
        compiled: see `gbufrt.compute.dispatch.form_of`.

    Returns:
        `Reading`.

    Raises:
        ValueError: the frames differ in batch or size.

    Source: Schied et al. 2017 (SVGF), section 4.1; per-tap validation as in NVIDIA's ReLAX.
    """
    now, before, shift = correspondence(gbuffer, previous, length, motion, compiled=compiled)
    options = (plane_tolerance, normal_tolerance, search, sharp)
    if form_of(image, shift, now.detach(), before.detach(), compiled=compiled, cuda=True) is not Form.REFERENCE:
        found = read_history_cpu(image, now, before, shift, *options)
        return Reading(found[:, :-2], found[:, -2:-1], found[:, -1:] > 0)
    taps = find_taps(now, before, shift, *options)
    return Reading(taps.fetch(image), taps.support, taps.valid)


def accumulate(
    signal: Tensor,
    state: Tensor,
    longest: Tensor,
    geometry: Surface,
    *,
    lead: int,
    clamp: float,
    firefly: float,
    compiled: bool | None = None,
) -> tuple[Tensor, Tensor]:
    """Average a signal with its history, which follows changes of light; see `post.temporal`.

    Args:
        signal: ``(B, C, H, W)`` of this frame.
        state: ``(B, C + lead + 4, H, W)`` of the frame before at this frame's pixels: mean, fast mean of the first
            ``lead`` channels, mean and mean square of luminance, sum of squared weights, age in frames.
        longest: ``(B, 1, H, W)`` frames that a history may hold.
        geometry: of this frame.
        lead: see `post.temporal`, as the rest.
        compiled: see `gbufrt.compute.dispatch.form_of`.

    Returns:
        The state after this frame, and the signal without fireflies.
    """
    planes = (signal, state, longest, geometry.guide, geometry.plane)
    if form_of(*planes, clamp, firefly, compiled=compiled, cuda=fits_cuda(signal)) is Form.REFERENCE:
        return accumulate_reference(signal, state, longest, geometry, lead, clamp, firefly)
    return accumulate_cpu(*planes, geometry.perspective, lead, float(clamp), float(firefly))


def anti_alias(
    color: Tensor,
    jitter: Tensor | None,
    depth: Tensor,
    motion: Tensor,
    before: Tensor | None,
    age: Tensor,
    *,
    blend: float,
    gamma: float,
    compiled: bool | None = None,
) -> tuple[Tensor, Tensor, Tensor]:
    """Average a jittered frame with its history; see `post.taa`.

    Args:
        color: ``(B, 3, H, W)`` linear radiance, finite.
        jitter: ``(B, 2)`` pixels, or None: where this frame's samples lie beside the pixel centres.
        depth: ``(B, 1, H, W)``, any unit in which a nearer surface has less, misses included.
        motion: ``(B, 2, H, W)`` pixels, previous minus current.
        before: ``(B, 3, H, W)`` the second result of the frame before; None at first.
        age: ``(B, 1, H, W)`` the third result of the frame before; 0 where there is no history.
        blend: see `post.taa`.
        gamma: see `post.taa`.
        compiled: see `gbufrt.compute.dispatch.form_of`.

    Returns:
        ``(B, 3, H, W)`` linear radiance, the same tone-mapped, and ``(B, 1, H, W)`` its age in frames.
    """
    tunables = (blend, gamma)
    if form_of(color, jitter, depth, motion, before, age, *tunables, compiled=compiled, cuda=True) is Form.REFERENCE:
        return anti_alias_reference(color, jitter, depth, motion, before, age, *tunables)
    steps = torch.arange(-1, 2, device=color.device)
    window = (steps == 0) if jitter is None else torch.exp(WINDOW * (jitter[:, :, None] + steps) ** 2)
    weights = window.to(color.dtype).expand(color.shape[0], 2, 3)
    if before is None:
        before, age = color, torch.zeros_like(age)
    return anti_alias_cpu(color, weights, depth, motion, before, age, *map(float, tunables))
