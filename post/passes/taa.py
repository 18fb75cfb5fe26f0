"""Temporal anti-aliasing of a jittered camera."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt import Frame, GBuffer, History, TemporalPass
from gbufrt.mending import finite
from gbufrt.sampling import inside, sample
from post.filters.edges import offsets, padded, windows
from post.filters.signals import luminance
from post.history.catmull_rom import catmull_rom
from post.history.reproject import geometry_of, history_for, motion_of

WINDOW = -4.0  # exp of this times squared pixels: a Blackman-Harris window narrowed until it nears a pixel's area
BRIGHTEST = 1.0 - 1e-6  # of tone-mapped luminance


def taa(
    color: Tensor,
    gbuffer: GBuffer,
    history: History | None = None,
    *,
    blend: float = 0.93,
    gamma: float = 1.25,
) -> tuple[Tensor, History]:
    """Average jittered frames into one anti-aliased picture on the grid without jitter.

    Each frame is resampled to pixel centres by a narrow Gaussian window around its jittered samples. The history is
    read with Catmull-Rom weights along the motion of the nearest surface in 3x3, and clipped in YCoCg to the mean and
    variance of the current 3x3 pixels. All colours are weighted by 1 / (1 + luminance), so that bright edges are
    anti-aliased as they will be displayed.

    Args:
        color: ``(B, 3, H, W)`` linear radiance.
        gbuffer: of this frame; its camera holds the jitter.
        history: what this function returned for the frame before; None at first.
        blend: largest share of history.
        gamma: standard deviations to which the history is clipped.

    Returns:
        ``(B, 3, H, W)`` linear radiance and the history for the next frame.

    Raises:
        ValueError: blend lies outside 0 to 1, or the history has another size than the frame.

    Source: Karis 2014; Salvi 2016 (variance clipping); Jimenez 2016 (Catmull-Rom history).
    """
    if not 0.0 <= blend <= 1.0:
        raise ValueError(f"blend must lie in 0 to 1, got {blend}")
    if history is not None and history.length.shape != gbuffer.depth.shape:
        raise ValueError(
            f"the history must be {tuple(gbuffer.depth.shape)} like the frame, got {tuple(history.length.shape)}; "
            "start with state=None after a change of size"
        )
    color = finite(color)  # the history would keep a bad pixel for ever
    toned = color / (1 + luminance(color).clamp_min(0.0))
    current = _resampled(toned, gbuffer)
    length = torch.ones_like(gbuffer.depth)
    if history is not None and history.gbuffer is not None:
        px = gbuffer.camera.pixel_centers(jittered=False, dtype=color.dtype)
        px = px + _dilated(motion_of(gbuffer, history.gbuffer.camera)[0], gbuffer)
        visible = inside(px, gbuffer.camera.size) & (sample(history.length, px, mode="nearest") > 0)
        age = torch.where(visible, sample(history.length, px, mode="nearest"), 0.0)
        old = _clipped(catmull_rom(history.signals["toned"], px), toned, current, gamma)
        length = (age + 1).clamp_max(1 / max(1 - blend, 1e-9))
        current = torch.where(visible, old + (current - old) / length, current)
    result = current / (1 - luminance(current).clamp(0.0, BRIGHTEST))
    return result, History(length=length, signals={"toned": current}, gbuffer=geometry_of(gbuffer))


def _resampled(image: Tensor, gbuffer: GBuffer) -> Tensor:
    """The picture at pixel centres, from samples that lie beside them."""
    jitter = gbuffer.camera.jitter
    if jitter is None:
        return image
    place = jitter.to(image.dtype)[:, :, None, None]
    ones = windows(padded(torch.ones_like(image[:, :1]), 1), 1)
    total, result = torch.zeros_like(image[:, :1]), torch.zeros_like(image)
    for (dy, dx), tap, there in zip(offsets(1), windows(padded(image, 1), 1), ones, strict=True):
        away = (place[:, 0:1] + dx) ** 2 + (place[:, 1:2] + dy) ** 2
        weight = torch.exp(WINDOW * away) * there
        total, result = total + weight, result + weight * tap
    return result / total


def _dilated(motion: Tensor, gbuffer: GBuffer) -> Tensor:
    """Motion of the nearest surface among 3x3: an edge moves with the surface in front."""
    height, width = gbuffer.camera.size
    far = torch.where(gbuffer.hit, gbuffer.depth, gbuffer.camera.far * 2)
    padded = F.pad(far, (1, 1, 1, 1), value=float("inf"))
    moved = F.pad(motion, (1, 1, 1, 1))
    nearest, result = far, motion
    for dy, dx in offsets(1):
        y, x = slice(1 + dy, 1 + dy + height), slice(1 + dx, 1 + dx + width)
        closer = padded[..., y, x] < nearest
        nearest = torch.where(closer, padded[..., y, x], nearest)
        result = torch.where(closer, moved[..., y, x], result)
    return result


def _clipped(old: Tensor, toned: Tensor, current: Tensor, gamma: float) -> Tensor:
    """Move the history toward the mean of the neighbourhood until it lies in its box in YCoCg."""
    around = _ycocg(F.pad(toned, (1, 1, 1, 1), mode="replicate"))
    mean = F.avg_pool2d(around, 3, stride=1)
    spread = (F.avg_pool2d(around * around, 3, stride=1) - mean * mean).clamp_min(0.0).add(1e-12).sqrt()
    extent = torch.maximum(gamma * spread, (_ycocg(current) - mean).abs())
    away = _ycocg(old) - mean
    outside = (away.abs() / extent.clamp_min(1e-6)).amax(dim=1, keepdim=True).clamp_min(1.0)
    return _rgb(mean + away / outside)


def _ycocg(rgb: Tensor) -> Tensor:
    r, g, b = rgb[:, 0:1], rgb[:, 1:2], rgb[:, 2:3]
    return torch.cat([0.25 * r + 0.5 * g + 0.25 * b, 0.5 * (r - b), 0.5 * g - 0.25 * (r + b)], dim=1)


def _rgb(ycocg: Tensor) -> Tensor:
    y, co, cg = ycocg[:, 0:1], ycocg[:, 1:2], ycocg[:, 2:3]
    return torch.cat([y + co - cg, y + cg, y - co - cg], dim=1)


class TAA(TemporalPass):
    """Anti-alias ``color``. See `taa`.

    Args:
        blend: see `taa`.
        gamma: see `taa`.
    """

    reads = frozenset({"depth", "hit", "color"})
    optional = frozenset({"motion"})
    writes = frozenset({"color"})

    def __init__(self, *, blend: float = 0.93, gamma: float = 1.25) -> None:
        super().__init__()
        self.blend = blend
        self.gamma = gamma

    def forward(self, frame: Frame, state: History | None = None) -> tuple[Frame, History]:
        history = history_for(state, frame.cut)
        color, state = taa(frame.read("color"), frame.gbuffer, history, blend=self.blend, gamma=self.gamma)
        return frame.replace(color=color), state
