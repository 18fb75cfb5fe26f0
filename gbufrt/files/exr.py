"""Frames as multi-layer OpenEXR files, and back: bit by bit, or with colours rounded to half.

Every channel and signal is a layer named as in the frame (``depth.Z``, ``normal.X``, ``albedo.R``...), what lies behind
the first surface has the prefix ``behind``, and plain ``R``, ``G``, ``B`` hold the best linear picture for viewers.
Signals of another size than the picture (the environment, the exposure) have parts of their own; a G-buffer that is
smaller than an upscaled picture lies with its light in the part ``rendered``. The attribute ``gbufrt`` holds cameras,
indices and the list of layers as JSON; ``chromaticities`` says that colours are Rec. 709's,
``worldToCamera`` and ``worldToNDC`` hold the camera for other programs.

DWAA is lossy in every channel of a part whose last name is R, G, B or Y, so in ``normal.Y`` too. With it the first part
holds the picture and the coloured results alone, and all else lies in a second one, packed with ZIP.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import torch
from torch import Tensor

from gbufrt.demands.inputs import check_frame
from gbufrt.files.guard import read_parts, silence
from gbufrt.files.header import ATTRIBUTE, CONVENTIONS, FORMAT, camera_in, read_attribute, standard_matrices
from gbufrt.files.layers import COMPRESSIONS, MAIN, Compression, Packed, Planes, layer_of, planes_of
from gbufrt.files.output import atomic, check_ending
from gbufrt.files.precision import PRECISIONS, Precision
from gbufrt.frame import SIGNALS, Frame
from gbufrt.gbuffer import CHANNELS, GBuffer
from gbufrt.tree import map_tensors

REC709 = (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329)  # x, y of red, green, blue and white; sRGB's too
REQUIRED = tuple(name for name, row in CHANNELS.items() if row.required)
KNOWN = {*CHANNELS, *SIGNALS, "behind"}
MOST_INDEX = (1 << 31) - 1  # of a frame, which seeds the noise
MOST_SECONDS = 1e12


def write_exr(
    path: str | Path,
    frame: Frame,
    *,
    element: int | None = None,
    notes: Mapping[str, Any] | None = None,
    precision: Precision = "float",
    compression: Compression = "zip",
    only: Collection[str] = (),
) -> None:
    """Write a frame, whole or not at all: channels and signals, ``behind``, cameras and indices.

    Args:
        path: the file to make; missing folders are made.
        frame: what to write. ``frame.previous`` is not written. float64 is rounded to float32.
        element: which of a batch to write; a file holds one.
        notes: anything that JSON can hold, kept in the header; see `read_notes`.
        precision: ``"float"`` keeps every bit; ``"half"`` rounds colours and shares (see `gbufrt.files.precision`) and
            keeps depth, normals, motion, distances, ids and signals without a field.
        compression: ``"zip"`` loses nothing; ``"dwaa"`` loses what is hard to see of the picture and of what passes
            wrote in RGB, nothing of G-buffer, light, and the rest.
        only: names of the channels and signals to write, ``behind.`` before those behind, ``behind`` for all of them;
            by default all. Those that this frame lacks are passed over. The picture in R, G, B is always there.
            Without depth, hit and normal a file cannot be read back as a frame.

    Raises:
        ValueError: the path does not end in .exr, the frame holds several elements and ``element`` does not say which,
            an integer signal does not fit 32 bits, or an argument is none of its values.
        OSError: the file cannot be written, as on a full disk; nothing is left of it.
    """
    check_ending(path, ".exr", "gbufrt.files.png.write_png writes pictures, such as frame.image")
    check_frame(frame)
    batch = frame.gbuffer.batch
    if element is None and batch != 1:
        raise ValueError(f"an EXR file holds one frame, got a batch of {batch}; choose one with element=0..{batch - 1}")
    if element is not None and not 0 <= element < batch:
        raise ValueError(f"element must lie in 0..{batch - 1}, got {element}")
    for name, value, known in (("precision", precision, PRECISIONS), ("compression", compression, COMPRESSIONS)):
        if value not in known:
            raise ValueError(f"{name} must be {' or '.join(known)}, got {value!r}")
    place = element or 0
    frame = map_tensors(lambda t: (t[place : place + 1] if t.ndim else t).detach().cpu(), frame.replace(previous=None))
    picture = best_picture(frame)
    height, width = picture.shape[-2:]
    packed = Packed(precision, compression, frozenset(only), (height, width))
    packed.add(MAIN, zip("RGB", planes_of(picture, half=precision == "half"), strict=True))
    head = {"format": FORMAT, **packed.pack(frame, ""), "conventions": CONVENTIONS, "notes": dict(notes or {})}
    if unknown := [name for name in packed.only - packed.found if name.removeprefix("behind.") not in KNOWN]:
        raise ValueError(f"only: the frame has no {', '.join(sorted(unknown))}; it holds {', '.join(frame.present)}")
    display = _window(height, width)
    written = []
    for name, channels in packed.parts.items():
        rows, columns = next(iter(channels.values())).shape
        dwaa = compression == "dwaa" and name == MAIN
        header = {
            "type": OpenEXR.scanlineimage,
            "compression": OpenEXR.DWAA_COMPRESSION if dwaa else OpenEXR.ZIP_COMPRESSION,
            "chromaticities": REC709,
            "displayWindow": display,
            "dataWindow": _window(rows, columns),
        }
        if name == MAIN:
            header |= {ATTRIBUTE: json.dumps(head), "software": "gbufrt", **standard_matrices(frame.gbuffer.camera)}
        written.append(OpenEXR.Part(header, channels, name))
    with atomic(path) as temporary, silence():
        try:
            OpenEXR.File(written).write(str(temporary))
        except RuntimeError as error:  # of OpenEXR; a full disk, as a rule
            raise OSError(f"{path} cannot be written, is the disk full? {error}") from error


def read_exr(path: str | Path) -> Frame:
    """Read a frame that `write_exr` wrote, as a batch of one on the CPU.

    Args:
        path: the file.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: not an OpenEXR file, damaged, of absurd size, without gbufrt's attribute, or without what every
            frame has.
    """
    parts = read_parts(path)
    head = read_attribute(path, parts)
    planes = {part.name: dict(part.channels) for part in parts}
    del parts  # so that each plane is let go of once its layer is made
    layers = head.get("layers")
    if isinstance(layers, dict) and not layers.keys() >= set(REQUIRED):
        raise ValueError(
            f"{path} is no whole frame: it holds {', '.join(layers)}; for a file to read back, write "
            f"{', '.join(REQUIRED)} too (--only)"
        )
    try:
        return _unpack(head, planes)
    except (KeyError, TypeError, ValueError, IndexError, AttributeError, OverflowError, RuntimeError) as error:
        raise ValueError(f"{path} is damaged: {_reason(error)}") from error


def read_notes(path: str | Path) -> dict[str, Any]:
    """The ``notes`` of a file that `write_exr` wrote, without reading its pixels; raises as `read_exr`."""
    notes = read_attribute(path, read_parts(path, header_only=True)).get("notes", {})
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


def _unpack(head: Mapping[str, Any], planes: Planes) -> Frame:
    layers: dict[str, Any] = {name: layer_of(name, row, planes) for name, row in head["layers"].items()}
    if _same_bits(layers.get("normal"), layers.get("normal_geo")):
        layers["normal_geo"] = layers["normal"]  # one tensor, as of voxels: three planes less
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
        emitters_mirrored=bool(head.get("emitters_mirrored")),
        behind=None if head["behind"] is None else _unpack(head["behind"], planes),
        extra={name: tensor for name, tensor in layers.items() if name not in CHANNELS and name not in SIGNALS},
        **{name: tensor for name, tensor in layers.items() if name in SIGNALS},
    )


def _same_bits(one: Tensor | None, other: Tensor | None) -> bool:
    if one is None or other is None or not one.dtype == other.dtype == torch.float32:
        return False
    return torch.equal(one.view(torch.int32), other.view(torch.int32))


def _number(name: str, value: Any, kind: Any, most: float) -> Any:
    if not isinstance(value, kind) or isinstance(value, bool) or not abs(value) <= most:
        raise ValueError(f"its {name} must be a number of at most {most:g}")
    return value


def _window(height: int, width: int) -> tuple[np.ndarray, np.ndarray]:
    return np.zeros(2, dtype=np.int32), np.array([width - 1, height - 1], dtype=np.int32)


def _reason(error: Exception) -> str:
    text = str(error).strip().splitlines()
    return f"{error} is missing" if isinstance(error, KeyError) else (text[0] if text else type(error).__name__)
