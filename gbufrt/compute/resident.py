"""Constants as tensors, copied to a device once."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any

import torch
from torch import Tensor

_kept: dict[tuple[Hashable, torch.dtype, torch.device], Tensor] = {}


def resident(values: Any, like: Tensor) -> Tensor:
    """Numbers as a tensor of the type and on the device of another one. They are copied there at the first call only.

    A copy from the host to a GPU in each frame waits for the GPU, and no CUDA graph can hold it.

    Args:
        values: tuples of numbers, or a function of no arguments that returns an array or tensor. Callers must not
            write to the result: it is shared.
        like: has a floating type.

    Returns:
        The tensor.
    """
    key = values, like.dtype, like.device
    if key not in _kept:
        with torch.inference_mode(False), torch.no_grad():
            made: Any = values() if isinstance(values, Callable) else values
            tensor = torch.as_tensor(made, dtype=like.dtype, device=like.device)
        if type(tensor) is not Tensor:
            return tensor  # a tracer's stand-in, which means nothing outside of its trace
        _kept[key] = tensor
    return _kept[key]
