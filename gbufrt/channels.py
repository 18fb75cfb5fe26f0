"""The form of a channel: how many components it has, in what space and unit, and what an empty pixel holds."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any, Literal

import torch
from torch import Tensor

Kind = Literal["float", "bool", "int"]


@dataclass(frozen=True)
class Channel:
    """One row of the channel table; see `gbufrt.gbuffer.CHANNELS` and `gbufrt.frame.SIGNALS`."""

    components: int
    """C of ``(B, C, H, W)``."""
    meaning: str
    """What the numbers are, with unit and space."""
    kind: Kind = "float"
    clear: float = 0.0
    """What a pixel that hit nothing holds (``nan`` stands for the camera's ``far``)."""
    required: bool = False
    full_size: bool = True
    """False for the few that are not one value a pixel of the picture (environment, exposure)."""
    larger: bool = False
    """Whether it may be larger than the G-buffer, as pictures are after `post.Upscale`."""


def channel(
    components: int,
    meaning: str,
    *,
    kind: Kind = "float",
    clear: float = 0.0,
    required: bool = False,
    full_size: bool = True,
    larger: bool = False,
) -> Any:
    """A dataclass field that carries its own row of the channel table."""
    row = Channel(components, meaning, kind, clear, required, full_size, larger)
    if required:
        return dataclasses.field(metadata={"channel": row})
    return dataclasses.field(default=None, metadata={"channel": row})


def channels_of(cls: type) -> dict[str, Channel]:
    """The channel table of a dataclass, by name, in the order of declaration."""
    return {f.name: f.metadata["channel"] for f in dataclasses.fields(cls) if "channel" in f.metadata}


def check_tensor(
    name: str, tensor: Any, row: Channel, *, batch: int, size: tuple[int, int], device: torch.device
) -> None:
    """Raise if ``tensor`` breaks the form that ``row`` gives it.

    Raises:
        TypeError: not a tensor, or of the wrong kind of number.
        ValueError: wrong shape or device.
    """
    if not isinstance(tensor, Tensor):
        raise TypeError(f"{name} must be a torch.Tensor, got {type(tensor).__name__}")
    expected = f"({batch},{row.components},{size[0]},{size[1]})" if row.full_size else f"({batch},{row.components},h,w)"
    shape = tuple(tensor.shape)
    fits = len(shape) == 4 and shape[:2] == (batch, row.components) and _fits(shape[2:], size, row)
    if not fits:
        hint = _shape_hint(shape, row) or _camera_hint(shape, batch, size, row)
        raise ValueError(f"{name} must be {expected}, {row.meaning}; got {_shape_text(shape)}{hint}")
    right = {
        "float": tensor.dtype in (torch.float32, torch.float64),
        "bool": tensor.dtype == torch.bool,
        "int": tensor.dtype in (torch.int16, torch.int32, torch.int64),
    }[row.kind]
    if not right:
        wanted = {"float": "float32 or float64", "bool": "bool", "int": "int32"}[row.kind]
        raise TypeError(
            f"{name} must be {wanted}, got {str(tensor.dtype).removeprefix('torch.')}; convert it with .to()"
        )
    if tensor.device != device:
        raise ValueError(f"{name} is on {tensor.device} but the camera is on {device}; move one with .to()")


def check_picture(name: str, picture: Any, meaning: str, components: int = 3) -> None:
    """Raise unless ``picture`` is ``(B, C, H, W)`` of floats.

    Raises:
        TypeError: not a tensor, or of whole numbers.
        ValueError: wrong shape.
    """
    if not isinstance(picture, Tensor):
        raise TypeError(f"{name} must be a torch.Tensor, got {type(picture).__name__}")
    shape, row = tuple(picture.shape), Channel(components, meaning)
    if len(shape) != 4 or shape[1] != components:
        hint = _shape_hint(shape, row)
        raise ValueError(f"{name} must be (B,{components},H,W), {meaning}; got {_shape_text(shape)}{hint}")
    if not picture.is_floating_point():
        raise TypeError(f"{name} must be of floats, got {str(picture.dtype).removeprefix('torch.')}")


def _fits(shape: tuple[int, ...], size: tuple[int, int], row: Channel) -> bool:
    larger = row.larger and shape[0] >= size[0] and shape[1] >= size[1]
    return larger or not row.full_size or shape == size


def _shape_text(shape: tuple[int, ...]) -> str:
    return "(" + ",".join(map(str, shape)) + ")"


def _shape_hint(shape: tuple[int, ...], row: Channel) -> str:
    if len(shape) == 4 and shape[-1] == row.components and shape[1] != row.components:
        return "; it looks channels-last: use .permute(0, 3, 1, 2)"
    if len(shape) == 3 and shape[-1] == row.components != shape[0]:
        return "; it looks channels-last, without a batch: use .permute(2, 0, 1)[None]"
    if len(shape) == 3 and shape[0] == row.components:
        return "; add the batch dimension: x[None]"
    if len(shape) == 2 and row.components == 1:
        return "; add batch and channel dimensions: x[None, None]"
    return ""


def _camera_hint(shape: tuple[int, ...], batch: int, size: tuple[int, int], row: Channel) -> str:
    """What to do where batch or size alone are not the camera's."""
    if len(shape) != 4 or shape[1] != row.components:
        return ""
    if shape[0] != batch and _fits(shape[2:], size, row):
        return (
            f"; the camera sets the batch, {batch}: give it a pose for each picture, (B,4,4), or each picture its own"
        )
    if shape[2:] == size[::-1]:
        return "; height comes before width: use .transpose(2, 3), or size=(H, W) for the camera"
    return f"; the camera sets the size, {size[0]} rows of {size[1]} pixels" if shape[0] == batch else ""
