"""Traverse a value made of tensors: the one mechanism behind ``.to``, ``.detach`` and batch selection."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from torch import Tensor

from gbufrt.names import meant

T = TypeVar("T")


def map_tensors(function: Callable[[Tensor], Tensor], value: T) -> T:
    """Apply ``function`` to every tensor inside ``value`` and rebuild it around the results.

    ``value`` may nest dataclasses, mappings, tuples and lists; anything else is kept as it is, and so is
    whatever nothing changes in.
    """
    result: Any = value
    if isinstance(value, Tensor):
        result = function(value)
    elif dataclasses.is_dataclass(value) and not isinstance(value, type):
        before = {f.name: getattr(value, f.name) for f in dataclasses.fields(value) if f.init}
        after = {name: map_tensors(function, part) for name, part in before.items()}
        changes = {name: part for name, part in after.items() if part is not before[name]}
        result = dataclasses.replace(value, **changes) if changes else value
    elif isinstance(value, Mapping):
        after = {key: map_tensors(function, item) for key, item in value.items()}
        result = after if any(after[key] is not item for key, item in value.items()) else value
    elif isinstance(value, (tuple, list)):
        items = [map_tensors(function, item) for item in value]
        result = type(value)(items) if any(a is not b for a, b in zip(items, value, strict=True)) else value
    return result


def changed(value: T, changes: Mapping[str, Any]) -> T:
    """A copy of a frozen dataclass with some fields changed, and nothing checked: `dataclasses.replace` goes through
    every field, which of a `Frame` takes longer than most torch operations on a small picture.

    Raises:
        TypeError: there is no such field.
    """
    known: Any = type(value)
    if unknown := changes.keys() - known.__dataclass_fields__.keys():
        name, there = sorted(unknown)[0], known.__dataclass_fields__.keys()
        raise TypeError(f"{known.__name__} has no field {name!r}{meant(name, there)}")
    result = object.__new__(known)
    vars(result).update(vars(value), **changes)
    return result


def without_graph(tensor: Tensor) -> Tensor:
    """The same numbers without their gradient; the tensor itself where it has none."""
    return tensor.detach() if tensor.requires_grad else tensor
