"""Checks of what passes and functions are told."""

from __future__ import annotations

import inspect
from functools import cache
from typing import Any

from torch import Tensor

NUMERIC = {"int", "float", "bool", "Tensor", "None"}
"""Annotations, as they are written, of tunables that take no text."""


@cache
def keywords(cls: type) -> tuple[str, ...]:
    """The keyword-only arguments of a constructor."""
    return tuple(p.name for p in inspect.signature(cls.__init__).parameters.values() if p.kind is p.KEYWORD_ONLY)


@cache
def numeric(cls: type) -> frozenset[str]:
    """Those `keywords` that take numbers, by their annotations or else their defaults."""
    known = inspect.signature(cls.__init__).parameters
    kinds = {name: known[name].annotation for name in keywords(cls)}
    told = {name: set(kind.split(" | ")) <= NUMERIC for name, kind in kinds.items() if isinstance(kind, str)}
    plain = {name for name in kinds if isinstance(known[name].default, (int, float))}
    return frozenset(name for name in kinds if told.get(name, name in plain))


def check_tunable(name: str, value: Any, present: Any) -> None:
    """Raise ValueError where the ``present`` value is a number, and the new one is a text or a tensor of several."""
    if not isinstance(present, (int, float)) and not (isinstance(present, Tensor) and present.ndim == 0):
        return  # of what else a pass takes, it alone knows the kinds
    if isinstance(value, Tensor) and value.ndim > 0:
        raise ValueError(f"{name} must be a number or a 0-dim tensor, got a tensor of shape {tuple(value.shape)}")
    if isinstance(value, str):
        raise ValueError(f"{name} must be a number (it is {present!r} now), got {value!r}")


def check_kept(cls: type, name: str, value: Any) -> None:
    """Raise TypeError where a text is kept as a number that the constructor of a stage takes."""
    if isinstance(value, str) and name in numeric(cls):
        raise TypeError(f"{name} of {cls.__name__} must be a number, got {value!r}")
