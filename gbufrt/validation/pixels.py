"""Checks that hold for any tensor, and how their messages tell of wrong pixels.

Every message names the channel, how many pixels are wrong, one of them, and a remedy.
"""

from __future__ import annotations

import math
from typing import Any

import torch
from torch import Tensor

UNIT_TOLERANCE = 1e-2
WRONG_SHARE = 1e-3  # of pixels: a few at silhouettes do not break a convention
RANGE_TOLERANCE = 1e-4


def check_finite(name: str, tensor: Tensor, remedy: str = "") -> None:
    """Raise ValueError that counts the pixels of ``tensor`` that are NaN or infinite, if there are any."""
    if not tensor.is_floating_point() or all_finite(tensor):
        return
    bad = ~torch.isfinite(tensor)
    if bool(bad.any()):
        raise ValueError(f"{name} must be finite, but {count(bad)} not, such as {example(tensor, bad)}{remedy}")


def all_finite(tensor: Tensor) -> bool:
    """Whether a float tensor holds neither NaN nor infinity, in one pass; also False where the sum overflows."""
    return math.isfinite(float(tensor.detach().sum()))


def check_unit(name: str, vector: Tensor, hit: Tensor) -> None:
    """Raise ValueError if more than a few vectors of the pixels hit are not of unit length."""
    length = vector.norm(dim=1, keepdim=True)
    wrong = hit & ((length - 1).abs() > UNIT_TOLERANCE)
    if share(wrong, hit) <= WRONG_SHARE:
        return
    encoded = bool(((vector >= 0) & (vector <= 1)).all())
    remedy = "; it looks encoded into [0, 1]: use 2 * n - 1" if encoded else "; normalize it over dim 1"
    raise ValueError(
        f"{name} must have unit length where hit, but {count(wrong)} of another length, such as "
        f"{example(length, wrong)}{remedy}"
    )


def check_range(name: str, tensor: Tensor) -> None:
    """Raise ValueError if a value lies outside [0, 1]."""
    wrong = (tensor < 0) | (tensor > 1 + RANGE_TOLERANCE)
    if bool(wrong.any()):
        raise ValueError(
            f"{name} must lie in [0, 1], but {count(wrong)} outside ({float(tensor.min()):.4g} to "
            f"{float(tensor.max()):.4g}), such as {example(tensor, wrong)}; scale or clamp it"
        )


def check_not_negative(name: str, tensor: Tensor) -> None:
    """Raise ValueError if a value is negative."""
    wrong = tensor < 0
    if bool(wrong.any()):
        raise ValueError(
            f"{name} must not be negative, but {count(wrong)} so (down to {float(tensor.min()):.4g}), such as "
            f"{example(tensor, wrong)}; clamp it at 0"
        )


def share(part: Tensor, whole: Tensor) -> float:
    """How much of the pixels of ``whole`` ``part`` marks."""
    return float(part.sum()) / max(float(whole.sum()), 1.0)


def pixels(wrong: Tensor) -> int:
    """How many pixels ``wrong`` ``(B, C, H, W)`` bool marks, in any of their components."""
    return int(wrong.any(dim=1).sum())


def count(wrong: Tensor, one: str = "is", many: str = "are") -> str:
    """``wrong``'s number of pixels with a verb."""
    number = pixels(wrong)
    return f"1 pixel {one}" if number == 1 else f"{number} pixels {many}"


def place(wrong: Tensor) -> str:
    """Where the first wrong value is."""
    return f"(b, c, y, x) = {tuple(_first(wrong))}"


def example(tensor: Tensor, wrong: Tensor) -> str:
    """The first wrong value, and where it is."""
    first: Any = tuple(_first(wrong))
    return f"{tensor[first].item():.4g} at {place(wrong)}"


def _first(wrong: Tensor) -> list[int]:
    """Indices of the first True."""
    return [int(i) for i in wrong.nonzero()[0]]
