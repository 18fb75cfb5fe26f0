"""The precision in which passes compute."""

from __future__ import annotations

import torch
from torch import Tensor


def own_precision(tensor: Tensor) -> torch.autocast:
    """Inside, `torch.autocast` is off on the tensor's device.

    It halves matrix products, which here are poses, places and means of light: reflections would move by more than
    their noise. A pass that profits turns it on again.
    """
    return torch.autocast(tensor.device.type, enabled=False)
