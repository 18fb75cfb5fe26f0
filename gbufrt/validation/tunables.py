"""Checks of what passes are told."""

from __future__ import annotations

from typing import Any

from torch import Tensor


def check_tunable(name: str, value: Any, present: Any) -> None:
    """Raise ValueError where the ``present`` value is a number, and the new one is a text or a tensor of several."""
    if not isinstance(present, (int, float)) and not (isinstance(present, Tensor) and present.ndim == 0):
        return  # of what else a pass takes, it alone knows the kinds
    if isinstance(value, Tensor) and value.ndim > 0:
        raise ValueError(f"{name} must be a number or a 0-dim tensor, got a tensor of shape {tuple(value.shape)}")
    if isinstance(value, str):
        raise ValueError(f"{name} must be a number (it is {present!r} now), got {value!r}")
