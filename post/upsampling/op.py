"""Joint bilateral upsampling as a torch operator: kernels on the CPU and on CUDA, the torch reference elsewhere."""

from __future__ import annotations

from collections.abc import Sequence

from torch import Tensor

from gbufrt.compute.dispatch import Form, form_of
from gbufrt.compute.operators import operator
from gbufrt.compute.resident import resident
from post.filters.constants import ROUGHNESS
from post.filters.edges import Surface
from post.upsampling.reference import upsample_reference


def upsample(
    low: Tensor,
    geometry: Surface,
    *,
    stride: int = 2,
    offset: tuple[int, int] = (0, 0),
    clear: Sequence[float] | None = None,
    compiled: bool | None = None,
) -> Tensor:
    """Upsample ``low`` to every pixel by bilinear weights of those of its four samples that lie on its surface.

    Where they make up less than `constants.ENOUGH` of the bilinear weight, the sixteen samples around count as well,
    the more the less there is. If none of them lies on the pixel's surface, the pixel takes their mean.

    Args:
        low: ``(B, C, h, w)``: the signal at rows and columns ``offset``, ``offset + stride``...
        geometry: of the whole picture, ``(B, ..., H, W)``.
        stride: pixels from sample to sample.
        offset: first row and column that has a sample.
        clear: what each channel holds where nothing was hit; by default 0.
        compiled: see `gbufrt.compute.dispatch.form_of`.

    Returns:
        ``(B, C, H, W)``.

    Source: Kopf et al. 2007, "Joint Bilateral Upsampling"; weights by plane distance and normal as in SVGF.
    """
    empty = resident((0.0,) * low.shape[1] if clear is None else tuple(clear), low)
    if form_of(low, geometry.guide, geometry.plane, compiled=compiled, cuda=True) is Form.REFERENCE:
        return upsample_reference(low, geometry, stride, offset, empty)
    return upsample_cpu(low, geometry.guide, geometry.plane, empty, stride, *offset, geometry.perspective)


@operator("gbufrt::upsample")
def upsample_cpu(
    low: Tensor, guide: Tensor, plane: Tensor, clear: Tensor, stride: int, row: int, column: int, perspective: bool
) -> Tensor:
    """``(B, C, H, W)``. See `upsample`; tensors are those of `Surface`."""
    from gbufrt.compute.kernel import array, threads
    from post.upsampling.drivers import upsampled_each, upsampled_rows

    out = low.new_empty(*low.shape[:2], *guide.shape[2:])
    if form_of(low, cuda=True) is Form.CUDA:
        upsampled_each(out[:, 0].numel(), out, low, guide, plane, clear, stride, row, column, perspective)
    else:
        there = guide[:, :ROUGHNESS, row::stride, column::stride]
        pictures = (array(t) for t in (out, low, guide, there, plane, clear))
        upsampled_rows(*pictures, stride, row, column, perspective, threads())
    return out


@upsample_cpu.register_fake
def _(low, guide, plane, clear, stride, row, column, perspective):
    return low.new_empty(*low.shape[:2], *guide.shape[2:])
