"""Checks of the numbers, kinds and devices that functions are given, by the names of their arguments."""

from __future__ import annotations

import math
from os import PathLike
from typing import Any

import numpy as np
import torch
from torch import Tensor

from gbufrt.compute.resident import waits


def check_numbers(**values: Any) -> None:
    """Raise TypeError where a value, by its argument's name, is neither a number nor a 0-dim tensor."""
    for name, value in values.items():
        if not _is_number(value) or getattr(value, "ndim", 0):
            raise TypeError(f"{name} must be a number or a 0-dim tensor, got {_told(value)}")


def check_between(low: float, high: float, **values: Any) -> None:
    """Raise unless numbers, by their arguments' names, lie in ``low`` to ``high``; those on a GPU are left alone.

    Raises:
        TypeError: a value is neither a number nor a 0-dim tensor.
        ValueError: it is out of range, or NaN.
    """
    check_numbers(**values)
    wanted = f"be at least {low:g}" if high == math.inf else f"lie in {low:g} to {high:g}"
    for name, value in values.items():
        if isinstance(value, Tensor) and waits(value):
            continue
        number = float(value.detach() if isinstance(value, Tensor) else value)
        if not low <= number <= high:
            raise ValueError(f"{name} must {wanted}, got {number:g}")


def check_each(low: float, *, above: bool = False, unit: str = "", **values: Any) -> None:
    """Raise unless numbers, or all numbers of a tensor, are at least ``low``, or above it; on a GPU all go.

    Args:
        low: the least number.
        above: whether that is too little itself.
        unit: of the numbers, for the message.
        values: by the names of their arguments; tensors of any shape.

    Raises:
        TypeError: a value is neither a number nor a tensor.
        ValueError: it is out of range, or NaN.
    """
    for name, value in values.items():
        if not _is_number(value):
            raise TypeError(f"{name} must be a number or a tensor, got {_told(value)}")
        if isinstance(value, Tensor) and waits(value):
            continue
        if isinstance(value, Tensor) and not value.numel():
            raise ValueError(f"{name} must hold a number at least, got an empty tensor {tuple(value.shape)}")
        least = float(value.detach().min() if isinstance(value, Tensor) else value)
        if not (least > low if above else least >= low):
            wanted = ("be positive" if low == 0 else f"be above {low:g}") if above else f"be at least {low:g}"
            raise ValueError(f"{name} must {wanted}{unit and f', in {unit}'}, got {least:g}")


def check_for_each(batch: int, **values: Any) -> None:
    """Raise ValueError where a tensor, by its argument's name, holds neither one number nor one for each picture."""
    for name, value in values.items():
        if isinstance(value, Tensor) and value.numel() not in (1, batch):
            raise ValueError(f"{name} must hold one number, or {batch}: one for each picture; got {_told(value)}")


def check_counts(**values: Any) -> None:
    """Raise TypeError where a value, by its argument's name, is no whole number."""
    for name, value in values.items():
        broken = isinstance(value, Tensor) and value.is_floating_point()  # every tensor has __index__
        if not hasattr(value, "__index__") or getattr(value, "ndim", 0) or broken:
            raise TypeError(f"{name} must be a whole number, got {_told(value)}")


def check_flags(**values: Any) -> None:
    """Raise TypeError where a value, by its argument's name, is neither True nor False."""
    for name, value in values.items():
        if not isinstance(value, (bool, np.bool_)):
            raise TypeError(f"{name} must be True or False, got {_told(value)}")


def check_index(index: Any) -> None:
    """Raise unless a frame's number is a whole number, TypeError, or a 0-dim tensor of such, ValueError."""
    if not isinstance(index, Tensor):
        check_counts(index=index)
    elif index.ndim or index.dtype not in (torch.int32, torch.int64):
        raise ValueError(f"index must be an int or () int64, got {tuple(index.shape)} {index.dtype}")


def check_bits(**masks: Any) -> None:
    """Raise TypeError where a mask, by its argument's name, is no whole number, and ValueError where it is too long.

    One bit is the sign, so that ``~1`` is all bits but the first.
    """
    check_counts(**masks)
    check_between(-(2**31), 2**31 - 1, **masks)


def check_wholes(count: int, example: str, **values: Any) -> None:
    """Raise TypeError where a value, by its argument's name, is neither None nor ``count`` whole numbers."""
    for name, value in values.items():
        numbers = value if isinstance(value, (tuple, list)) else ()
        if value is not None and not (len(numbers) == count and all(hasattr(n, "__index__") for n in numbers)):
            raise TypeError(f"{name} must be {count} whole numbers, {example}, got {value!r}")


def check_kind(kind: type, name: str, value: Any, remedy: str = "") -> None:
    """Raise TypeError, with a remedy, unless what the argument ``name`` holds is of a class of ours."""
    if not isinstance(value, kind):
        package = kind.__module__.partition(".")[0]
        raise TypeError(f"{name} must be a {package}.{kind.__name__}, got {type(value).__name__}{remedy}")


def check_destination(*args: Any, **kwargs: Any) -> None:
    """Raise ValueError where arguments of `torch.Tensor.to` name a device that torch does not know, or does not see."""
    device = kwargs.get("device", args[0] if args else None)
    if device is None or isinstance(device, (torch.dtype, Tensor)):
        return
    try:
        found = torch.device(device)
    except (RuntimeError, TypeError) as error:
        raise ValueError(f"device must be one that torch knows, such as 'cpu' or 'cuda', got {device!r}") from error
    if found.type == "cuda" and (found.index or 0) >= torch.cuda.device_count():
        seen = torch.cuda.device_count()
        raise ValueError(f"there is no device {str(found)!r}: torch sees {seen or 'no'} GPUs; 'cpu' is always there")


def check_three(name: str, value: Any, whose: str) -> None:
    """Raise TypeError unless a colour or direction is three numbers."""
    try:
        fits = len(value) == 3 and all(hasattr(n, "__float__") and not getattr(n, "ndim", 0) for n in value)
    except TypeError:
        fits = False
    if not fits:
        got = value if isinstance(value, (tuple, list, type(None))) else _told(value)
        raise TypeError(f"{name} of {whose} must be three numbers such as (0.8, 0.7, 0.5), got {got}")


def check_path(name: str, value: Any) -> None:
    """Raise TypeError unless an argument is a path, or the text of one."""
    if not isinstance(value, (str, PathLike)):
        raise TypeError(f"{name} must be a path, got {_told(value)}")


def check_function(name: str, value: Any, of: str) -> None:
    """Raise TypeError unless an argument is a function ``of`` something, in words."""
    if not callable(value) or isinstance(value, type):
        raise TypeError(f"{name} must be a function {of}, got {_told(value)}")


def check_size(size: Any) -> None:
    """Raise ValueError unless ``size`` is the rows and columns of a picture."""
    if isinstance(size, (tuple, list)) and len(size) == 2 and all(hasattr(n, "__index__") and n >= 1 for n in size):
        return
    got = _told(size) if isinstance(size, Tensor) else repr(size)
    raise ValueError(f"size must be (H, W), whole numbers of at least 1 such as (540, 960), got {got}")


def _is_number(value: Any) -> bool:
    """Whether it is a real number or holds such: torch takes no arrays of numpy for numbers, however small."""
    if isinstance(value, Tensor):
        return not value.is_complex()
    return hasattr(value, "__float__") and not isinstance(value, np.ndarray)


def _told(value: Any) -> str:
    if isinstance(value, (str, int, float)):
        return repr(value)
    if isinstance(value, Tensor):
        return f"one of shape {tuple(value.shape)}" if value.ndim else f"one of {value.dtype}"
    return type(value).__name__
