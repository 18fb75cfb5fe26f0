"""Checks of what passes are told."""

from __future__ import annotations

from typing import Any

from torch import Tensor


def check_tunable(name: str, value: Any, present: Any) -> None:
    """Raise ValueError where a number is due, such as the ``present`` one, and a value is none."""
    if isinstance(value, Tensor) and value.ndim > 0:
        raise ValueError(f"{name} must be a number or a 0-dim tensor, got a tensor of shape {tuple(value.shape)}")
    if isinstance(value, str) and isinstance(present, (int, float, Tensor)):
        raise ValueError(f"{name} must be a number (it is {present!r} now), got {value!r}")
