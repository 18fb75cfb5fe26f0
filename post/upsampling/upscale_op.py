"""Temporal upscaling as a torch operator: kernels on the CPU and on CUDA, the torch reference elsewhere."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt import Camera
from gbufrt.compute.dispatch import Form, form_of
from gbufrt.compute.operators import operator
from gbufrt.compute.resident import resident
from gbufrt.luminance import luminance
from post.history.constants import WINDOW
from post.upsampling.accumulate import mean_weight
from post.upsampling.constants import BOX_WINDOW
from post.upsampling.samples import Samples
from post.upsampling.upscale_reference import Large, Small, Tunables, upscaled_reference


def upscaled(
    small: Small,
    before: Large,
    at: Samples,
    camera: Camera,
    previous: Camera,
    tunables: Tunables,
    *,
    compiled: bool | None = None,
) -> tuple[Tensor, Large]:
    """Put one small jittered frame into the history of a large picture; see `post.upscale`.

    Args:
        small: this frame.
        before: the history.
        at: the samples about each pixel of the large picture.
        camera: of this frame, small.
        previous: of the frame before, small.
        tunables: see `post.upscale`.
        compiled: see `gbufrt.compute.dispatch.form_of`.

    Returns:
        ``(B, 3, H, W)`` linear radiance, and the history after this frame.
    """
    if form_of(*small, *before, *tunables, compiled=compiled, cuda=True) is Form.REFERENCE:
        return upscaled_reference(small, before, at, camera, previous, tunables)
    planes = torch.cat([small.surfaces, small.alike, small.features, small.mirrored, small.reactive], dim=1).detach()
    tables = [axis_table(at, axis, small.toned.shape[-1 - axis]) for axis in (0, 1)]
    size, numbers = (before.length.shape[-2], before.length.shape[-1]), [float(number) for number in tunables]
    light = F.pad(luminance(small.toned.detach()), (2, 2, 2, 2), mode="replicate")
    motion = F.pad(small.motion.detach(), (1, 1, 1, 1), mode="replicate")
    found = upscaled_cpu(
        small.toned, light, motion, planes, small.depths, *before, *tables, _lenses(camera, previous, at, size),
        camera.orthographic, *numbers, mean_weight(at),
    )  # fmt: skip
    return found[0], Large(*found[1:])


def axis_table(at: Samples, axis: int, limit: int) -> Tensor:
    """``(B, 8, N)``, of the columns (axis 0) or rows (1) of a large picture: number of the nearest sample; what it and
    those before and after it weigh in the box; what the nearest one counts for a lock; the column's own place, from the
    first sample on; how many pixels away the nearest is, and each from the next.

    Args:
        at: the samples.
        axis: 0 or 1.
        limit: how many samples there are along it.
    """
    ratio = at.ratio[axis]
    index, away = (at.x[:, 0], at.away[:, 0, 0]) if axis == 0 else (at.y[:, :, 0], at.away[:, 1, :, 0])
    taps = torch.stack([away + step * ratio for step in (-1, 0, 1)], dim=1).square()
    place = (index - away / ratio).clamp(0, limit - 1)
    rows = [index, away.square().mul(WINDOW / 2).exp(), place, away, torch.full_like(away, ratio)]
    number, lock, place, away, step = (row.to(away)[:, None] for row in rows)
    box = (taps * (BOX_WINDOW / (at.ratio[0] * at.ratio[1]))).exp()
    return torch.cat([number, box, lock, place, away, step], dim=1)


def _lenses(camera: Camera, previous: Camera, at: Samples, size: tuple[int, int]) -> Tensor:
    """``(B, 26)``: focal lengths and principal point at the size of the large picture; rotation and shift to the view
    of the frame before; its focal lengths and principal point; its jitter, in small pixels; the ratios; and this
    frame's jitter."""
    now, before = camera.resized(size).lens[:, :4], previous.resized(size).lens[:, :4]
    way = previous.view_from_world.double() @ camera.world_from_view.double()
    ratio = resident(at.ratio, now).expand(camera.batch, 2)
    parts = [now, way[:, :3, :3].flatten(1), way[:, :3, 3], before, previous.lens[:, 4:], ratio, camera.lens[:, 4:]]
    return torch.cat([part.float() for part in parts], dim=1)


@operator("gbufrt::upscale")
def upscaled_cpu(
    toned: Tensor, luma: Tensor, motion: Tensor, planes: Tensor, depths: Tensor, old: Tensor, length: Tensor,
    kept: Tensor, across: Tensor, down: Tensor, lenses: Tensor, orthographic: bool, gamma: float,
    frames: float, lock: float, stability: float, weight: float,
) -> tuple[Tensor, Tensor, Tensor, Tensor]:  # fmt: skip
    """See `upscaled`: light, and the three of `Large`; ``weight`` is what a frame's samples weigh in the mean.

    ``luma`` and ``motion`` reach two and one pixels beyond the small picture.
    """
    from gbufrt.compute.kernel import array, replaced, threads
    from post.upsampling.drivers import sample_rows, samples_each, upscaled_each, upscaled_rows
    from post.upsampling.upscale_history_kernel import MIRRORED
    from post.upsampling.upscale_samples_kernel import SEEN

    light, new, lengths, news = (
        torch.empty_like(like, memory_format=torch.contiguous_format) for like in (old, old, length, kept)
    )
    seen = toned.new_empty(toned.shape[0], SEEN, *toned.shape[2:])
    size, low = (length.shape[-2], length.shape[-1]), (toned.shape[-2], toned.shape[-1])
    flat = [x.flatten(2) for x in (toned, planes, depths, old, seen, length, kept)]
    flat[5] = flat[5][:, 0]
    pictures = light, new, lengths[:, 0], news, *flat
    samples = seen, flat[3], flat[5], planes[:, MIRRORED], size, luma[:, 0], motion, lenses
    numbers = orthographic, low, gamma, frames, lock, stability, weight
    if form_of(old, cuda=True) is Form.CUDA:
        samples_each(seen[:, 0].numel(), *samples)
        upscaled_each(new[:, 0].numel(), *pictures, across, down, lenses, *numbers)
    else:
        sample_rows(*replaced(samples, array), threads())
        upscaled_rows(*replaced((*pictures, across, down, lenses), array), *numbers, threads())
    return light, new, lengths, news


@upscaled_cpu.register_fake
def _(toned, luma, motion, planes, depths, old, length, kept, *_):
    return torch.empty_like(old), torch.empty_like(old), torch.empty_like(length), torch.empty_like(kept)
