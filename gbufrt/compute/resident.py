"""Constants as tensors, copied to a device once, and questions that make the host wait for a GPU.

A copy from the host to a GPU waits until the GPU has done all it was given before, and so does reading a number that
lies there. The GPU then idles until it is given more, and no CUDA graph can hold such a step.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from typing import Any

import torch
from torch import Tensor

_kept: dict[tuple[Hashable, torch.dtype, torch.device], Tensor] = {}


def resident(values: Any, like: Tensor) -> Tensor:
    """Numbers as a tensor of the type and on the device of another one. They are copied there at the first call only.

    Args:
        values: tuples of numbers, or a function of no arguments that returns an array or tensor. Callers must not
            write to the result: it is shared.
        like: has a floating type.

    Returns:
        The tensor.
    """
    return resident_on(like.device, values, like.dtype)


def resident_on(device: torch.device, values: Any, dtype: torch.dtype) -> Tensor:
    """As `resident`, of any type."""
    key = values, dtype, device
    if key not in _kept:
        with torch.inference_mode(False), torch.no_grad():
            made: Any = values() if isinstance(values, Callable) else values
            tensor = torch.as_tensor(made, dtype=dtype, device=device)
        if _traced(tensor):
            return tensor
        _kept[key] = tensor
    return _kept[key]


def _traced(tensor: Tensor) -> bool:
    """Whether a tensor is a tracer's stand-in, which means nothing outside of its trace."""
    return type(tensor) is not Tensor


def number(value: Tensor | float, like: Tensor) -> Tensor:
    """A number that may change from call to call as a tensor like another one: filled in there, not copied."""
    return value.to(like) if isinstance(value, Tensor) else like.new_full((), value)


def numbers(values: Sequence[Sequence[float]], like: Tensor) -> Tensor:
    """As `number`, for a few rows of numbers."""
    if not waits(like):
        return like.new_tensor(values)
    return torch.stack([torch.stack([number(value, like) for value in row]) for row in values])


def sent(tensor: Tensor, like: Tensor) -> Tensor:
    """A tensor of the host on the device of another one. A GPU copies it from page-locked memory when its turn comes,
    while the host goes on."""
    if tensor.device == like.device or not like.is_cuda:
        return tensor.to(like.device)
    return tensor.pin_memory().to(like.device, non_blocking=True)


def places(mask: Tensor) -> tuple[Tensor, ...]:
    """Indices of what is set in a mask, as ``mask.nonzero(as_tuple=True)``; where the host would wait for their number,
    those of all else come after them."""
    if not waits(mask):
        return mask.nonzero(as_tuple=True)
    order, along = mask.flatten().byte().argsort(descending=True, stable=True), list[Tensor]()
    for size in reversed(mask.shape):
        along.insert(0, order % size)
        order = order // size
    return tuple(along)


def waits(tensor: Tensor) -> bool:
    """Whether the host would wait to read a number of a tensor: shortcuts that depend on one are not worth that."""
    return tensor.device.type != "cpu"
