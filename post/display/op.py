"""What a display is given, as torch operators: kernels on the CPU and on CUDA, torch references elsewhere."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt.compute.dispatch import Form, form_of
from gbufrt.compute.operators import operator
from post.display.constants import AGX_INSET, BINS, STRIP
from post.display.reference import (
    Operator,
    encode_reference,
    histogram_reference,
    matrix,
    tone_reference,
    vignette_reference,
)


@operator("gbufrt::agx")
def agx_cpu(color: Tensor, exposure: Tensor, contrast: float, saturation: float) -> Tensor:
    """``(B, 3, H, W)``. See `tone_curve`; ``exposure`` is ``(B,)``."""
    from gbufrt.compute.kernel import array, threads
    from post.display.drivers import agx_each, agx_rows

    out, inset = torch.empty_like(color, memory_format=torch.contiguous_format), matrix(AGX_INSET, color)
    matrices = inset, torch.linalg.inv_ex(inset).inverse
    if form_of(color, cuda=True) is Form.CUDA:
        agx_each(out[:, 0].numel(), out, color, exposure, contrast, saturation, *matrices)
    else:
        pictures = (array(t) for t in (out, color, exposure))
        agx_rows(*pictures, contrast, saturation, *map(array, matrices), threads())
    return out


@agx_cpu.register_fake
def _(color, exposure, contrast, saturation):
    return torch.empty_like(color, memory_format=torch.contiguous_format)


def tone_curve(
    color: Tensor,
    exposure: Tensor,
    operator: Operator,
    contrast: float,
    saturation: float,
    white: float,
    *,
    compiled: bool | None = None,
) -> Tensor:
    """Compress scene light into what a display can show.

    Args:
        color: ``(B, 3, H, W)`` linear.
        exposure: factor on ``color``, of one element or ``(B, 1, 1, 1)``.
        operator: see `post.tone_map`, as the rest.
        contrast: see ``operator``.
        saturation: see ``operator``.
        white: see ``operator``.
        compiled: see `gbufrt.compute.dispatch.form_of`; only AgX has a compiled form.

    Returns:
        ``(B, 3, H, W)`` display-linear in [0, 1].
    """
    form = form_of(color, exposure, contrast, saturation, compiled=compiled, cuda=True)
    if form is Form.REFERENCE or operator != "agx" or exposure.numel() not in (1, color.shape[0]):
        return tone_reference(color, exposure, operator, contrast, saturation, white)
    return agx_cpu(color, exposure.flatten().expand(color.shape[0]), float(contrast), float(saturation))


@operator("gbufrt::encoded")
def encoded_cpu(image: Tensor) -> Tensor:
    """See `encoded`."""
    from gbufrt.compute.kernel import array, threads
    from post.display.drivers import encode_each, encode_rows

    out = torch.empty_like(image, memory_format=torch.contiguous_format)
    if form_of(image, cuda=True) is Form.CUDA:
        encode_each(out[:, 0].numel(), out, image)
    else:
        encode_rows(array(out), array(image), threads())
    return out


@encoded_cpu.register_fake
def _(image):
    return torch.empty_like(image, memory_format=torch.contiguous_format)


def encoded(image: Tensor, *, compiled: bool | None = None) -> Tensor:
    """Display-linear light ``(B, 3, H, W)``, clipped to [0, 1], as sRGB.

    Args:
        image: linear.
        compiled: see `gbufrt.compute.dispatch.form_of`.

    Returns:
        ``(B, C, H, W)`` in [0, 1].
    """
    form = form_of(image, compiled=compiled, cuda=True)
    return encode_reference(image) if form is Form.REFERENCE else encoded_cpu(image)


@operator("gbufrt::vignette")
def vignette_cpu(image: Tensor, strength: float, inner: float, outer: float) -> Tensor:
    """See `darkened`."""
    from gbufrt.compute.kernel import array, threads
    from post.display.drivers import vignette_each, vignette_rows

    out = torch.empty_like(image, memory_format=torch.contiguous_format)
    if form_of(image, cuda=True) is Form.CUDA:
        vignette_each(out[:, 0].numel(), out, image, strength, inner, outer)
    else:
        vignette_rows(array(out), array(image), strength, inner, outer, threads())
    return out


@vignette_cpu.register_fake
def _(image, strength, inner, outer):
    return torch.empty_like(image, memory_format=torch.contiguous_format)


def darkened(image: Tensor, strength: float, inner: float, outer: float, *, compiled: bool | None = None) -> Tensor:
    """A picture ``(B, C, H, W)`` that darkens toward its corners.

    Args:
        image: linear.
        strength: see `post.vignette`, as the rest.
        inner: see ``strength``.
        outer: see ``strength``.
        compiled: see `gbufrt.compute.dispatch.form_of`.

    Returns:
        As ``image``.
    """
    given = (image, strength, inner, outer)
    if form_of(*given, compiled=compiled, cuda=True) is Form.REFERENCE:
        return vignette_reference(*given)
    return vignette_cpu(image, *map(float, given[1:]))


@operator("gbufrt::histogram")
def histogram_cpu(color: Tensor) -> Tensor:
    """See `histogram`."""
    from gbufrt.compute.kernel import array, threads
    from post.display.drivers import histogram_rows

    batch, _, height, _ = color.shape
    strips = color.new_zeros(batch, -(-height // STRIP), 2, BINS, dtype=torch.float64)
    histogram_rows(array(strips), array(color), threads())
    return strips.sum(1).to(color.dtype)


@histogram_cpu.register_fake
def _(color):
    return color.new_empty(color.shape[0], 2, BINS)


def histogram(color: Tensor, *, compiled: bool | None = None) -> Tensor:
    """Pixels by their log2 luminance, from `constants.DARKEST` to `constants.BRIGHTEST`; those without light apart.

    Args:
        color: ``(B, 3, H, W)`` linear, finite.
        compiled: see `gbufrt.compute.dispatch.form_of`; there is a kernel for the CPU alone.

    Returns:
        ``(B, 2, BINS)``: how many pixels each bin holds, and the sum of their log2 luminance.
    """
    form = form_of(color, compiled=compiled)
    return histogram_cpu(color) if form is Form.CPU else histogram_reference(color)
