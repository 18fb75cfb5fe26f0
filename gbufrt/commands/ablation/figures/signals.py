"""What is measured: errors of each signal against its truth, beside what trivial answers score.

Only pixels with a hit count. All numbers are Python floats; NaN where no pixel counts. A squared error is the product
of the differences from two independent halves of the truth, so that the truth's own noise adds no bias.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt.commands.ablation.trivial import constant_per_object, reflected_sky, untouched
from gbufrt.files.color_maps import to_srgb, viridis
from gbufrt.frame import Frame
from gbufrt.metrics.image import masked_mean, rmse, ssim

Figures = dict[str, float]
Truth = Mapping[str, Tensor]
Pair = tuple[Tensor, Tensor]
"""Two independent halves of something traced."""

MIDDLE_GREY = 0.18
MIRROR_ROUGHNESS = 0.1  # below it a surface counts as a mirror
ON_SCREEN = 0.99  # least share of a pixel's rays that end on on-screen surfaces, or of its light that comes by them
OCCLUDED = 0.9  # bent normals are judged where true visibility is below this
CHANGED = 2.0 / 255  # difference of a displayed pixel above which an effect has changed it
TRACED = 8.0 / 255  # the same between two traced pictures, which have noise
ERROR_TOP = 0.25  # displayed error at the end of the colour map
FEWEST = 64  # pixels below which a mean says nothing
LEAST = 1e-4  # displayed error too small for any display to show


def exposure_of(truth: Tensor, hit: Tensor) -> float:
    """The factor that brings the geometric mean luminance of a true picture to middle grey."""
    level = truth.mean(1, keepdim=True)[hit].clamp_min(1e-4)
    return MIDDLE_GREY / float(level.log().mean().exp()) if level.numel() else 1.0


def display(light: Tensor, exposure: float) -> Tensor:
    """Linear light as it is judged: fixed exposure, the curve x / (1 + x) of each component, sRGB."""
    light = light.clamp_min(0.0) * exposure
    return to_srgb(light / (1.0 + light))


def displayed(lights: Pair, exposure: float) -> Pair:
    """`display` of both halves."""
    return display(lights[0], exposure), display(lights[1], exposure)


def unbiased(lights: Pair, exposure: float) -> Tensor:
    """`display` of what two independent noisy pictures are means of, free of their noise's bias to the first order.

    The curve bends, so noise shifts what is displayed in proportion to its variance: by half as much in the mean of
    both pictures as in each of them.

    Source: Quenouille 1956 (the jackknife).
    """
    first, second = displayed(lights, exposure)
    return 2 * display((lights[0] + lights[1]) / 2, exposure) - (first + second) / 2


def error_picture(estimate: Tensor, truth: Tensor, hit: Tensor) -> Tensor:
    """``(B, 3, H, W)``: the mean absolute difference of displayed pictures in viridis, black where nothing was hit."""
    error = (estimate - truth).abs().mean(1, keepdim=True)
    return torch.where(hit, viridis(error / ERROR_TOP), 0.0)


def halves(truth: Truth, name: str) -> Pair:
    """The two independent halves of a truth; the whole twice where it has none."""
    return truth.get(f"{name}_first", truth[name]), truth.get(f"{name}_second", truth[name])


def rms_error(estimate: Tensor | Pair, truths: Pair, mask: Tensor) -> Tensor:
    """``(B,)`` RMSE against two halves of the truth; a noisy estimate comes in halves as well."""
    return masked_mean(_squares(estimate, truths), mask).clamp_min(0.0).sqrt()


def _squares(estimate: Tensor | Pair, truths: Pair) -> Tensor:
    """``(B, 1, H, W)`` squared errors, see `rms_error`; noise may make some negative."""
    a, b = _pair(estimate)
    return ((a - truths[0]) * (b - truths[1])).mean(1, keepdim=True)


def _pair(value: Tensor | Pair) -> Pair:
    return value if isinstance(value, tuple) else (value, value)


def ao_error(frame: Frame, truth: Truth) -> float:
    """RMSE of ``ao``."""
    return _one(rms_error(frame.read("ao"), halves(truth, "ao"), frame.gbuffer.hit))


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
        "ao.limit": _one(rmse(truth["ao_onscreen"], true, hit)),
        "ao.own": _one(rmse(ao, truth["ao_onscreen"], hit)),
        "ao.ssim": _one(ssim(ao, true, hit)) if min(true.shape[-2:]) > 5 else float("nan"),
        "ao.if_open": _one(rms_error(torch.ones_like(true), both, hit)),
        "ao.if_constant": _one(rms_error(constant_per_object(true, frame.gbuffer), both, hit)),
        "ao.truth_error": float(truth.get("ao_error", torch.tensor(torch.nan))),
    }
    bent, blocked = frame.bent_normal, _enough(hit & (true < OCCLUDED))
    if bent is not None:
        error, plain = (rmse(v, truth["bent_normal"], blocked) for v in (bent, frame.gbuffer.normal))
        result["ao.bent"], result["ao.if_normal"] = _one(error / plain), 1.0
        result["ao.bent_degrees"] = _one(_degrees(bent, truth["bent_normal"], blocked))
        result["ao.normal_degrees"] = _one(_degrees(frame.gbuffer.normal, truth["bent_normal"], blocked))
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
        "gi.rmse": _one(rms_error(gi, onscreen, hit)),
        "gi.truth_error": float(truth.get("gi_error", torch.tensor(torch.nan))),
    }


def sky_figures(frame: Frame, truth: Truth) -> Figures:
    """Of ``sky_visibility``, where the pipeline has it."""
    if frame.sky_visibility is None:
        return {}
    hit, true = frame.gbuffer.hit, truth["sky_visibility"]
    constant = constant_per_object(true, frame.gbuffer)
    return {
        "sky.rmse": _one(rmse(frame.sky_visibility, true, hit)),
        "sky.if_open": _one(rmse(torch.ones_like(true), true, hit)),
        "sky.if_constant": _one(rmse(constant, true, hit)),
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
    mirror = _enough(g.hit & (smooth < MIRROR_ROUGHNESS) & (truth["onscreen"] > ON_SCREEN))
    mean = masked_mean(true.mean(1, keepdim=True), mirror)
    result = {
        "reflection.mirror": _one(rms_error(found, both, mirror) / mean),
        "reflection.exact": _one(rms_error(exact, both, mirror) / mean),
        "reflection.mirror_share": share(mirror, g.hit),
        "reflection.if_black": _one(rms_error(torch.zeros_like(true), both, mirror) / mean),
        "reflection.if_constant": _one(rms_error(constant_per_object(true, g, mirror), both, mirror) / mean),
        "reflection.whole": reflection_error(frame, truth),
        "reflection.limit": relative_energy(halves(truth, "reflection_onscreen"), both, g.hit),
        "reflection.truth_error": float(truth.get("reflection_error", torch.tensor(torch.nan))),
    }
    if lit is not None:
        result["reflection.exact_lit"] = _one(rms_error(lit, both, mirror) / mean)
    if frame.environment is not None and g.albedo is not None and g.metallic is not None:
        result["reflection.if_sky"] = _one(rms_error(reflected_sky(frame), both, mirror) / mean)
    return result


def picture_figures(color: Tensor, truth: Tensor | Pair, hit: Tensor, exposure: float) -> Figures:
    """Of a whole picture: RMSE of the light, the rest as displayed; see `display`."""
    from gbufrt.metrics.flip import available, flip

    truths = _pair(truth)
    shown, wanted = display(color, exposure), display((truths[0] + truths[1]) / 2, exposure)
    result = {
        "rmse": _one(rms_error(color * exposure, (truths[0] * exposure, truths[1] * exposure), hit)),
        "psnr": psnr_over(shown, displayed(truths, exposure), hit),
        "ssim": _one(ssim(shown, wanted, hit)) if min(wanted.shape[-2:]) > 5 else float("nan"),
    }
    return {**result, "flip": _one(flip(shown, wanted, hit))} if available() else result


def untouched_figures(frame: Frame, truths: Pair, onscreen: Pair, exposure: float) -> Figures:
    """Scores of a frame that no pass has touched: direct light alone, and with the sky's light unoccluded.

    Also the score of the true light by on-screen surfaces alone: the limit without off-screen data.
    """
    hit, wanted = frame.gbuffer.hit, displayed(truths, exposure)
    return {
        "psnr_limit": psnr_over(displayed(onscreen, exposure), wanted, hit),
        "psnr_if_direct": psnr_over(display(frame.read("radiance"), exposure), wanted, hit),
        "psnr_if_ambient": psnr_over(display(untouched(frame), exposure), wanted, hit),
    }


def gain(better: Tensor | Pair, worse: Tensor | Pair, truth: Tensor | Pair, changed: Tensor) -> float:
    """Gain in PSNR, decibels, of the first displayed picture over the second, on the pixels of ``changed``."""
    mask, truths = _enough(changed), _pair(truth)
    return psnr_over(better, truths, mask) - psnr_over(worse, truths, mask)


def psnr_over(picture: Tensor | Pair, truths: Pair, mask: Tensor) -> float:
    """PSNR of a displayed picture against two halves of a displayed truth, decibels."""
    error = _one(rms_error(picture, truths, mask))
    return error if math.isnan(error) else -20 * math.log10(max(error, LEAST))


def share(part: Tensor, whole: Tensor) -> float:
    """The share of the pixels of ``whole`` that are in ``part``, a subset of them."""
    return float(part.sum()) / max(float(whole.sum()), 1.0)


def share_of_error(picture: Tensor | Pair, truths: Pair, part: Tensor, whole: Tensor) -> float:
    """The share of a displayed picture's squared error on ``whole`` that lies in ``part``, a subset of its pixels."""
    square = _squares(picture, truths)
    every = float(square[_enough(whole)].sum())
    return min(max(float(square[part].sum()) / every, 0.0), 1.0) if every > 0 else float("nan")


def by_onscreen_points(onscreen: Pair, truths: Pair) -> Tensor:
    """``(B, 1, H, W)`` bool: pixels whose light came by on-screen points, to within a hundredth."""
    some, all_ = ((a + b).mean(1, keepdim=True) for a, b in (onscreen, truths))
    return some >= ON_SCREEN * all_


def changed_pixels(a: Tensor, b: Tensor, *, level: float = CHANGED) -> Tensor:
    """``(B, 1, H, W)`` bool: where two displayed pictures differ by more than ``level`` in a component."""
    return (a - b).abs().amax(1, keepdim=True) > level


def truly_changed(a: Pair, b: Pair, *, level: float = TRACED) -> Tensor:
    """`changed_pixels` of two noisy pictures in halves: by the mean over 3x3 pixels, which cancels noise."""
    square = ((a[0] - b[0]) * (a[1] - b[1])).mean(1, keepdim=True)
    return F.avg_pool2d(square, 3, stride=1, padding=1, count_include_pad=False) > level**2


def relative_energy(estimate: Tensor | Pair, truths: Pair, mask: Tensor) -> float:
    """Sum of squared errors over the sum of the squared truth; NaN where the truth is black.

    An estimate that shares the noise of the truth comes in halves as well.
    """
    a, b = _pair(estimate)
    total = float((truths[0] * truths[1] * mask).sum())
    return float(((a - truths[0]) * (b - truths[1]) * mask).sum()) / total if total > 0 else float("nan")


def _degrees(a: Tensor, b: Tensor, mask: Tensor) -> Tensor:
    return masked_mean((a * b).sum(1, keepdim=True).clamp(-1, 1).acos().rad2deg(), mask)


def _enough(mask: Tensor) -> Tensor:
    return mask if int(mask.sum()) >= FEWEST else torch.zeros_like(mask)


def _one(value: Tensor) -> float:
    return float(value.mean())
