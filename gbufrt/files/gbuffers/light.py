"""The light of another renderer's frame, and the share of its surfaces that light passes through."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt.files.gbuffers.depths import EDGE
from gbufrt.files.gbuffers.named import Light, Named
from gbufrt.files.gbuffers.sky import sky_lacks
from gbufrt.frame import Frame
from gbufrt.luminance import luminance
from gbufrt.validation.geometry import FEW

BLACK = 1e-3  # of albedo: no surface that scatters light is so dark
CYCLES_SKY = 1e9  # Cycles' sky lies ten times as far, no far plane does
ROUNDED = 1e-4  # of the mean light: negative light of less is what renderers leave that make a pass by subtraction
AROUND = 4  # pixels over which the light of what is black is averaged


def light_of(
    named: Named, size: tuple[int, int], whole: bool, hit: Tensor
) -> tuple[Tensor | None, Tensor | None, bool]:
    """Direct light, or else the finished picture; and whether the light holds sky and lamps as mirrors show them."""
    light, layers = named.light(whole=whole), named.layers
    if missing := lacking(named, light, size):
        warnings.warn(
            f"{layers.path} lacks {', '.join(missing)}: its direct light is without that part; render the pass too",
            stacklevel=4,
        )
    products = [torch.stack([layers.stack(keys, size) for keys in f]).prod(0) for f in light.products]
    finished = layers.stack(light.finished, size) if light.finished else None
    if not products:
        return None, finished, False
    direct = torch.stack(products).sum(0)
    small = direct > -ROUNDED * direct[direct.isfinite()].abs().mean()
    direct = torch.where(small, direct.clamp_min(0.0), direct)
    if finished is not None and sky_lacks(direct, finished, hit):
        text = f"direct light has no sky; that of {', '.join(light.finished)} is taken, which is the same"
        warnings.warn(f"{layers.path}: {text}", stacklevel=4)
        direct = torch.where(hit, direct, finished)
    return direct, None, light.mirrors


def opaque(albedo: Tensor | None, named: Named, size: tuple[int, int]) -> Tensor | None:
    """Albedo without the share that surfaces let through: a shader's own colour is that of glass too."""
    for names in named.profile.transmitted:
        keys = [named.find((name,), 3) for name in names]
        if albedo is not None and all(keys) and named.keys("albedo") != keys[1]:
            through, scattered = (named.layers.stack(k, size).nan_to_num(0.0).clamp_min(0.0) for k in keys)
            return torch.where(through > 0, albedo * scattered / (scattered + through), albedo)
    return albedo


def lacking(named: Named, light: Light, size: tuple[int, int]) -> list[str]:
    """The layers whose part of the direct light is missing: none is where what it would be multiplied by is black."""
    stack = named.layers.stack
    return [name for name, factors in light.lacking.items() if all(bool((stack(k, size) > 0).any()) for k in factors)]


def is_eevee(header: Mapping[str, Any], raw: Tensor, hit: Tensor) -> bool:
    """Whether a Blender file is EEVEE's, whose sky lies at the far plane; Cycles' at 1e10.

    Its mirrors show the sky where surfaces hide it too and, with ray tracing, those on screen, all in Glossy Direct.

    Args:
        header: of the file; that of Cycles says so, unless the compositor wrote it.
        raw: ``(1, 1, H, W)`` depth as the file has it.
        hit: ``(1, 1, H, W)`` bool.
    """
    if "BlenderMultiChannel" not in header or any(key.startswith("cycles.") for key in header):
        return False
    return bool((~hit).any()) and 0 < float(raw[~hit].max()) < CYCLES_SKY  # 0 lies beside a crop


def ended_line(frame: Frame) -> str:
    """What to say of light none of whose channels exceeds 1, and some, one apart from the others, end there; else "".

    Lamps and skies may be 1 in all channels. Only a picture made for display has colours with a single one cut off.
    """
    light = frame.composite if frame.radiance is None else frame.radiance
    if light is None or float(light.nan_to_num(0.0).max()) != 1:
        return ""
    ends = (light == 1).sum(1, keepdim=True)
    if int(((ends > 0) & (ends < light.shape[1]) & frame.gbuffer.hit).sum()) < FEW:
        return ""
    return "light is cut off at 1, as in pictures for display: write linear light, without a view transform"


def explained(albedo: Tensor, light: Tensor, hit: Tensor) -> Tensor:
    """Albedo to divide a finished picture by: grey where it is black but shines, as of mirrors and glass.

    Divided by next to nothing their light would be huge, and denoising would spread it into the pixels at their edges,
    whose albedo is a mean of both. The grey makes light over albedo there what it is on half of the other surfaces;
    pixels that are mixed with the sky get its share.
    """
    color, bright = luminance(albedo), luminance(light).nan_to_num(0.0, 0.0, 0.0)
    black, most = (color < BLACK) | ~hit, F.max_pool2d(color, 2 * EDGE + 1, 1, EDGE)
    beside = F.max_pool2d(black.to(color), 2 * EDGE + 1, 1, EDGE) > 0
    others = hit & ~beside & (bright > 0)
    if not bool(black.any()) or not bool(others.any()):
        return albedo
    usual = (bright / color.clamp_min(BLACK))[others].median()
    mean = lambda t: F.avg_pool2d(t, 2 * AROUND + 1, 1, AROUND)
    grey = mean(bright * black) / mean(black.to(bright)).clamp_min(1e-6) / usual
    share = torch.where(beside, 1 - color / most.clamp_min(BLACK), 0.0).clamp_min(0.0)  # of what is black, in a pixel
    return torch.where(hit, (albedo + share * grey).clamp_max(1.0), albedo)
