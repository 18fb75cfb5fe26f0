"""Operators of torch, as `torch.library.custom_op` makes them, whose first call imports no compiler of torch's.

torch calls the body of an operator through `torch._dynamo`, so that `torch.compile` does not look inside. To import
that takes 80 MB, and seconds of the first frame, of processes that compile nothing.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

import torch


def operator(name: str) -> Callable[[Callable[..., Any]], Any]:
    """Register a function as the operator ``name``, ``room::function``, that writes into none of its arguments."""

    def register(body: Callable[..., Any]) -> Any:
        definition = torch.library.custom_op(name, body, mutates_args=())
        kernels: dict[Any, Any] = getattr(definition, "_backend_fns", {})  # another torch may call them otherwise
        kernels.update({device: _direct(body, called) for device, called in kernels.items()})
        return definition

    return register


def _direct(body: Callable[..., Any], called: Callable[..., Any]) -> Callable[..., Any]:
    """``body`` itself, until somebody has imported what ``called`` calls it through."""
    return lambda *args, **kwargs: (called if "torch._dynamo" in sys.modules else body)(*args, **kwargs)
