"""Frames as multi-layer OpenEXR files, and back bit by bit.

Every channel and signal is a layer named as in the frame (``depth.Z``, ``normal.X``, ``albedo.R``...), what lies behind
the first surface has the prefix ``behind``, and plain ``R``, ``G``, ``B`` hold the best linear picture for viewers.
Signals of another size than the picture (the environment, the exposure) have parts of their own. The attribute
``gbufrt`` holds cameras, indices and the list of layers as JSON.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import torch
from torch import Tensor

from gbufrt.files.guard import MAX_PIXELS, Part, read_parts, silence
from gbufrt.files.header import ATTRIBUTE, CONVENTIONS, FORMAT, camera_in, camera_out, read_attribute
from gbufrt.files.output import atomic
from gbufrt.frame import SIGNALS, Frame
from gbufrt.gbuffer import CHANNELS, GBuffer
from gbufrt.tree import map_tensors

MAIN = "frame"
SUFFIXES = {"depth": "Z", "motion_z": "Z", "hit": "A"}
VECTORS = {"normal", "normal_geo", "bent_normal"}
NUMBERS = {"float32": np.float32, "float64": np.float32, "bool": np.float16}  # what a type is stored as, else uint32
MOST_INDEX = (1 << 31) - 1  # of a frame, which seeds the noise
MOST_SECONDS = 1e12
TYPES = ("float32", "bool", "int16", "int32", "int64")


def write_exr(
    path: str | Path, frame: Frame, *, element: int | None = None, notes: Mapping[str, Any] | None = None
) -> None:
    """Write a frame, whole or not at all: every channel and signal, ``behind``, cameras and indices.

    Args:
        path: the file to make; missing folders are made.
        frame: what to write. ``frame.previous`` is not written. float64 is rounded to float32.
        element: which of a batch to write; a file holds one.
        notes: anything that JSON can hold, kept in the header; see `read_notes`.

    Raises:
        ValueError: the frame holds several elements and ``element`` does not say which, or an integer signal does not
            fit 32 bits.
    """
    batch = frame.gbuffer.batch
    if element is None and batch != 1:
        raise ValueError(f"an EXR file holds one frame, got a batch of {batch}; choose one with element=0..{batch - 1}")
    if element is not None and not 0 <= element < batch:
        raise ValueError(f"element must lie in 0..{batch - 1}, got {element}")
    place = element or 0
    frame = map_tensors(lambda t: t[place : place + 1].detach().cpu(), frame.replace(previous=None))
    parts: dict[str, dict[str, np.ndarray]] = {MAIN: dict(zip("RGB", _planes(best_picture(frame)), strict=True))}
    head = {"format": FORMAT, **_pack(frame, parts, ""), "conventions": CONVENTIONS, "notes": dict(notes or {})}
    height, width = frame.gbuffer.camera.size
    display = _window(height, width)
    written = []
    for name, channels in parts.items():
        rows, columns = next(iter(channels.values())).shape
        header = {
            "type": OpenEXR.scanlineimage,
            "compression": OpenEXR.ZIP_COMPRESSION,
            "displayWindow": display,
            "dataWindow": _window(rows, columns),
        }
        if name == MAIN:
            header |= {ATTRIBUTE: json.dumps(head), "software": "gbufrt"}
        written.append(OpenEXR.Part(header, channels, name))
    with atomic(path) as temporary, silence():
        OpenEXR.File(written).write(str(temporary))


def read_exr(path: str | Path, *, max_pixels: int = MAX_PIXELS) -> Frame:
    """Read a frame that `write_exr` wrote, as a batch of one on the CPU.

    Args:
        path: the file.
        max_pixels: the largest picture to accept.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: not an OpenEXR file, damaged, of absurd size, or without gbufrt's attribute.
    """
    parts = {part.name: part for part in read_parts(path, max_pixels=max_pixels)}
    head = read_attribute(path, parts.values())
    try:
        return _unpack(head, parts)
    except (KeyError, TypeError, ValueError, IndexError, AttributeError, OverflowError, RuntimeError) as error:
        raise ValueError(f"{path} is damaged: {_reason(error)}") from error


def read_notes(path: str | Path, *, max_pixels: int = MAX_PIXELS) -> dict[str, Any]:
    """The ``notes`` of a file that `write_exr` wrote, without reading its pixels; raises as `read_exr`."""
    notes = read_attribute(path, read_parts(path, max_pixels=max_pixels, header_only=True)).get("notes", {})
    if not isinstance(notes, dict):
        raise ValueError(f"{path} is damaged: its notes must be a JSON object")
    return notes


def best_picture(frame: Frame) -> Tensor:
    """``(B, 3, H, W)``: the most finished linear picture in the frame, exposed where it has an exposure."""
    for name in ("color", "composite"):
        picture = frame.get(name)
        if picture is not None:
            return picture if frame.exposure is None else picture * frame.exposure
    if frame.radiance is not None:
        return frame.radiance if frame.ambient is None else frame.radiance + frame.ambient
    albedo = frame.gbuffer.albedo
    return frame.gbuffer.normal * 0.5 + 0.5 if albedo is None else albedo


def _pack(frame: Frame, parts: dict[str, dict[str, np.ndarray]], prefix: str) -> dict[str, Any]:
    """Add the frame's channels to ``parts`` and describe them."""
    g, layers = frame.gbuffer, {}
    for name in frame.present:
        tensor = frame.read(name)
        layer = prefix + name
        part = MAIN if tuple(tensor.shape[-2:]) == g.camera.size else f"own.{layer}"
        names = [f"{layer}.{suffix}" for suffix in _suffixes(name, tensor)]
        channels = parts.setdefault(part, {})
        if not channels.keys().isdisjoint(names):
            raise ValueError(f"signal {layer!r} would be written to {names[0]!r}, which is taken; rename it")
        channels.update(zip(names, _planes(tensor, layer), strict=True))
        kind = _type(tensor)
        layers[name] = {"part": part, "channels": names, "type": "float32" if kind == "float64" else kind}
    return {
        "camera": camera_out(g.camera),
        "previous_camera": None if g.previous_camera is None else camera_out(g.previous_camera),
        "index": frame.index,
        "time": frame.time,
        "cut": None if frame.cut is None else bool(frame.cut[0]),
        "emitters_sampled": frame.emitters_sampled,
        "layers": layers,
        "behind": None if frame.behind is None else _pack(frame.behind, parts, f"{prefix}behind."),
    }


def _unpack(head: Mapping[str, Any], parts: Mapping[str, Part]) -> Frame:
    layers: dict[str, Any] = {name: _layer(name, row, parts) for name, row in head["layers"].items()}
    before = head["previous_camera"]
    gbuffer = GBuffer(
        camera=camera_in(head["camera"]),
        previous_camera=None if before is None else camera_in(before),
        **{name: tensor for name, tensor in layers.items() if name in CHANNELS},
    )
    return Frame(
        gbuffer=gbuffer,
        index=_number("index", head["index"], int, MOST_INDEX),
        time=float(_number("time", head["time"], (int, float), MOST_SECONDS)),
        cut=None if head["cut"] is None else torch.tensor([bool(head["cut"])]),
        emitters_sampled=bool(head["emitters_sampled"]),
        behind=None if head["behind"] is None else _unpack(head["behind"], parts),
        extra={name: tensor for name, tensor in layers.items() if name not in CHANNELS and name not in SIGNALS},
        **{name: tensor for name, tensor in layers.items() if name in SIGNALS},
    )


def _number(name: str, value: Any, kind: Any, most: float) -> Any:
    if not isinstance(value, kind) or isinstance(value, bool) or not abs(value) <= most:
        raise ValueError(f"its {name} must be a number of at most {most:g}")
    return value


def _planes(tensor: Tensor, name: str = "") -> Iterator[np.ndarray]:
    kind = _type(tensor)
    array = tensor[0].numpy()
    if kind not in (*TYPES, "float64"):
        raise ValueError(f"{name} must be of type {', '.join(TYPES)} or float64 to be written, got {kind}")
    if kind not in NUMBERS:
        if array.size and (array.min() < -(2**31) or array.max() >= 2**31):
            raise ValueError(f"{name} must fit 32 bits to be written, got {array.min()}..{array.max()}")
        return iter(np.ascontiguousarray(array.astype(np.int32)).view(np.uint32))
    return iter(np.ascontiguousarray(array.astype(NUMBERS[kind])))


def _layer(name: str, row: Mapping[str, Any], parts: Mapping[str, Part]) -> Tensor:
    kind = row["type"]
    if kind not in TYPES:
        raise ValueError(f"layer {name!r} has the unknown type {kind!r}")
    channels = parts[row["part"]].channels
    stored = np.dtype(NUMBERS.get(kind, np.uint32))
    for channel in row["channels"]:
        if channels[channel].dtype != stored:
            raise ValueError(f"channel {channel!r} must be {stored}, got {channels[channel].dtype}")
    array = np.stack([channels[channel] for channel in row["channels"]])[None]
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


def _window(height: int, width: int) -> tuple[np.ndarray, np.ndarray]:
    return np.zeros(2, dtype=np.int32), np.array([width - 1, height - 1], dtype=np.int32)


def _reason(error: Exception) -> str:
    text = str(error).strip().splitlines()
    return f"{error} is missing" if isinstance(error, KeyError) else (text[0] if text else type(error).__name__)
