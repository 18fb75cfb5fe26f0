"""Follow changes of light that stand out from noise over a wide piece of a surface.

Over few pixels one bright sample of a long-tailed distribution looks like a change, and a history that begins anew
there shows as a spot, while a change that is weaker than the noise is missed. Over a wide area such samples average
out, and so does noise.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import Tensor

from gbufrt import GBuffer
from gbufrt.compute.dispatch import Form, form_of
from gbufrt.compute.operators import operator
from post.filters.constants import COARSE_POWER
from post.filters.edges import Surface, fits_cuda
from post.filters.op import wavelet
from post.filters.surfaces import surface
from post.history.antilag import differences_reference, unexplained_reference
from post.history.op import Sample

AREA = 2  # wavelets over which changes are averaged: they reach 6 pixels to each side, as small shadows do
STRICTER = 1.5  # than `clamp` in `post.temporal`: the noise of neighbours may be correlated


class Changes(NamedTuple):
    """How the light of histories has changed, see `unexplained`."""

    fast: Tensor
    slow: Tensor


def follow_changes(
    sample: Sample, state: Tensor, gbuffer: GBuffer, *, lead: int, clamp: float, roughness: Tensor | None = None
) -> Changes:
    """Find by how much to draw the fast history toward the frame, and the slow one toward the fast.

    Args:
        sample: of `post.history.op.taken_in`.
        state: ``(B, C + lead + 4, H, W)``, see there.
        gbuffer: of this frame.
        lead: number of leading channels that are compared.
        clamp: as in `post.temporal`.
        roughness: ``(B, 1, H, W)`` if surfaces are told apart by it.
    """
    geometry = surface(gbuffer.depth, gbuffer.normal, gbuffer.hit & (state[:, -1:] > 0), gbuffer.camera, roughness)

    def moved(first: Tensor | None) -> Tensor:  # what has no name is freed as soon as wavelets have read it
        averaged = _averaged(differences(sample, state, first, lead=lead), geometry, AREA)
        return unexplained(averaged, state, lead=lead, clamp=STRICTER * clamp, slow=first is not None)

    return Changes(first := moved(None), moved(first))


def spread(
    planes: Tensor, variance: Tensor, geometry: Surface, iterations: int, reach: Tensor | None = None
) -> tuple[Tensor, Tensor]:
    """Average over the surface, whatever its light.

    Args:
        planes: ``(B, C, H, W)``, any unit.
        variance: ``(B, 1, H, W)`` of a plane's noise.
        geometry: of the same size.
        iterations: wavelets, each twice as wide as the one before.
        reach: ``(B, 1, H, W)``: 1 / (2 sigma^2) of the widest average, 1 / pixels squared; none is too wide by default.

    Returns:
        ``planes`` averaged, and the variance that is left.
    """
    values = _averaged(torch.cat([planes, variance], dim=1), geometry, iterations, reach)
    return values[:, :-1], values[:, -1:]


def _averaged(values: Tensor, geometry: Surface, iterations: int, reach: Tensor | None = None) -> Tensor:
    """Planes, and the variance of their noise, averaged over the surface; no luminance is too different."""
    for iteration in range(iterations):
        values = wavelet(
            values, geometry, reach, step=2**iteration, phi_color=math.inf, phi_depth=1.0, phi_normal=COARSE_POWER
        )
    return values


@operator("gbufrt::differences")
def differences_cpu(signal: Tensor, noise: Tensor, state: Tensor, first: Tensor, lead: int) -> Tensor:
    """See `differences`; ``first`` has no channels where it is the fast history that is compared."""
    from gbufrt.compute.kernel import array, threads
    from post.history.accumulate_drivers import differences_each, differences_rows

    out = signal.new_empty(signal.shape[0], lead + 1, *signal.shape[2:])
    pictures = (out, signal, noise[:, 0], state, first)
    if form_of(signal, cuda=fits_cuda(state)) is Form.CUDA:
        differences_each(noise.numel(), *pictures, lead)
    else:
        differences_rows(*map(array, pictures), lead, threads())
    return out


@differences_cpu.register_fake
def _(signal, noise, state, first, lead):
    return signal.new_empty(signal.shape[0], lead + 1, *signal.shape[2:])


@operator("gbufrt::unexplained")
def unexplained_cpu(averaged: Tensor, state: Tensor, lead: int, clamp: float, slow: bool) -> Tensor:
    """See `unexplained`."""
    from gbufrt.compute.kernel import array, threads
    from post.history.accumulate_drivers import unexplained_each, unexplained_rows

    out, options = averaged.new_empty(averaged.shape[0], lead + slow, *averaged.shape[2:]), (lead, clamp, slow)
    if form_of(averaged, cuda=fits_cuda(state)) is Form.CUDA:
        unexplained_each(out[:, 0].numel(), out, averaged, state, *options)
    else:
        unexplained_rows(*map(array, (out, averaged, state)), *options, threads())
    return out


@unexplained_cpu.register_fake
def _(averaged, state, lead, clamp, slow):
    return averaged.new_empty(averaged.shape[0], lead + slow, *averaged.shape[2:])


def differences(
    sample: Sample, state: Tensor, first: Tensor | None = None, *, lead: int, compiled: bool | None = None
) -> Tensor:
    """By how much two views of the light differ: the frame and the fast history, or that and the slow one.

    Args:
        sample: see `post.history.op.taken_in`.
        state: see there.
        first: by how much the fast history is to move, as `unexplained` returns it; None to compare the frame with it.
        lead: see there.
        compiled: see `gbufrt.compute.dispatch.form_of`.

    Returns:
        ``(B, lead + 1, H, W)``: the differences, and the variance of their noise.
    """
    planes = (sample.signal, sample.noise, state, sample.signal[:, :0] if first is None else first)
    if form_of(*planes, compiled=compiled, cuda=fits_cuda(state)) is Form.REFERENCE:
        return differences_reference(*planes, lead)
    return differences_cpu(*planes, lead)


def unexplained(
    averaged: Tensor, state: Tensor, *, lead: int, clamp: float, slow: bool, compiled: bool | None = None
) -> Tensor:
    """What noise does not explain of a difference between histories.

    Args:
        averaged: ``(B, lead + 1, H, W)``: `differences`, averaged over many pixels.
        state: see `post.history.op.taken_in`.
        lead: see there.
        clamp: standard deviations that noise explains.
        slow: it is the slow history that is to move, and must not become negative; else the fast one.
        compiled: see `differences`.

    Returns:
        By how much to move, ``(B, lead, H, W)``; of the slow history also the share of it that is explained, squared,
        in [0, 1], as one more channel.
    """
    if form_of(averaged, state, clamp, compiled=compiled, cuda=fits_cuda(state)) is Form.REFERENCE:
        return unexplained_reference(averaged, state, lead, clamp, slow)
    return unexplained_cpu(averaged, state, lead, float(clamp), slow)
