"""Traverse a value made of tensors: the one mechanism behind ``.to``, ``.detach`` and batch selection."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from torch import Tensor

T = TypeVar("T")


def map_tensors(function: Callable[[Tensor], Tensor], value: T) -> T:
    """Apply ``function`` to every tensor inside ``value`` and rebuild it around the results.

    ``value`` may nest dataclasses, mappings, tuples and lists; anything else is kept as it is.
    """
    result: Any = value
    if isinstance(value, Tensor):
        result = function(value)
    elif dataclasses.is_dataclass(value) and not isinstance(value, type):
        changes = {f.name: map_tensors(function, getattr(value, f.name)) for f in dataclasses.fields(value) if f.init}
        result = dataclasses.replace(value, **changes)
    elif isinstance(value, Mapping):
        result = {key: map_tensors(function, item) for key, item in value.items()}
    elif isinstance(value, (tuple, list)):
        result = type(value)(map_tensors(function, item) for item in value)
    return result
