"""FLIP: how different two pictures look to a person who flips between them.

The metric comes from the authors' own package, which is optional; this module wraps it for tensors.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from gbufrt.metrics.image import masked_mean

PIXELS_PER_DEGREE = 67.0  # a 0.7 m wide 4K display viewed from 0.7 m, the authors' default


def flip_map(
    estimate: Tensor, truth: Tensor, *, hdr: bool = False, pixels_per_degree: float = PIXELS_PER_DEGREE
) -> Tensor:
    """Perceived difference at each pixel, 0 for none to 1.

    Args:
        estimate: ``(B, 3, H, W)`` display-referred, clipped to [0, 1], or linear light with ``hdr``.
        truth: as ``estimate``.
        hdr: compare linear light over the range of exposures that the truth calls for.
        pixels_per_degree: of visual angle.

    Returns:
        ``(B, 1, H, W)``.

    Raises:
        ValueError: the shapes differ or are not RGB pictures.
        ModuleNotFoundError: the package is not installed; `available` tells beforehand.

    Source: Andersson et al. 2020 (FLIP) and 2021 (HDR-FLIP).
    """
    if estimate.ndim != 4 or estimate.shape[1] != 3 or estimate.shape != truth.shape:
        raise ValueError(
            f"estimate and truth must both be (B,3,H,W), got {tuple(estimate.shape)} and {tuple(truth.shape)}"
        )
    try:
        from flip_evaluator import evaluate
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError("FLIP needs the package flip-evaluator: pip install 'gbufrt[metrics]'") from error
    maps = [
        evaluate(
            _pixels(b, hdr), _pixels(a, hdr), "HDR" if hdr else "LDR",
            applyMagma=False, computeMeanError=False, parameters={"ppd": pixels_per_degree},
        )[0]
        for a, b in zip(estimate, truth, strict=True)
    ]  # fmt: skip
    return torch.from_numpy(np.stack(maps)).permute(0, 3, 1, 2).to(estimate)


def flip(estimate: Tensor, truth: Tensor, mask: Tensor | None = None, *, hdr: bool = False) -> Tensor:
    """Mean of `flip_map` over the pixels of ``mask`` ``(B, 1, H, W)``: ``(B,)``."""
    return masked_mean(flip_map(estimate, truth, hdr=hdr), mask)


def available() -> bool:
    """Whether FLIP can be measured here."""
    from importlib.util import find_spec

    return find_spec("flip_evaluator") is not None


def _pixels(picture: Tensor, hdr: bool) -> np.ndarray:
    picture = picture.detach().cpu().float().nan_to_num(0.0).clamp_min(0.0)
    return (picture if hdr else picture.clamp_max(1.0)).permute(1, 2, 0).contiguous().numpy()
