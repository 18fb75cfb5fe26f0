"""Histories as torch operators: kernels on the CPU and on CUDA, else the torch reference."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt.compute.dispatch import Form, form_of
from post.filters.edges import Surface
from post.filters.fits import fits_cuda
from post.history.antilag import accumulate_reference
from post.history.constants import WINDOW
from post.history.taa_reference import anti_alias_reference, longest


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
