"""Checks of the numbers that functions and cameras are given, by the names of their arguments."""

from __future__ import annotations

from typing import Any

from torch import Tensor


def check_numbers(**values: Any) -> None:
    """Raise TypeError where a value, by its argument's name, is neither a number, a 0-dim tensor nor None."""
    for name, value in values.items():
        if value is not None and (not hasattr(value, "__float__") or getattr(value, "ndim", 0)):
            raise TypeError(f"{name} must be a number or a 0-dim tensor, got {_told(value)}")


def check_counts(**values: Any) -> None:
    """Raise TypeError where a value, by its argument's name, is no whole number."""
    for name, value in values.items():
        if not hasattr(value, "__index__") or getattr(value, "ndim", 0):
            raise TypeError(f"{name} must be a whole number, got {_told(value)}")


def check_size(size: Any) -> None:
    """Raise ValueError unless ``size`` is the rows and columns of a picture."""
    if isinstance(size, (tuple, list)) and len(size) == 2 and all(hasattr(n, "__index__") and n >= 1 for n in size):
        return
    raise ValueError(f"size must be (H, W), whole numbers of at least 1 such as (540, 960), got {size!r}")


def _told(value: Any) -> str:
    if isinstance(value, (str, int, float)):
        return repr(value)
    return f"one of shape {tuple(value.shape)}" if isinstance(value, Tensor) else type(value).__name__
