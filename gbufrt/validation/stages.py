"""Checks of what users give to passes, and of what their own passes return."""

from __future__ import annotations

from typing import Any

from torch import Tensor

from gbufrt.frame import Frame


def check_tunable(name: str, value: Any, present: Any) -> None:
    """Raise ValueError where a number is due, such as the ``present`` one, and a value is none."""
    if isinstance(value, Tensor) and value.ndim > 0:
        raise ValueError(f"{name} must be a number or a 0-dim tensor, got a tensor of shape {tuple(value.shape)}")
    if isinstance(value, str) and isinstance(present, (int, float, Tensor)):
        raise ValueError(f"{name} must be a number (it is {present!r} now), got {value!r}")


def returned(name: str, stage: object, result: Any, *, temporal: bool) -> tuple[Frame, Any]:
    """The frame that a stage returned and its state, None unless it is ``temporal``.

    Raises:
        TypeError: it returned something else.
    """
    found = result if temporal else (result, None)
    if isinstance(found, tuple) and len(found) == 2 and isinstance(found[0], Frame):
        return found
    wanted = "a Frame and its state" if temporal else "a Frame, such as frame.write(name, tensor)"
    raise TypeError(f"{name} ({type(stage).__name__}) must return {wanted}, got {type(result).__name__}")
