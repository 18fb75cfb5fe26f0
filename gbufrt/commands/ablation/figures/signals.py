"""Figures of signals: AO, bent normals, gathered light, the sky's visibility, reflections."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt.commands.ablation.figures.errors import (
    ON_SCREEN,
    Figures,
    Pair,
    Truth,
    enough,
    halves,
    mean_of,
    relative_energy,
    rms_error,
    share_of_pixels,
)
from gbufrt.commands.ablation.figures.trivial import constant_per_object, reflected_sky
from gbufrt.frame import Frame
from gbufrt.metrics.image import masked_mean, rmse, ssim

MIRROR_ROUGHNESS = 0.1  # below it a surface counts as a mirror
OCCLUDED = 0.9  # bent normals are judged where true visibility is below this


def ao_error(frame: Frame, truth: Truth) -> float:
    """RMSE of ``ao``."""
    return mean_of(rms_error(frame.read("ao"), halves(truth, "ao"), frame.gbuffer.hit))


def gi_error(frame: Frame, truth: Truth) -> float:
    """Squared error of ``gi`` over the squared truth, both of the part from on-screen surfaces."""
    return relative_energy(frame.read("gi"), halves(truth, "gi_onscreen"), frame.gbuffer.hit)


def reflection_error(frame: Frame, truth: Truth) -> float:
    """Squared error of ``reflection`` over the squared truth, on all surfaces."""
    return relative_energy(frame.read("reflection"), halves(truth, "reflection"), frame.gbuffer.hit)


def ao_figures(frame: Frame, truth: Truth) -> Figures:
    """Of ``ao`` and ``bent_normal``.

    ``rmse``; ``limit``, the error of exact AO by on-screen occluders alone; ``own``, the RMSE to that; ``bent``, the
    bent normal's error relative to the normal's, where true visibility is under 0.9.
    """
    hit, ao, true, both = frame.gbuffer.hit, frame.read("ao"), truth["ao"], halves(truth, "ao")
    result = {
        "ao.rmse": ao_error(frame, truth),
        "ao.limit": mean_of(rmse(truth["ao_onscreen"], true, hit)),
        "ao.own": mean_of(rmse(ao, truth["ao_onscreen"], hit)),
        "ao.ssim": mean_of(ssim(ao, true, hit)) if min(true.shape[-2:]) > 5 else float("nan"),
        "ao.if_open": mean_of(rms_error(torch.ones_like(true), both, hit)),
        "ao.if_constant": mean_of(rms_error(constant_per_object(true, frame.gbuffer), both, hit)),
        "ao.truth_error": float(truth.get("ao_error", torch.tensor(torch.nan))),
    }
    bent, blocked = frame.bent_normal, enough(hit & (true < OCCLUDED))
    if bent is not None:
        error, plain = (rmse(v, truth["bent_normal"], blocked) for v in (bent, frame.gbuffer.normal))
        result["ao.bent"], result["ao.if_normal"] = mean_of(error / plain), 1.0
        result["ao.bent_degrees"] = mean_of(_degrees(bent, truth["bent_normal"], blocked))
        result["ao.normal_degrees"] = mean_of(_degrees(frame.gbuffer.normal, truth["bent_normal"], blocked))
    return result


def gi_figures(frame: Frame, truth: Truth, exact: Pair) -> Figures:
    """Of ``gi``: squared errors over the squared truth, both summed over all pixels that hit.

    ``error`` is against the part from on-screen surfaces, ``exact`` the score of perfect rays (see `limits`);
    ``limit`` is that part's error against the whole truth, and ``whole`` the estimate's.
    """
    hit, gi, onscreen, true = frame.gbuffer.hit, frame.read("gi"), halves(truth, "gi_onscreen"), halves(truth, "gi")
    constant = constant_per_object(truth["gi_onscreen"], frame.gbuffer)
    error, trivial = gi_error(frame, truth), relative_energy(constant, onscreen, hit)
    return {
        "gi.error": error,
        "gi.exact": relative_energy(exact, onscreen, hit),
        "gi.if_constant": trivial,
        "gi.to_constant": error / trivial if trivial > 0 else float("nan"),
        "gi.if_black": 1.0,
        "gi.limit": relative_energy(onscreen, true, hit),
        "gi.whole": relative_energy(gi, true, hit),
        "gi.rmse": mean_of(rms_error(gi, onscreen, hit)),
        "gi.truth_error": float(truth.get("gi_error", torch.tensor(torch.nan))),
    }


def sky_figures(frame: Frame, truth: Truth) -> Figures:
    """Of ``sky_visibility``, where the pipeline has it."""
    if frame.sky_visibility is None:
        return {}
    hit, true = frame.gbuffer.hit, truth["sky_visibility"]
    constant = constant_per_object(true, frame.gbuffer)
    return {
        "sky.rmse": mean_of(rmse(frame.sky_visibility, true, hit)),
        "sky.if_open": mean_of(rmse(torch.ones_like(true), true, hit)),
        "sky.if_constant": mean_of(rmse(constant, true, hit)),
    }


def reflection_figures(frame: Frame, truth: Truth, exact: Pair, lit: Pair | None = None) -> Figures:
    """Of ``reflection`` on mirrors whose rays end on screen: RMSE over the mean true radiance there.

    ``exact`` is the score of perfect rays (see `limits`), ``exact_lit`` their score if they knew each surface's sky
    visibility: the error left is that of reading one sample a pixel. ``whole`` and ``limit`` are relative squared
    errors over all pixels with a hit, as for `gi_figures`.
    """
    g, found, true = frame.gbuffer, frame.read("reflection"), truth["reflection"]
    both = halves(truth, "reflection")
    smooth = torch.ones_like(g.depth) if g.roughness is None else g.roughness
    mirror = enough(g.hit & (smooth < MIRROR_ROUGHNESS) & (truth["onscreen"] > ON_SCREEN))
    mean = masked_mean(true.mean(1, keepdim=True), mirror)
    result = {
        "reflection.mirror": mean_of(rms_error(found, both, mirror) / mean),
        "reflection.exact": mean_of(rms_error(exact, both, mirror) / mean),
        "reflection.mirror_share": share_of_pixels(mirror, g.hit),
        "reflection.if_black": mean_of(rms_error(torch.zeros_like(true), both, mirror) / mean),
        "reflection.if_constant": mean_of(rms_error(constant_per_object(true, g, mirror), both, mirror) / mean),
        "reflection.whole": reflection_error(frame, truth),
        "reflection.limit": relative_energy(halves(truth, "reflection_onscreen"), both, g.hit),
        "reflection.truth_error": float(truth.get("reflection_error", torch.tensor(torch.nan))),
    }
    if lit is not None:
        result["reflection.exact_lit"] = mean_of(rms_error(lit, both, mirror) / mean)
    if frame.environment is not None and g.albedo is not None and g.metallic is not None:
        result["reflection.if_sky"] = mean_of(rms_error(reflected_sky(frame), both, mirror) / mean)
    return result


def _degrees(a: Tensor, b: Tensor, mask: Tensor) -> Tensor:
    return masked_mean((a * b).sum(1, keepdim=True).clamp(-1, 1).acos().rad2deg(), mask)
