"""Histories as torch operators: kernels on the CPU and on CUDA, else the torch reference."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from gbufrt.compute.dispatch import Form, form_of
from gbufrt.compute.operators import operator
from post.filters.edges import fits_cuda
from post.history.antilag import blend_reference, sample_reference
from post.history.constants import WINDOW
from post.history.taa_reference import anti_alias_reference, longest


class Sample(NamedTuple):
    """A frame's signal, ready to be taken into its history; see `taken_in`."""

    signal: Tensor
    """``(B, C, H, W)`` without fireflies."""
    noise: Tensor
    """``(B, 1, H, W)``: variance of one frame's luminance."""


@operator("gbufrt::sample_of_frame")
def sample_cpu(signal: Tensor, state: Tensor, lead: int, firefly: float) -> tuple[Tensor, Tensor]:
    """The parts of `Sample`."""
    from gbufrt.compute.kernel import array, threads
    from post.history.accumulate_drivers import sample_each, sample_rows

    sample, noise = signal.new_empty(signal.shape), signal.new_empty(signal[:, :1].shape)
    if form_of(signal, cuda=fits_cuda(signal)) is Form.CUDA:
        sample_each(noise.numel(), sample, noise, signal, state, lead, firefly)
    else:
        sample_rows(*map(array, (sample, noise, signal, state)), lead, firefly, threads())
    return sample, noise


@sample_cpu.register_fake
def _(signal, state, lead, firefly):
    return signal.new_empty(signal.shape), signal.new_empty(signal[:, :1].shape)


@operator("gbufrt::blend_sample")
def blend_cpu(sample: Tensor, state: Tensor, longest: Tensor, fast: Tensor, slow: Tensor, lead: int) -> Tensor:
    """See `blended`; ``fast`` and ``slow`` have no channels where no change is followed."""
    from gbufrt.compute.kernel import array, threads
    from post.history.accumulate_drivers import blend_each, blend_rows

    out = state.new_empty(state.shape)
    pictures = (out, sample, state, longest[:, 0], fast, slow)
    if form_of(sample, cuda=fits_cuda(sample)) is Form.CUDA:
        blend_each(longest.numel(), *pictures, lead)
    else:
        blend_rows(*map(array, pictures), lead, threads())
    return out


@blend_cpu.register_fake
def _(sample, state, longest, fast, slow, lead):
    return state.new_empty(state.shape)


@operator("gbufrt::anti_alias")
def anti_alias_cpu(
    color: Tensor,
    weights: Tensor,
    depth: Tensor,
    normal: Tensor,
    rays: Tensor,
    motion: Tensor,
    before: Tensor,
    age: Tensor,
    parallel: bool,
    blend: float,
    gamma: float,
) -> tuple[Tensor, Tensor, Tensor]:
    """See `anti_alias`; ``weights`` ``(B, 2, 3)`` are shares of the columns and rows around a pixel in its value."""
    from gbufrt.compute.kernel import array, threads
    from post.history.drivers import alias_each, anti_alias_rows, tone_each, tone_rows

    toned, new, out = (torch.empty_like(color, memory_format=torch.contiguous_format) for _ in range(3))
    length, options = torch.empty_like(age, memory_format=torch.contiguous_format), (parallel, longest(blend), gamma)
    pictures = (out, new, length[:, 0], toned, weights, depth[:, 0], normal, rays, motion, before, age[:, 0])
    if form_of(color, cuda=True) is Form.CUDA:
        tone_each(age.numel(), toned, color)
        alias_each(age.numel(), *pictures, *options)
    else:
        tone_rows(array(toned), array(color), threads())
        anti_alias_rows(*map(array, pictures), *options, threads())
    return out, new, length


@anti_alias_cpu.register_fake
def _(color, weights, depth, normal, rays, motion, before, age, parallel, blend, gamma):
    out = torch.empty_like(color, memory_format=torch.contiguous_format)
    return out, torch.empty_like(out), torch.empty_like(age, memory_format=torch.contiguous_format)


def taken_in(signal: Tensor, state: Tensor, *, lead: int, firefly: float, compiled: bool | None = None) -> Sample:
    """A signal as its history takes it in.

    Args:
        signal: ``(B, C, H, W)`` of this frame.
        state: ``(B, C + lead + 4, H, W)`` of the frame before at this frame's pixels: mean, fast mean of the first
            ``lead`` channels, mean and mean square of luminance, sum of squared weights, age in frames.
        lead: see `post.temporal`, as the rest.
        compiled: see `gbufrt.compute.dispatch.form_of`.
    """
    form = form_of(signal, state, firefly, compiled=compiled, cuda=fits_cuda(signal))
    compute = sample_reference if form is Form.REFERENCE else sample_cpu
    return Sample(*compute(signal, state, lead, firefly if form is Form.REFERENCE else float(firefly)))


def blended(
    sample: Tensor,
    state: Tensor,
    longest: Tensor,
    changes: tuple[Tensor, Tensor] | None = None,
    *,
    lead: int,
    compiled: bool | None = None,
) -> Tensor:
    """The state after a frame: histories, which follow changes of light, averaged with the sample.

    Args:
        sample: ``(B, C, H, W)``, see `Sample`.
        state: see `taken_in`.
        longest: ``(B, 1, H, W)`` frames that a history may hold.
        changes: of the fast and of the slow history, see `post.history.changes.follow_changes`; none are followed by
            default.
        lead: see `taken_in`.
        compiled: likewise.
    """
    planes = (sample, state, longest, *(changes or (sample[:, :0], sample[:, :0])))
    if form_of(*planes, compiled=compiled, cuda=fits_cuda(sample)) is Form.REFERENCE:
        return blend_reference(*planes, lead)
    return blend_cpu(*planes, lead)


def anti_alias(
    color: Tensor,
    jitter: Tensor | None,
    depth: Tensor,
    motion: Tensor,
    before: Tensor | None,
    age: Tensor,
    *,
    normal: Tensor | None = None,
    rays: Tensor | None = None,
    parallel: bool = False,
    blend: float,
    gamma: float,
    compiled: bool | None = None,
) -> tuple[Tensor, Tensor, Tensor]:
    """Average a jittered frame with its history; see `post.taa`.

    Args:
        color: ``(B, 3, H, W)`` linear radiance, finite.
        jitter: ``(B, 2)`` pixels, or None: where this frame's samples lie beside the pixel centres.
        depth: ``(B, 1, H, W)`` planar view z, world units; infinite where nothing was hit.
        motion: ``(B, 2, H, W)`` pixels, previous minus current.
        before: ``(B, 3, H, W)`` the second result of the frame before; None at first.
        age: ``(B, 1, H, W)`` the third result of the frame before; 0 where there is no history.
        normal: ``(B, 3, H, W)`` world space; by default as if every surface faced the camera.
        rays: ``(B, 3, 3)`` world space: by how much rays of planar view z 1 change from column to column and from row
            to row, and that through column 0 and row 0; for orthographic cameras, places and the view axis.
        parallel: the camera is orthographic.
        blend: see `post.taa`.
        gamma: see `post.taa`.
        compiled: see `gbufrt.compute.dispatch.form_of`.

    Returns:
        ``(B, 3, H, W)`` linear radiance, the same tone-mapped, and ``(B, 1, H, W)`` its age in frames.
    """
    if normal is None or rays is None:
        normal, rays = torch.zeros_like(color), color.new_zeros(color.shape[0], 3, 3)
    tunables, planes = (blend, gamma), (depth, normal, rays, motion, before, age)
    if form_of(color, jitter, *planes, *tunables, compiled=compiled, cuda=True) is Form.REFERENCE:
        return anti_alias_reference(color, jitter, *planes, parallel, *tunables)
    steps = torch.arange(-1, 2, device=color.device)
    window = (steps == 0) if jitter is None else torch.exp(WINDOW * (jitter[:, :, None] + steps) ** 2)
    weights = window.to(color.dtype).expand(color.shape[0], 2, 3)
    if before is None:
        before, age = color, torch.zeros_like(age)
    return anti_alias_cpu(color, weights, depth, normal, rays, motion, before, age, parallel, *map(float, tunables))
