"""Fireflies of reflections: the light by which samples are limited, and lone bright pixels that found a lamp."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt.compute.dispatch import Form, form_of
from gbufrt.compute.operators import operator
from gbufrt.environment import environment_mean
from gbufrt.luminance import luminance
from gbufrt.specular import MIRROR_ROUGHNESS
from post.shading.constants import BROAD, LIMIT, UNKNOWN


@operator("gbufrt::without_lone_fireflies")
def calmed_cpu(reflection: Tensor, roughness: Tensor) -> Tensor:
    """See `without_lone_fireflies`."""
    from post.shading.drivers import calm_each

    out = torch.empty_like(reflection, memory_format=torch.contiguous_format)
    calm_each(roughness.numel(), out, reflection, roughness)
    return out


@calmed_cpu.register_fake
def _(reflection, roughness):
    return torch.empty_like(reflection, memory_format=torch.contiguous_format)


def mean_light(light: Tensor, hit: Tensor, f0: Tensor, environment: Tensor | None, visibility: Tensor | None) -> Tensor:
    """Mean luminance of what was hit, of which limits of samples are multiples.

    What surfaces mirror of the sky counts, as far as it is open to them: metals send no other light.

    Args:
        light: ``(B, 3, H, W)`` outgoing linear radiance.
        hit: ``(B, 1, H, W)`` bool.
        f0: ``(B, 3, H, W)`` reflectance at normal incidence.
        environment: ``(B, 3, h, w)`` lat-long radiance of the sky, where there is one.
        visibility: ``(B, 1, H, W)`` of the sky; by default it is open.

    Returns:
        ``(B, 1, 1, 1)``.
    """
    sent = luminance(light)
    if environment is not None:
        mirrored = luminance(f0 * environment_mean(environment))
        sent = sent + (mirrored if visibility is None else mirrored * visibility)
    return (sent * hit).sum((1, 2, 3), keepdim=True) / hit.sum((1, 2, 3), keepdim=True).clamp_min(1)


def without_lone_fireflies(reflection: Tensor, roughness: Tensor, *, compiled: bool | None = None) -> Tensor:
    """Scale down pixels that are far brighter than each of the eight around them, as far as these have such a lobe.

    The lobe of water or polished stone is narrow, and its tail wide and faint. A ray of the tail that finds a lamp
    brings a thousand times what its pixel should show, and a filter makes a disc of it. Broad lobes keep theirs, whose
    mean is what they show; mirrors have one ray, without noise.

    Args:
        reflection: ``(B, 3, H, W)`` linear radiance, not negative.
        roughness: ``(B, 1, H, W)`` perceptual, in [0, 1].
        compiled: see `gbufrt.compute.dispatch.form_of`.

    Returns:
        ``(B, 3, H, W)``.

    Source: Zhdan 2021 (rank filters against fireflies).
    """
    if form_of(reflection, roughness, compiled=compiled, cuda=True) is not Form.REFERENCE:
        return calmed_cpu(reflection, roughness.expand(len(reflection), -1, -1, -1))
    glossy = (roughness >= MIRROR_ROUGHNESS) & (roughness < BROAD)
    light = luminance(reflection)
    wide = F.pad(torch.where(glossy, light, UNKNOWN), (1, 1, 1, 1), value=UNKNOWN)
    across = torch.maximum(wide[..., :-2], wide[..., 2:])  # to the left and to the right
    rows = torch.maximum(across, wide[..., 1:-1])
    around = torch.maximum(torch.maximum(rows[..., :-2, :], rows[..., 2:, :]), across[..., 1:-1, :])
    cut = glossy & (around != UNKNOWN) & (light > LIMIT * around)
    return reflection * torch.where(cut, LIMIT * around / light.clamp_min(1e-12), 1.0)
