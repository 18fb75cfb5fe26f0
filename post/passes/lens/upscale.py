"""Temporal upscaling of a jittered camera: a small picture a frame, a large one from many."""

from __future__ import annotations

import math

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt import Frame, GBuffer, History, TemporalPass
from gbufrt.compute.resident import waits
from gbufrt.demands.pictures import check_alike, check_pictures
from gbufrt.history import check_history
from gbufrt.luminance import luminance
from gbufrt.mending import finite
from gbufrt.numeric import check_between, check_kind
from post.display.sharpen import sharpened
from post.history.reproject import history_for, motion_of
from post.shading.composite_op import specular_albedo
from post.upsampling.accumulate import light_around, same_light, thin_features
from post.upsampling.motion import depths_before, moving_surfaces
from post.upsampling.samples import Samples
from post.upsampling.upscale_op import upscaled
from post.upsampling.upscale_reference import Large, Small, Tunables, begun, light_of

MOST_RATIO = 4.0
DIM = 0.06  # geometric mean of luminance: darker pictures are averaged as if they were as bright
MOST_BRIGHTER = 8.0  # times: beyond it lamps come too near to the end of the tone curve
DRIFT = 0.75  # stops by which that factor may be off until it changes, which the whole history then does
EVEN = 2.0  # factor on the share of mirrored light, up to 1
SMOOTH = 0.5  # perceptual roughness from which on reflections are too blurred for their motion to show


def upscale(
    color: Tensor,
    gbuffer: GBuffer,
    history: History | None = None,
    *,
    reactive: Tensor | None = None,
    mirrored: Tensor | None = None,
    ratio: float = 2.0,
    frames: float = 32.0,
    gamma: float = 1.5,
    lock: float = 1.0,
    stability: float = 1.0,
    sharpness: float = 0.0,
) -> tuple[Tensor, History]:
    """Average jittered frames into one anti-aliased picture of ``ratio`` times their sides.

    Every sample counts for the pixels of the large picture by how near it lies to them; along an edge, which the
    history shows once it has samples enough, it counts farther than across it. What a history shows at a pixel and not
    where the samples lie is added to them, so that they do not blur it. The history is read where the surface in front
    was, with steps and slopes inside its pixels so that edges stay sharp, and clipped in YCoCg to mean and variance of
    the samples around, the less the more frames it holds; its weight falls by what clipping changes, and where
    neighbours move otherwise. Thin features, which the samples often miss, are locked: they are not clipped until light
    changes. The box is wider where clipping moves history to and fro, which would flicker. Where the light of an area
    changes, its history ends. All colours are weighted by 1 / (1 + luminance), that of dim pictures as if it were
    exposed.

    The camera's jitter should take at least 8 x ratio squared places before it repeats, see `halton_jitter`.

    Args:
        color: ``(B, 3, h, w)`` linear radiance.
        gbuffer: of this frame; its camera holds the jitter.
        history: what this function returned for the frame before; None at first.
        reactive: ``(B, 1 or 3, h, w)`` in [0, 1]: how much less history each channel may hold, for what motion does
            not tell of, such as reflections and animated textures; 1 for none.
        mirrored: ``(B, 1, h, w)`` in [0, 1]: share of the light that smooth surfaces mirror. It changes over areas, and
            samples there count alike for all pixels around, which else stood out as a grid, and histories are clipped
            in boxes of down to half the sides; None for none.
        ratio: sides of the result over those of the frame, 1 to 4.
        frames: longest history.
        gamma: standard deviations to which the history is clipped, three times as many for one that is new and five
            times as many for one of 12 frames.
        lock: share of the clipping that thin features are spared; 0 locks nothing.
        stability: standard deviations that are added to ``gamma`` where clipping alternates.
        sharpness: 0 to 1 of the sharpening after all, which the history does not see.

    Returns:
        ``(B, 3, H, W)`` linear radiance, H and W being ``ratio`` x h and w, rounded; and the history. Gradients pass
        through light alone.

    Raises:
        TypeError: what must be a tensor is none, or kinds of floats are mixed.
        ValueError: a number is out of its range, or a shape does not fit.

    Source: the method of AMD FidelityFX FSR 2, 2022; Karis 2014; Salvi 2016; kernels along edges by Wronski et al.
    2019; samples compared with what the history shows there by Irani and Peleg 1991; steps in pixels by Hirt and
    Nichols 1981, slopes by van Leer 1977. Planes carried on are our own.
    """
    check_history(gbuffer, history, "toned", "planes", "around", "level")
    _check(ratio, frames, gamma, lock, stability, sharpness)
    check_pictures(gbuffer.camera, depth=gbuffer.depth, color=color)
    check_alike("color", color=color, reactive=reactive, mirrored=mirrored)
    size = round(color.shape[-2] * float(ratio)), round(color.shape[-1] * float(ratio))
    if history is not None and tuple(history.length.shape[-2:]) != size:
        raise ValueError(f"the history must be {size}, got {tuple(history.length.shape[-2:])}; start with state=None")
    color = finite(color)
    level, brighter = brightness(color, history)
    toned = color * level / (1 + luminance(color).clamp_min(0.0) * level)
    at = Samples.of((color.shape[-2], color.shape[-1]), size, gbuffer.camera.jitter, toned)
    around, features = light_around(toned), thin_features(toned)
    if history is None or history.gbuffer is None:
        large = begun(toned, features, gbuffer.depth, at, size, frames)
        light = light_of(large.toned)
    else:
        past, before = _before(history, brighter)
        previous, react = history.gbuffer.camera, toned[:, :0] if reactive is None else _spread(reactive.to(toned))
        even = torch.zeros_like(around) if mirrored is None else (EVEN * _spread(mirrored.to(toned))).clamp(0, 1)
        motion = motion_of(gbuffer, previous)[0]
        alike = same_light(around, past, motion)
        surfaces, depths = moving_surfaces(gbuffer, previous), depths_before(history.gbuffer)
        small = Small(toned, surfaces, depths, alike, features, motion.detach().to(toned), even, react)
        tunables = Tunables(gamma, frames, lock, stability)
        light, large = upscaled(small, before, at, gbuffer.camera, previous, tunables)
    if sharpness:
        light = light_of(sharpened(large.toned, sharpness))
    signals = {"toned": large.toned, "planes": large.planes, "around": around, "level": level}
    return light / level, History(length=large.length, signals=signals, gbuffer=gbuffer.geometry())


def brightness(color: Tensor, history: History | None) -> tuple[Tensor, Tensor]:
    """What light is multiplied by before it is tone-mapped, ``(B, 1, 1, 1)``, and that over what the history was.

    Edges of what is shown brighter than it is would else be averaged as those of dim light are, nearly linear, and have
    steps after exposure and tone curve.

    Args:
        color: ``(B, 3, h, w)`` linear radiance.
        history: see `upscale`.
    """
    mean = luminance(color.detach()).clamp_min(1e-4).log().mean((1, 2, 3), keepdim=True).exp()
    level = (DIM / mean).clamp(1.0, MOST_BRIGHTER)
    if history is None or history.gbuffer is None:
        return level, torch.ones_like(level)
    was = history.signals["level"]
    known = was > 0  # a history that was reset has none
    stays = known & ((level / was.clamp_min(1e-6)).log2().abs() < DRIFT)
    level = torch.where(stays, was, level)
    return level, torch.where(known, level / was.clamp_min(1e-6), 1.0)


def toned_again(toned: Tensor, luma: Tensor, brighter: Tensor) -> Tensor:
    """Tone-mapped colours, or their ``luma``, of light that is ``brighter`` by a factor."""
    return toned * brighter / (1 + (brighter - 1) * luma.clamp(0.0, 1.0))


def _before(history: History, brighter: Tensor) -> tuple[Tensor, Large]:
    """The light around pixels of the small picture, and the history, as if light had been ``brighter`` by a factor."""
    around, toned = history.signals["around"], history.signals["toned"]
    if waits(brighter) or bool((brighter != 1).any()):
        around, toned = toned_again(around, around, brighter), toned_again(toned, luminance(toned), brighter)
    return around, Large(toned, history.length, history.signals["planes"])


def reactive_mask(g: GBuffer, *, reactivity: float = 1.0) -> Tensor:
    """How much of what a pixel shows does not move with its surface: what is behind glass and water, and in mirrors.

    Args:
        g: with ``transmittance``, ``roughness`` and ``metallic``, as far as there are any.
        reactivity: factor on the share, at least 0.

    Returns:
        ``(B, 1, H, W)`` in [0, 1], without gradient.

    Raises:
        TypeError: ``g`` is no G-buffer, or ``reactivity`` no number.
        ValueError: ``reactivity`` is negative.

    Source: AMD FidelityFX FSR 2, 2022, for what a reactive mask is; the share, by what a surface lets through and
    mirrors, is our own.
    """
    check_kind(GBuffer, "g", g, "; frame.gbuffer is one")
    check_between(0, math.inf, reactivity=reactivity)
    share = torch.zeros_like(g.depth)
    if g.transmittance is not None:
        share = g.transmittance.detach().mean(1, keepdim=True)
    if g.roughness is not None:
        smooth = (1 - g.roughness.detach() / SMOOTH).clamp(0, 1)
        share = share + smooth * specular_albedo(g).detach()
    return torch.where(g.hit, share * reactivity, 0.0).clamp(0, 1)


def mirrored_share(frame: Frame) -> Tensor | None:
    """``(B, 1, h, w)`` in [0, 1]: share of ``color`` that smooth surfaces mirror; None where there is no reflection."""
    roughness, mirrored = frame.gbuffer.roughness, frame.reflection
    if roughness is None or mirrored is None:
        return None
    share = luminance(mirrored) / luminance(frame.read("color")).clamp_min(1e-6)
    return torch.where(frame.gbuffer.hit, share * (1 - roughness.detach() / SMOOTH).clamp(0, 1), 0.0).clamp(0, 1)


def _spread(mask: Tensor) -> Tensor:
    return F.max_pool2d(F.pad(mask, (1, 1, 1, 1), mode="replicate"), 3, stride=1)


def _check(ratio: float, frames: float, gamma: float, lock: float, stability: float, sharpness: float) -> None:
    check_between(1, MOST_RATIO, ratio=ratio)
    check_between(1, math.inf, frames=frames)
    check_between(0, 1, sharpness=sharpness, lock=lock)
    check_between(0, math.inf, gamma=gamma, stability=stability)


class Upscale(TemporalPass):
    """Upscale ``color``, which is then larger than the G-buffer. See `upscale`.

    Stages that follow run in a pipeline with ``reduction=post.Enlarged()``. The signal ``reactive`` is used where the
    frame has it, else `reactive_mask`.

    Args:
        ratio: see `upscale`, as the rest.
        reactivity: see `reactive_mask`; 0 for light without reflections.
    """

    reads = frozenset({"depth", "hit", "normal", "color"})
    optional = frozenset({"motion", "motion_z", "reactive", "transmittance", "roughness", "metallic", "reflection"})
    writes = frozenset({"color"})

    def __init__(
        self,
        *,
        ratio: float = 2.0,
        frames: float = 32.0,
        gamma: float = 1.5,
        lock: float = 1.0,
        stability: float = 1.0,
        sharpness: float = 0.0,
        reactivity: float = 0.5,
    ) -> None:
        super().__init__()
        self.ratio, self.frames, self.gamma = ratio, frames, gamma
        check_between(1, MOST_RATIO, ratio=ratio)
        self.lock, self.stability, self.sharpness, self.reactivity = lock, stability, sharpness, reactivity

    def forward(self, frame: Frame, state: History | None = None) -> tuple[Frame, History]:
        tunables = self.tunables()
        reactivity, reactive = tunables.pop("reactivity"), frame.get("reactive")
        if reactive is None and reactivity:
            reactive = reactive_mask(frame.gbuffer, reactivity=reactivity)
        history = history_for(state, frame.cut)
        color, masks = frame.read("color"), {"reactive": reactive, "mirrored": mirrored_share(frame)}
        color, state = upscale(color, frame.gbuffer, history, **masks, **tunables)
        return frame.replace(color=color), state
