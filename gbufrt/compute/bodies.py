"""Scalar bodies: plain Python functions of one item, marked for compilers.

A body is written once, in Python arithmetic over scalars, tuples and flat arrays. A compiler types it only if every
helper that it calls is compiled for the same target: see `gbufrt.compute.target`.
"""

from __future__ import annotations

from collections.abc import Callable
from types import FunctionType
from typing import Any, TypeVar, cast

F = TypeVar("F", bound=Callable[..., Any])

MARKS = ("__inlined__", "__allocating__", "__contracted__")


def scalar(function: F) -> F:
    """Mark a body or helper that works on one item, so that kernels may call it; it stays a plain function."""
    function.__scalar__ = True  # type: ignore[attr-defined]
    return function


def inlined(function: F) -> F:
    """Mark a `scalar` helper that is to be part of its callers.

    Compilers turn no loop into vector instructions that calls a function, and arrays pass to one through memory.
    """
    function.__inlined__ = True  # type: ignore[attr-defined]
    return scalar(function)


def allocating(function: F) -> F:
    """Mark a `scalar` helper that makes arrays, or hands out parts of them to one that does or to a driver.

    Others borrow the arrays that they are given, so that their machine code counts no references: threads would wait
    for each other at the counter of every array that they share. `Target.check` finds a mark that is missing.
    """
    function.__allocating__ = True  # type: ignore[attr-defined]
    return scalar(function)


def contracted(function: F) -> F:
    """Mark a `scalar` helper whose products and sums may become single instructions that round once.

    CUDA's compiler does so everywhere. On the CPU it takes a third of the arithmetic off polynomials.
    """
    function.__contracted__ = True  # type: ignore[attr-defined]
    return scalar(function)


def in_lanes(alone: Callable[..., Any]) -> Callable[[F], F]:
    """Mark a `scalar` helper that targets with lanes run, as it works on many items side by side or suits what does.

    Args:
        alone: `scalar`, takes the same arguments, and answers alike or for the same items in another order; it stands
            for the helper on targets of one lane.
    """

    def mark(function: F) -> F:
        function.__alone__ = alone  # type: ignore[attr-defined]
        return scalar(function)

    return mark


def specialized(body: F, item: Callable[..., Any]) -> F:
    """A copy of a body, `scalar` as well, that calls another function where it names its placeholder ``item``."""
    assert isinstance(body, FunctionType)
    copy = FunctionType(body.__code__, body.__globals__ | {"item": item}, f"{item.__name__}_{body.__name__}")
    copy.__module__, copy.__qualname__ = body.__module__, copy.__name__
    copy.__dict__.update(body.__dict__)
    return cast(F, copy)


def is_scalar(value: Any) -> bool:
    """Whether a value is a function marked `scalar`."""
    return isinstance(value, FunctionType) and hasattr(value, "__scalar__")


class Lanes(int):
    """A constant of a body that counts lanes, a multiple of `WIDTH`: items that its loops work on side by side.

    The CPU has `WIDTH` lanes, which its compiler turns into vectors. A target of one lane sees each such constant
    divided by that width: loops over lanes then run once, and rows of lanes become single numbers.
    """


WIDTH = Lanes(256)  # enough to spread the cost of a call and of reading what was just stored; rows stay in the cache
