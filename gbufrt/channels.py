"""The form of a channel: how many components it has, in what space and unit, and what an empty pixel holds."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import torch
from torch import Tensor

from gbufrt.numeric import check_kind

Kind = Literal["float", "bool", "int"]
NUMBERS: dict[Kind, tuple[torch.dtype, ...]] = {
    "float": (torch.float32, torch.float64),
    "bool": (torch.bool,),
    "int": (torch.int32, torch.int16, torch.int64),
}
"""Types of a channel's numbers; a message names those of floats, else the first."""


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
        raise TypeError(f"{name} must be a torch.Tensor, got {_told_kind(tensor)}")
    expected = f"({batch},{row.components},{size[0]},{size[1]})" if row.full_size else f"({batch},{row.components},h,w)"
    shape = tuple(tensor.shape)
    fits = len(shape) == 4 and shape[:2] == (batch, row.components) and _fits(shape[2:], size, row)
    if not fits:
        hint = _shape_hint(shape, row) or _camera_hint(shape, batch, size, row)
        raise ValueError(f"{name} must be {expected}, {row.meaning}; got {_shape_text(shape)}{hint}")
    _check_numbers(name, tensor, row.kind)
    if tensor.device != device:
        raise ValueError(f"{name} is on {tensor.device} but the camera is on {device}; move one with .to()")


def check_extra(extra: Any, tables: tuple[Collection[str], ...]) -> None:
    """Raise unless extra signals are tensors by names that are in none of the ``tables``.

    Raises:
        TypeError: no mapping, a name that is no text, or no tensor.
        ValueError: a known name.
    """
    if not isinstance(extra, Mapping):
        raise TypeError(f'extra must be a mapping such as {{"mine": tensor}}, got {type(extra).__name__}')
    for name, tensor in extra.items():
        if not isinstance(name, str):
            raise TypeError(f"extra signals are named by text, got {name!r}")
        if not isinstance(tensor, Tensor):
            raise TypeError(f"extra signal {name!r} must be a torch.Tensor, got {_told_kind(tensor)}")
        if any(name in known for known in tables):
            raise ValueError(f"extra signal {name!r} has the name of a known channel; set that one instead")


def check_layer(kind: type, name: str, layer: Any, like: Any = None) -> None:
    """Raise TypeError unless what a frame holds as ``name`` is None or of its own ``kind``, and ValueError unless it
    has the pixels of a camera that it must be ``like``."""
    if layer is None:
        return
    check_kind(kind, name, layer)
    camera = layer.gbuffer.camera
    if like is not None and (camera.batch, *camera.size) != (like.batch, *like.size):
        (h, w), (height, width) = camera.size, like.size
        found = f"{w}x{h} pixels in a batch of {camera.batch}"
        raise ValueError(f"{name} must have {width}x{height} pixels in a batch of {like.batch}, got {found}")


def check_picture(name: str, picture: Any, meaning: str, components: int | None = 3) -> None:
    """Raise unless ``picture`` is ``(B, C, H, W)`` of float32 or float64, C being ``components`` or, if None, any.

    Raises:
        TypeError: not a tensor, or of other numbers.
        ValueError: wrong shape.
    """
    if not isinstance(picture, Tensor):
        raise TypeError(f"{name} must be a torch.Tensor, got {_told_kind(picture)}")
    shape, row = tuple(picture.shape), Channel(components or 3, meaning)
    if len(shape) != 4 or shape[1] != (components or max(shape[1], 1)):
        wanted = f"(B,{components or 'C'},H,W)"
        raise ValueError(f"{name} must be {wanted}, {meaning}; got {_shape_text(shape)}{_shape_hint(shape, row)}")
    _check_numbers(name, picture, "float")


def check_like(name: str, picture: Any, first: str, like: Tensor, components: tuple[int, ...]) -> None:
    """Raise unless ``picture`` has the batch, size, device and kind of number of the one called ``first``.

    Args:
        name: of the picture.
        picture: ``(B, C, H, W)``.
        first: name of ``like``.
        like: a picture that fits `check_picture`.
        components: what C may be; a message names the first.

    Raises:
        TypeError: not a tensor, or of other numbers.
        ValueError: wrong shape or device.
    """
    if not isinstance(picture, Tensor):
        raise TypeError(f"{name} must be a torch.Tensor, got {_told_kind(picture)}")
    (batch, _, *size), shape = like.shape, tuple(picture.shape)
    if len(shape) != 4 or shape[1] not in components or [shape[0], *shape[2:]] != [batch, *size]:
        wanted = _shape_text((batch, components[0], *size))
        last = len(shape) == 4 and shape[2:] == like.shape[1:3]
        hint = f"; if {first} is (B,H,W,C), use .permute(0, 3, 1, 2)" if last else ""
        raise ValueError(f"{name} must be {wanted} like {first}; got {_shape_text(shape)}{hint}")
    _check_numbers(name, picture, "float")
    if picture.device != like.device:
        raise ValueError(f"{name} is on {picture.device} but {first} is on {like.device}; move one with .to()")
    check_one_kind(**{first: like, name: picture})


def check_one_kind(**pictures: Any) -> None:
    """Raise TypeError unless pictures of floats are of one kind, all float32 or all float64: kernels mix them nowhere.

    The first of them sets it. What holds no floats, and numbers for every pixel, are passed over.
    """
    tensors = {name: picture for name, picture in pictures.items() if isinstance(picture, Tensor) and picture.ndim}
    kinds = {name: tensor.dtype for name, tensor in tensors.items() if tensor.is_floating_point()}
    first = next(iter(kinds), "")
    for name, kind in kinds.items():
        if kind != kinds[first]:
            told = f"{name} is {_kind_text(kind)} but {first} is {_kind_text(kinds[first])}"
            raise TypeError(f"{told}; make them alike with .float()")


def _check_numbers(name: str, tensor: Tensor, kind: Kind) -> None:
    if tensor.dtype not in NUMBERS[kind]:
        bytes_ = kind == "float" and tensor.dtype == torch.uint8
        remedy = ".float() / 255, if it is a picture of bytes" if bytes_ else f".{kind}()"
        wanted = " or ".join(map(_kind_text, NUMBERS[kind] if kind == "float" else NUMBERS[kind][:1]))
        raise TypeError(f"{name} must be {wanted}, got {_kind_text(tensor.dtype)}; convert it with {remedy}")


def _told_kind(value: Any) -> str:
    return "ndarray; use torch.from_numpy(x)" if isinstance(value, np.ndarray) else type(value).__name__


def _kind_text(kind: torch.dtype) -> str:
    return str(kind).removeprefix("torch.")


def _fits(shape: tuple[int, ...], size: tuple[int, int], row: Channel) -> bool:
    larger = row.larger and shape[0] >= size[0] and shape[1] >= size[1]
    return larger or shape == size or not (row.full_size or 0 in shape)


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
    if len(shape) == 4 and shape[1] == 4 and row.components == 3:
        return "; leave alpha out: x[:, :3]"
    if len(shape) == 4 and shape[1] == 1 and row.components == 3:
        return "; make three of one: x.expand(-1, 3, -1, -1)"
    if len(shape) == 4 and shape[1] == 3 and row.components == 1:
        return "; take one of three alike: x[:, :1]"
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
