"""Temporal upscaling of a jittered camera: a small picture a frame, a large one from many."""

from __future__ import annotations

from typing import NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt import Frame, GBuffer, History, TemporalPass
from gbufrt.mending import finite
from gbufrt.sampling import inside, pixel_centers, sample
from post.filters.signals import luminance
from post.history.constants import BRIGHTEST
from post.history.reproject import geometry_of, history_for, motion_of
from post.shading.composite_op import specular_albedo
from post.upsampling.accumulate import (
    SLOW,
    STEADY,
    clipped,
    gathered,
    held,
    light_around,
    locked,
    mean_weight,
    same_light,
)
from post.upsampling.motion import upscaled_motion
from post.upsampling.samples import Samples
from post.upsampling.sharpen import sharpened
from post.upsampling.spline import spline_coefficients, spline_read

MOST_RATIO = 4.0
SMOOTH = 0.5  # perceptual roughness from which on reflections are too blurred for their motion to show
WIDER = 8.0  # standard deviations that a lock adds to the box of what else is clipped
BETWEEN = 0.4  # share of a history's weight that is lost when it is read half way between pixels, for what that blurs


def upscale(
    color: Tensor,
    gbuffer: GBuffer,
    history: History | None = None,
    *,
    reactive: Tensor | None = None,
    ratio: float = 2.0,
    frames: float = 32.0,
    gamma: float = 2.0,
    lock: float = 1.0,
    stability: float = 1.0,
    sharpness: float = 0.0,
) -> tuple[Tensor, History]:
    """Average jittered frames into one anti-aliased picture of ``ratio`` times their sides.

    Every sample counts for the pixels of the large picture by how near it lies to them. The history is read through a
    spline, where the surface in front was, and clipped in YCoCg to mean and variance of the samples around. Thin
    features, which the samples often miss, are locked: they are not clipped until light changes. The box is wider where
    clipping moves history to and fro, which would flicker. All colours are weighted by 1 / (1 + luminance).

    The camera's jitter should take at least 8 x ratio squared places before it repeats, see `halton_jitter`.

    Args:
        color: ``(B, 3, h, w)`` linear radiance.
        gbuffer: of this frame; its camera holds the jitter.
        history: what this function returned for the frame before; None at first.
        reactive: ``(B, 1 or 3, h, w)`` in [0, 1]: how much less history each channel may hold, for what motion does
            not tell of, such as reflections and animated textures; 1 for none.
        ratio: sides of the result over those of the frame, 1 to 4.
        frames: longest history.
        gamma: standard deviations to which the history is clipped.
        lock: share of the clipping that thin features are spared; 0 locks nothing.
        stability: standard deviations that the box is wider by where clipping alternates.
        sharpness: 0 to 1 of the sharpening after all, which the history does not see.

    Returns:
        ``(B, 3, H, W)`` linear radiance, H and W being ``ratio`` x h and w, rounded; and the history. Gradients pass
        through light alone.

    Raises:
        ValueError: a number is out of its range, or a shape does not fit.

    Source: the method of AMD FidelityFX FSR 2, 2022; Karis 2014; Salvi 2016. Planes carried on and splines are our own.
    """
    _check(color, gbuffer, reactive, ratio, frames, sharpness)
    size = round(color.shape[-2] * ratio), round(color.shape[-1] * ratio)
    if history is not None and tuple(history.length.shape[-2:]) != size:
        raise ValueError(f"the history must be {size}, got {tuple(history.length.shape[-2:])}; start with state=None")
    color = finite(color)
    toned = color / (1 + luminance(color).clamp_min(0.0))
    at, around = Samples.of((color.shape[-2], color.shape[-1]), size, gbuffer.camera.jitter, toned), light_around(toned)
    before = _read(toned, gbuffer, history, at, size, around)
    now = gathered(toned, at, before.weight)
    result, drift, wobble = now.color, before.drift, before.wobble
    if before.color is not None:
        react = torch.zeros_like(drift) if reactive is None else at.between(_spread(reactive.to(toned)))
        spared = lock * before.locks[:, :1] * (1 - react.amax(1, keepdim=True))
        calm = (1 - drift.abs() / wobble.clamp_min(STEADY)).clamp(0, 1) * (wobble > STEADY)
        kept, moved = clipped(before.color, now, gamma + WIDER * spared + stability * calm)
        drift, wobble = torch.lerp(drift, moved.detach(), SLOW), torch.lerp(wobble, moved.detach().abs(), SLOW)
        most = torch.minimum(before.weight, (1 - react) * frames * mean_weight(at))
        result = torch.lerp(torch.lerp(kept, before.color, spared), now.color, now.weight / (most + now.weight))
    locks = locked(before.locks, toned, at, now.weight, before.depth, before.motion)
    signals = {"toned": result, "planes": torch.cat([drift, wobble, locks], dim=1), "around": around}
    length = (before.weight + now.weight).clamp_max(frames * mean_weight(at))
    shown = sharpened(result, sharpness) if sharpness else result
    light = shown / (1 - luminance(shown).clamp(0.0, BRIGHTEST))
    return light, History(length=length, signals=signals, gbuffer=geometry_of(gbuffer))


class _Before(NamedTuple):
    """What a history holds for each pixel of the large picture, and where that is now."""

    color: Tensor | None
    weight: Tensor
    drift: Tensor
    wobble: Tensor
    locks: Tensor
    depth: Tensor
    motion: Tensor


def _read(
    toned: Tensor, g: GBuffer, history: History | None, at: Samples, size: tuple[int, int], around: Tensor
) -> _Before:
    none = toned.new_zeros(toned.shape[0], 1, *size)
    if history is None or history.gbuffer is None:
        depth, motion = at.nearest(g.depth.detach().to(toned)), none.expand(-1, 2, -1, -1)
        return _Before(None, none, none, none, torch.cat([none, depth, motion], dim=1), depth, motion)
    there, seen, depth, depth_before = upscaled_motion(g, history.gbuffer, at, size)
    motion = there - pixel_centers(there)
    read = sample(torch.cat([history.length, history.signals["planes"]], dim=1), there)
    weight, drift, wobble, locks = read.split((1, 1, 1, 4), dim=1)
    between = (there - 0.5) - torch.floor(there - 0.5)
    weight = weight * (1 - BETWEEN * (4 * between * (1 - between)).mean(1, keepdim=True))
    weight = torch.where(inside(there, size) & seen, weight, 0.0)
    alike = same_light(around, history.signals["around"], motion_of(g, history.gbuffer.camera)[0])
    locks = held(locks, depth, depth_before, motion)
    locks = torch.cat([locks[:, :1] * (weight > 0) * at.between(alike), locks[:, 1:]], dim=1)
    color = spline_read(spline_coefficients(history.signals["toned"]), there)
    return _Before(color, weight, drift, wobble, locks, depth, motion)


def reactive_mask(g: GBuffer, *, reactivity: float = 1.0) -> Tensor:
    """How much of what a pixel shows does not move with its surface: what is behind glass and water, and in mirrors.

    Args:
        g: with ``transmittance``, ``roughness`` and ``metallic``, as far as there are any.
        reactivity: factor on the share.

    Returns:
        ``(B, 1, H, W)`` in [0, 1], without gradient.
    """
    share = torch.zeros_like(g.depth)
    if g.transmittance is not None:
        share = g.transmittance.detach().mean(1, keepdim=True)
    if g.roughness is not None:
        smooth = (1 - g.roughness.detach() / SMOOTH).clamp(0, 1)
        share = share + smooth * specular_albedo(g).detach()
    return torch.where(g.hit, share * reactivity, 0.0).clamp(0, 1)


def _spread(mask: Tensor) -> Tensor:
    return F.max_pool2d(F.pad(mask, (1, 1, 1, 1), mode="replicate"), 3, stride=1)


def _check(color: Tensor, g: GBuffer, reactive: Tensor | None, ratio: float, frames: float, sharpness: float) -> None:
    shape = tuple(g.depth.shape)
    if color.shape != (shape[0], 3, *shape[2:]):
        raise ValueError(
            f"color must be ({shape[0]},3,{shape[2]},{shape[3]}) like the G-buffer, got {tuple(color.shape)}"
        )
    if reactive is not None and (reactive.shape[1] not in (1, 3) or reactive[:, :1].shape != g.depth.shape):
        wanted = f"({shape[0]},1 or 3,{shape[2]},{shape[3]})"
        raise ValueError(f"reactive must be {wanted} like the G-buffer, got {tuple(reactive.shape)}")
    if not 1.0 <= ratio <= MOST_RATIO:
        raise ValueError(f"ratio must lie in 1 to {MOST_RATIO:g}, got {ratio}")
    if not frames >= 1.0:
        raise ValueError(f"frames must be at least 1, got {frames}")
    if not 0.0 <= sharpness <= 1.0:
        raise ValueError(f"sharpness must lie in 0 to 1, got {sharpness}")


class Upscale(TemporalPass):
    """Upscale ``color``, which is then larger than the G-buffer. See `upscale`.

    Stages that follow run in a pipeline with ``reduction=post.Enlarged()``. The signal ``reactive`` is used where the
    frame has it, else `reactive_mask`.

    Args:
        ratio: see `upscale`, as the rest.
        reactivity: see `reactive_mask`; 0 for light without reflections.
    """

    reads = frozenset({"depth", "hit", "normal", "color"})
    optional = frozenset({"motion", "motion_z", "reactive", "transmittance", "roughness", "metallic"})
    writes = frozenset({"color"})

    def __init__(
        self,
        *,
        ratio: float = 2.0,
        frames: float = 32.0,
        gamma: float = 2.0,
        lock: float = 1.0,
        stability: float = 1.0,
        sharpness: float = 0.0,
        reactivity: float = 0.5,
    ) -> None:
        super().__init__()
        self.ratio, self.frames, self.gamma = ratio, frames, gamma
        self.lock, self.stability, self.sharpness, self.reactivity = lock, stability, sharpness, reactivity

    def forward(self, frame: Frame, state: History | None = None) -> tuple[Frame, History]:
        tunables = self.tunables()
        reactivity, reactive = tunables.pop("reactivity"), frame.get("reactive")
        if reactive is None and reactivity:
            reactive = reactive_mask(frame.gbuffer, reactivity=reactivity)
        history = history_for(state, frame.cut)
        color, state = upscale(frame.read("color"), frame.gbuffer, history, reactive=reactive, **tunables)
        return frame.replace(color=color), state
