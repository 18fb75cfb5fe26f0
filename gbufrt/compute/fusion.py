"""The switch that turns fixed-tap functions from eager torch into compiled ones."""

from __future__ import annotations

import functools
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, ParamSpec, TypeVar

import torch

P = ParamSpec("P")
R = TypeVar("R")

_fusing: ContextVar[bool] = ContextVar("fusing", default=False)


@contextmanager
def fused_kernels() -> Iterator[None]:
    """Inside, functions marked `fusible` run compiled."""
    token = _fusing.set(True)
    try:
        yield
    finally:
        _fusing.reset(token)


def fusing() -> bool:
    """Whether this runs inside `fused_kernels`."""
    return _fusing.get()


def fusible(function: Callable[P, R]) -> Callable[P, R]:
    """Mark a pure tensor function as worth compiling: eager by default, compiled inside `fused_kernels`.

    If compilation fails once, the function warns and stays eager.
    """
    compiled: Any = None

    @functools.wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        nonlocal compiled
        if not _fusing.get() or compiled is function:
            return function(*args, **kwargs)
        compiled = compiled or torch.compile(function, dynamic=False)
        try:
            return compiled(*args, **kwargs)
        except Exception as error:
            result = function(*args, **kwargs)  # a genuine error of the arguments is raised here instead
            first = str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
            warnings.warn(f"{function.__name__} stays eager, torch.compile failed: {first}", stacklevel=2)
            compiled = function
            return result

    return call
