"""The light of another renderer's frame, and the share of its surfaces that light passes through."""

from __future__ import annotations

import warnings

import torch
from torch import Tensor

from gbufrt.files.gbuffers.named import Light, Named
from gbufrt.files.gbuffers.sky import sky_lacks


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
