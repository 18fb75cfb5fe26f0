"""Figures of whole pictures, as they are displayed."""

from __future__ import annotations

from torch import Tensor

from gbufrt.commands.ablation.figures.display import display, displayed
from gbufrt.commands.ablation.figures.errors import Figures, Pair, both_halves, mean_of, psnr_over, rms_error
from gbufrt.commands.ablation.figures.trivial import untouched
from gbufrt.frame import Frame
from gbufrt.metrics.image import ssim


def picture_figures(color: Tensor, truth: Tensor | Pair, hit: Tensor, exposure: float) -> Figures:
    """Of a whole picture: RMSE of the light, the rest as displayed; see `display`."""
    from gbufrt.metrics.flip import available, flip

    truths = both_halves(truth)
    shown, wanted = display(color, exposure), display((truths[0] + truths[1]) / 2, exposure)
    result = {
        "rmse": mean_of(rms_error(color * exposure, (truths[0] * exposure, truths[1] * exposure), hit)),
        "psnr": psnr_over(shown, displayed(truths, exposure), hit),
        "ssim": mean_of(ssim(shown, wanted, hit)) if min(wanted.shape[-2:]) > 5 else float("nan"),
    }
    return {**result, "flip": mean_of(flip(shown, wanted, hit))} if available() else result


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
