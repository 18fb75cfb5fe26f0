"""The layers of an EXR file: what each channel is called, how its numbers are stored, and in which part."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

import numpy as np
import torch
from torch import Tensor

from gbufrt.files.header import camera_out
from gbufrt.files.precision import Precision, is_half, to_half
from gbufrt.frame import LIGHT, SIGNALS, Frame
from gbufrt.gbuffer import CHANNELS

MAIN = "frame"
KEPT = "exact"  # part of what DWAA would hurt
SMALL = "rendered"  # part of a G-buffer that is smaller than the picture, and of its light
Compression = Literal["zip", "dwaa"]
COMPRESSIONS: tuple[str, ...] = get_args(Compression)
SUFFIXES = {"depth": "Z", "motion_z": "Z", "hit": "A"}
VECTORS = {"normal", "normal_geo", "bent_normal"}
NUMBERS = {"float32": np.float32, "float64": np.float32, "bool": np.float16}  # what a type is stored as, else uint32
TYPES = ("float32", "bool", "int16", "int32", "int64")
Planes = Mapping[str, dict[str, np.ndarray]]
"""Channels of a file by part and name, ``(H, W)`` each."""


@dataclass
class Packed:
    """The parts of a file in the making."""

    precision: Precision
    compression: Compression
    only: frozenset[str]
    size: tuple[int, int]
    """Of the picture."""
    found: set[str] = field(default_factory=set)
    """Those of ``only`` that the frame has."""
    parts: dict[str, dict[str, np.ndarray]] = field(default_factory=dict)

    def add(self, part: str, planes: Iterable[tuple[str, np.ndarray]]) -> None:
        self.parts.setdefault(part, {}).update(planes)

    def pack(self, frame: Frame, prefix: str) -> dict[str, Any]:
        """Add the frame's channels to the parts and describe them."""
        g, layers = frame.gbuffer, {}
        for name in filter(lambda name: self._wanted(prefix, name), frame.present):
            tensor = frame.read(name)
            layer = prefix + name
            names = [f"{layer}.{suffix}" for suffix in _suffixes(name, tensor)]
            part = self._part(name, tensor, names, g.camera.size) or f"own.{layer}"
            if any(not there.keys().isdisjoint(names) for there in self.parts.values()):
                raise ValueError(f"signal {layer!r} would be written to {names[0]!r}, which is taken; rename it")
            planes = planes_of(tensor, layer, half=is_half(name, tensor, self.precision))
            self.add(part, zip(names, planes, strict=True))
            kind = _type(tensor)
            layers[name] = {"part": part, "channels": names, "type": "float32" if kind == "float64" else kind}
        behind = None if frame.behind is None else self.pack(frame.behind, f"{prefix}behind.")
        return {
            "camera": camera_out(g.camera),
            "previous_camera": None if g.previous_camera is None else camera_out(g.previous_camera),
            "index": frame.index.item() if isinstance(frame.index, Tensor) else frame.index,
            "time": float(frame.time),
            "cut": None if frame.cut is None else bool(frame.cut[0]),
            "emitters_sampled": frame.emitters_sampled,
            "emitters_mirrored": frame.emitters_mirrored,
            "layers": layers,
            "behind": behind if behind is not None and (behind["layers"] or not self.only) else None,
        }

    def _wanted(self, prefix: str, name: str) -> bool:
        asked = self.only & {prefix + name, prefix.partition(".")[0]}
        self.found |= asked
        return bool(asked) or not self.only

    def _part(self, name: str, tensor: Tensor, names: list[str], rendered: tuple[int, int]) -> str:
        """Where a layer goes; empty for one that needs a part of its own. See the docstring of `gbufrt.files.exr`."""
        size = tuple(tensor.shape[-2:])
        if size != self.size:
            return SMALL if size == rendered else ""
        result = name in SIGNALS and name not in LIGHT and tensor.is_floating_point()
        return MAIN if self.compression == "zip" or (result and names[0].endswith(".R")) else KEPT


def planes_of(tensor: Tensor, name: str = "", *, half: bool = False) -> Iterator[np.ndarray]:
    if half:
        return iter(np.ascontiguousarray(to_half(tensor)[0].numpy()))
    kind = _type(tensor)
    array = tensor[0].numpy()
    if kind not in (*TYPES, "float64"):
        raise ValueError(f"{name} must be of type {', '.join(TYPES)} or float64 to be written, got {kind}")
    if kind not in NUMBERS:
        if array.size and (array.min() < -(2**31) or array.max() >= 2**31):
            raise ValueError(f"{name} must fit 32 bits to be written, got {array.min()}..{array.max()}")
        return iter(np.ascontiguousarray(array.astype(np.int32)).view(np.uint32))
    return iter(np.ascontiguousarray(array.astype(NUMBERS[kind])))


def layer_of(name: str, row: Mapping[str, Any], parts: Planes) -> Tensor:
    """The layer that a row of the header describes; its planes are taken out of their part."""
    kind = row["type"]
    if kind not in TYPES:
        raise ValueError(f"layer {name!r} has the unknown type {kind!r}")
    channels = parts[row["part"]]
    stored = np.dtype(NUMBERS.get(kind, np.uint32))
    if kind == "float32" and name in (*CHANNELS, *SIGNALS) and channels[row["channels"][0]].dtype == np.float16:
        stored = np.dtype(np.float16)
    for channel in row["channels"]:
        if channels[channel].dtype != stored:
            raise ValueError(f"channel {channel!r} must be {stored}, got {channels[channel].dtype}")
    array = np.stack([channels.pop(channel) for channel in row["channels"]])[None]
    array = array.view(np.int32) if stored == np.uint32 else array
    return torch.from_numpy(array).to(getattr(torch, kind))


def _type(tensor: Tensor) -> str:
    return str(tensor.dtype).removeprefix("torch.")


def _suffixes(name: str, tensor: Tensor) -> list[str]:
    count = tensor.shape[1]
    if name in SUFFIXES:
        return [SUFFIXES[name]]
    if count > 4:
        return [str(i) for i in range(count)]
    return list(("X", "XY", "XYZ" if name in VECTORS else "RGB", "RGBA")[count - 1])
