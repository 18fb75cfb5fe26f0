"""Focus distance, for depths from a picture or from rays."""

from __future__ import annotations

import torch
from torch import Tensor


def median_depth(depths: Tensor, far: float) -> Tensor:
    """The median depth of the hits: one object in the middle is in focus, whatever lies beside it.

    Args:
        depths: ``(B, N)`` planar view z, world units; NaN where nothing was hit.
        far: the camera's far, returned where nothing was hit at all.

    Returns:
        ``(B,)`` world units.
    """
    found = depths.nanmedian(dim=1).values
    return torch.where(found.isnan(), far, found)
