"""Which pixels of smooth metals show sky or lamps that a frame's direct light holds already."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt import Frame
from gbufrt.luminance import luminance
from gbufrt.specular import MIRROR_ROUGHNESS
from post.mirrors.image import METAL

FAINT = 0.5  # of what such pixels usually show: less may be what filters have left of those beside
LEAST = 0.3  # of that: so much such filters leave
TINY = 1e-12


def without_shown(reflection: Tensor, confidence: Tensor, frame: Frame) -> Tensor:
    """Reflections ``(B, 3, H, W)``; of those beyond the picture, without what the frame's light holds already.

    Args:
        reflection: linear radiance.
        confidence: ``(B, 1, H, W)`` share of it that was found on screen.
        frame: as `shown_already`; one that is not ``emitters_mirrored``, or lacks metals, holds nothing of them.
    """
    if not frame.emitters_mirrored or frame.gbuffer.metallic is None:
        return reflection
    return reflection * (1 - shown_already(frame) * (1 - confidence))


def shown_already(frame: Frame) -> Tensor:
    """Share of a mirror's rays that the sky or a lamp ended, as the frame's light tells (``emitters_mirrored``).

    A smooth metal scatters nothing: what its direct light is not black from, its rays have met. Where surfaces end
    inside a pixel, the share is what its light is of the brightest pixel beside it, if that is no brighter than usual.

    Args:
        frame: needs ``radiance``, ``roughness`` and ``metallic``.

    Returns:
        ``(B, 1, H, W)`` in [0, 1].
    """
    g, light = frame.gbuffer, luminance(frame.read("radiance"))
    smooth = g.hit & (frame.read("roughness") < MIRROR_ROUGHNESS) & (frame.read("metallic") > METAL)
    light = torch.where(smooth, light, 0.0).clamp_min(0.0)
    lit = (light > 0).to(light)
    mean = light.sqrt().sum((2, 3), keepdim=True) / lit.sum((2, 3), keepdim=True).clamp_min(1.0)
    usual = mean.square()  # of roots, which a few lamps do not drive up
    whole = torch.minimum(F.max_pool2d(light, 3, 1, 1), usual).maximum(FAINT * usual)
    return ((light / whole.clamp_min(TINY) - LEAST) / (1 - LEAST)).clamp(0.0, 1.0)
