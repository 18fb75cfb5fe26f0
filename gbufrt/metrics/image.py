"""Error of a picture against the truth, as one number per picture and as a map.

Every function takes ``(B, C, H, W)`` tensors; the numbers are ``(B,)``, the maps ``(B, 1, H, W)``. ``mask``
``(B, 1, H, W)`` bool chooses the pixels that count; if it chooses none, the result is NaN.
"""

from __future__ import annotations

import torch
from torch import Tensor

RELATIVE_EPSILON = 1e-2  # keeps black pixels of the truth from dominating the relative error (Rousselle et al. 2011)


def squared_error_map(estimate: Tensor, truth: Tensor) -> Tensor:
    """Squared error, averaged over the components."""
    return (_checked(estimate, truth) - truth).square().mean(1, keepdim=True)


def rmse(estimate: Tensor, truth: Tensor, mask: Tensor | None = None) -> Tensor:
    """Root of the mean squared error."""
    return masked_mean(squared_error_map(estimate, truth), mask).sqrt()


def psnr(estimate: Tensor, truth: Tensor, mask: Tensor | None = None, *, peak: float = 1.0) -> Tensor:
    """Peak signal-to-noise ratio in decibels; infinite where the pictures are equal."""
    return 20 * torch.log10(peak / rmse(estimate, truth, mask))


def relative_squared_error_map(estimate: Tensor, truth: Tensor, *, epsilon: float = RELATIVE_EPSILON) -> Tensor:
    """Squared error over the squared truth, averaged over the components.

    Source: Rousselle et al. 2011, "Adaptive Sampling and Reconstruction using Greedy Error Minimization".
    """
    error = (_checked(estimate, truth) - truth).square() / (truth.square() + epsilon)
    return error.mean(1, keepdim=True)


def relative_squared_error(
    estimate: Tensor, truth: Tensor, mask: Tensor | None = None, *, epsilon: float = RELATIVE_EPSILON
) -> Tensor:
    """Mean of `relative_squared_error_map`."""
    return masked_mean(relative_squared_error_map(estimate, truth, epsilon=epsilon), mask)


def ssim_map(estimate: Tensor, truth: Tensor, *, peak: float = 1.0, window: int = 11) -> Tensor:
    """Structural similarity around each pixel, averaged over the components; 1 is equal.

    Raises:
        ValueError: the pictures differ in shape, or are no larger than half the window.
    """
    if min(truth.shape[-2:]) <= window // 2:
        raise ValueError(f"ssim needs pictures larger than {window // 2} pixels, got {tuple(truth.shape[-2:])}")
    from kornia.metrics import ssim as kornia_ssim  # late: kornia takes most of a second to import

    return kornia_ssim(_checked(estimate, truth), truth, window, max_val=peak).mean(1, keepdim=True)


def ssim(estimate: Tensor, truth: Tensor, mask: Tensor | None = None, *, peak: float = 1.0, window: int = 11) -> Tensor:
    """Mean of `ssim_map` (Wang et al. 2004)."""
    return masked_mean(ssim_map(estimate, truth, peak=peak, window=window), mask)


def _checked(estimate: Tensor, truth: Tensor) -> Tensor:
    if estimate.ndim != 4 or estimate.shape != truth.shape:
        raise ValueError(
            f"estimate and truth must both be (B,C,H,W) of one shape, got {tuple(estimate.shape)} and "
            f"{tuple(truth.shape)}"
        )
    return estimate


def masked_mean(error: Tensor, mask: Tensor | None) -> Tensor:
    """Mean of a map ``(B, 1, H, W)`` over the pixels of ``mask``: ``(B,)``."""
    if mask is None:
        return error.mean((1, 2, 3))
    if mask.dtype != torch.bool or mask.shape != error.shape:
        raise ValueError(f"mask must be {tuple(error.shape)} bool, got {tuple(mask.shape)} {mask.dtype}")
    return torch.where(mask, error, 0.0).sum((1, 2, 3)) / mask.sum((1, 2, 3))
