"""What rays carry: dataclasses of tensors with a row for each ray, of which programs change some."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, is_dataclass
from typing import Any, TypeVar

import torch
from torch import Tensor

from gbufrt.names import with_article
from gbufrt.tree import map_tensors

P = TypeVar("P")


def check_programs(**programs: Any) -> None:
    """Raise TypeError unless programs, by the names of their arguments, are functions or None."""
    for name, program in programs.items():
        if program is not None and not callable(program):
            raise TypeError(f"{name} must be a function (launch, place, payload), got {described(program)}")


def changed(program: Callable[..., Any], launch: Any, place: Any, payload: Any, at: Tensor) -> Any:
    """The payload after a program has run for the rows ``at``."""
    if not bool(at.any()):
        return payload
    before = taken(payload, at)
    after = program(launch, taken(place, at), before)
    if type(after) is not type(payload):
        raise TypeError(f"{name_of(program)} must return {_kind(payload)}, got {described(after)}")
    for one in fields(payload):
        was, now = getattr(before, one.name), getattr(after, one.name)
        if isinstance(was, Tensor) and not (
            isinstance(now, Tensor) and now.shape == was.shape and now.dtype == was.dtype
        ):
            raise TypeError(
                f"{name_of(program)} must return {type(payload).__name__}.{one.name} as {described(was)}, "
                f"got {described(now)}"
            )
    return with_rows(payload, at, after)


def accepted(program: Callable[..., Any], launch: Any, place: Any, payload: Any) -> Tensor:
    """``(N,)`` bool: which of the hits at ``place`` an any-hit program counts."""
    kept, count = program(launch, place, payload), len(place.origins)
    if not (isinstance(kept, Tensor) and kept.dtype == torch.bool and kept.shape == (count,)):
        raise TypeError(
            f"{name_of(program)} must return ({count},) bool, whether each hit counts; got {described(kept)}"
        )
    return kept


def taken(value: P, at: Tensor) -> P:
    return value if bool(at.all()) else map_tensors(lambda x: x[at], value)


def with_rows(value: P, at: Tensor, rows: P) -> P:
    """A dataclass of tensors with some of its rows replaced."""
    if bool(at.all()):
        return rows
    index = at.nonzero()[:, 0]
    parts = {one.name: getattr(value, one.name) for one in fields(value)}  # type: ignore[arg-type]
    changed = {
        name: part.index_put((index,), getattr(rows, name)) if isinstance(part, Tensor) else part
        for name, part in parts.items()
    }
    return type(value)(**changed)


def flat_rows(payload: P, shape: torch.Size, what: str) -> P:
    if not is_dataclass(payload) or isinstance(payload, type):
        raise TypeError(f"{what} must be a dataclass of tensors, got {described(payload)}")
    for one in fields(payload):
        value = getattr(payload, one.name)
        if isinstance(value, Tensor) and value.shape[: len(shape)] != shape:
            raise ValueError(
                f"{what} must begin with the rays' shape {tuple(shape)}, but {one.name} is {described(value)}"
            )
    return map_tensors(lambda x: x.reshape(-1, *x.shape[len(shape) :]), payload)


def described(value: Any) -> str:
    if isinstance(value, Tensor):
        return f"{tuple(value.shape)} {str(value.dtype).removeprefix('torch.')}"
    return _kind(value)


def _kind(value: Any) -> str:
    return with_article(type(value).__name__)


def name_of(program: Callable[..., Any]) -> str:
    return getattr(program, "__name__", repr(program))
