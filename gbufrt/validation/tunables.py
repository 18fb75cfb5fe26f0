"""Checks of what passes and functions are told."""

from __future__ import annotations

import inspect
from functools import cache
from typing import Any, Literal, get_args, get_origin, get_type_hints

from torch import Tensor

from gbufrt.names import meant

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


@cache
def optional(cls: type) -> frozenset[str]:
    """Those `keywords` that may be None, by their annotations or else their defaults."""
    known = inspect.signature(cls.__init__).parameters
    kinds = {name: known[name].annotation for name in keywords(cls)}
    return frozenset(n for n, kind in kinds.items() if "None" in str(kind).split(" | ") or known[n].default is None)


@cache
def choices(cls: type) -> dict[str, tuple[Any, ...]]:
    """Those `keywords` that take one of a few values, by their annotations, with these values."""
    try:
        kinds = get_type_hints(cls.__init__)
    except NameError:  # an annotation that only the type checker knows
        return {}
    return {name: get_args(kind) for name in keywords(cls) if get_origin(kind := kinds.get(name)) is Literal}


def check_tunable(name: str, value: Any, present: Any) -> None:
    """Raise ValueError where the ``present`` value is a number, and the new one is a text or a tensor of several."""
    if not isinstance(present, (int, float)) and not (isinstance(present, Tensor) and present.ndim == 0):
        return  # of what else a pass takes, it alone knows the kinds
    if isinstance(value, Tensor) and value.ndim > 0:
        raise ValueError(f"{name} must be a number or a 0-dim tensor, got a tensor of shape {tuple(value.shape)}")
    if isinstance(value, str):
        raise ValueError(f"{name} must be a number (it is {present!r} now), got {value!r}")


def check_kept(cls: type, name: str, value: Any) -> None:
    """Raise TypeError where a text, a list or None is kept as a number that the constructor of a stage takes, and
    ValueError where a text is none of the few that the constructor takes."""
    if isinstance(value, (str, list, tuple, dict)) and name in numeric(cls):
        raise TypeError(f"{name} of {cls.__name__} must be a number, got {value!r}")
    if value is None and name in numeric(cls) - optional(cls):
        raise TypeError(f"{name} of {cls.__name__} must be a number, got None")
    if isinstance(value, str) and value not in (known := choices(cls).get(name, (value,))):
        there = ", ".join(map(repr, known))
        raise ValueError(f"{name} of {cls.__name__} must be one of {there}, got {value!r}{meant(value, known)}")
