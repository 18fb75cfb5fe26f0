"""The chunks of a MagicaVoxel file, read with bounds: sizes are checked against the bytes that are there."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tracer.formats.vox.cursor import Attributes, Cursor

VERSIONS = (150, 200)
MAX_SIDE = 256  # coordinates are bytes
MAX_FILE = 1 << 28


@dataclass(frozen=True)
class Model:
    """One grid of voxels: its size and ``(N, 4)`` bytes x, y, z, colour index; z up."""

    size: tuple[int, int, int]
    voxels: NDArray[np.uint8]


@dataclass(frozen=True)
class Node:
    """A node of the scene graph: a transform with one child, a group of children, or a shape with a model."""

    at: int
    hidden: bool = False
    layer: int = -1
    rotation: int | None = None
    translation: tuple[int, int, int] = (0, 0, 0)
    children: tuple[int, ...] = ()
    model: int | None = None


@dataclass
class Chunks:
    """What a file holds, before anything is placed or coloured."""

    models: list[Model] = field(default_factory=list)
    palette: NDArray[np.uint8] | None = None
    nodes: dict[int, Node] = field(default_factory=dict)
    hidden_layers: set[int] = field(default_factory=set)
    materials: dict[int, Attributes] = field(default_factory=dict)


def read_chunks(data: bytes, name: str) -> Chunks:
    """Read the chunks that matter and step over the others (cameras, notes, render settings, IMAP).

    IMAP only orders the palette on MagicaVoxel's screen: voxels name colours of RGBA either way.

    Args:
        data: the whole file.
        name: of the file, for messages.

    Raises:
        ValueError: truncated or corrupt.

    Source: github.com/ephtracy/voxel-model, MagicaVoxel-file-format-vox.txt and -vox-extension.txt.
    """
    cursor = Cursor(data, name)
    if cursor.take(4, "the file's mark") != b"VOX ":
        cursor.fail(f"a .vox file begins with 'VOX ', this one with {data[:4]!r}", at=0)
    version = cursor.int32("version")
    if version not in VERSIONS:
        cursor.fail(f"version must be one of {VERSIONS}, got {version}", at=4)
    if cursor.take(4, "MAIN") != b"MAIN":
        cursor.fail("expected the chunk MAIN", at=8)
    own, children = cursor.count("size of MAIN", bytes_each=1), cursor.int32("size of MAIN's chunks")
    cursor.take(own, "MAIN")
    if not 0 <= children <= cursor.left:
        cursor.fail(f"the chunks in MAIN take {children} bytes, but {cursor.left} are left; the file is truncated")
    cursor.stop = cursor.at + children
    chunks, size = Chunks(), None
    while cursor.left:
        kind = cursor.take(4, "a chunk's name").decode("ascii", "replace")
        own, nested = cursor.int32(f"size of {kind}"), cursor.int32(f"size of the chunks in {kind}")
        if own < 0 or nested < 0 or own + nested > cursor.left:
            cursor.fail(f"chunk {kind!r} takes {own} + {nested} bytes, but {cursor.left} are left")
        part = Cursor(data, name, at=cursor.at, stop=cursor.at + own)
        cursor.at += own + nested
        if kind == "SIZE":
            size = _size(part)
        elif kind == "XYZI":
            chunks.models.append(_voxels(part, size))
            size = None
        elif kind in _READERS:
            _READERS[kind](part, chunks)
    return chunks


def _size(part: Cursor) -> tuple[int, int, int]:
    at = part.at
    x, y, z = (part.int32("SIZE") for _ in range(3))
    if not all(1 <= n <= MAX_SIDE for n in (x, y, z)):
        part.fail(f"sides of a model must lie in 1..{MAX_SIDE}, got {(x, y, z)}", at=at)
    return x, y, z


def _voxels(part: Cursor, size: tuple[int, int, int] | None) -> Model:
    if size is None:
        part.fail("XYZI without a SIZE before it")
    count = part.count("number of voxels", bytes_each=4)
    at = part.at
    voxels = np.frombuffer(part.take(4 * count, "voxels"), np.uint8).reshape(-1, 4)
    outside = (voxels[:, :3] >= np.asarray(size)).any(axis=1)
    if outside.any():
        first = int(outside.argmax())
        part.fail(f"voxel {tuple(voxels[first, :3].tolist())} lies outside its model of {size}", at=at + 4 * first)
    return Model(size, voxels[voxels[:, 3] > 0])


def _palette(part: Cursor, chunks: Chunks) -> None:
    colors = np.frombuffer(part.take(4 * 255, "RGBA"), np.uint8).reshape(255, 4)  # some programs leave out the last one
    chunks.palette = np.concatenate([np.zeros((1, 4), np.uint8), colors])  # entry i colours index i + 1


def _transform(part: Cursor, chunks: Chunks) -> None:
    at, node = part.at, part.int32("a node's number")
    attributes = part.attributes("nTRN")
    child = part.int32("child of nTRN")
    part.int32("a reserved number")
    layer = part.int32("layer of nTRN")
    frames = [part.attributes("a frame of nTRN") for _ in range(part.count("number of frames", bytes_each=4))]
    first = frames[0] if frames else {}
    rotation = _whole(part, first["_r"], "_r", 0, 127) if "_r" in first else None
    words = first.get("_t", "0 0 0").split()
    if len(words) != 3:
        part.fail(f"_t must be three whole numbers, got {first['_t']!r}", at=at)
    x, y, z = (_whole(part, w, "_t", -(1 << 20), 1 << 20) for w in words)
    hidden = attributes.get("_hidden") == "1"
    _add(part, chunks, node, Node(at, hidden, layer, rotation, (x, y, z), (child,)))


def _group(part: Cursor, chunks: Chunks) -> None:
    at, node = part.at, part.int32("a node's number")
    hidden = part.attributes("nGRP").get("_hidden") == "1"
    count = part.count("number of children", bytes_each=4)
    children = tuple(part.int32("child of nGRP") for _ in range(count))
    _add(part, chunks, node, Node(at, hidden, children=children))


def _shape(part: Cursor, chunks: Chunks) -> None:
    at, node = part.at, part.int32("a node's number")
    hidden = part.attributes("nSHP").get("_hidden") == "1"
    if part.count("number of models", bytes_each=8) < 1:
        part.fail("a shape must name a model")
    _add(part, chunks, node, Node(at, hidden, model=part.int32("model of nSHP")))  # further ones animate it


def _add(part: Cursor, chunks: Chunks, number: int, node: Node) -> None:
    if number in chunks.nodes:
        part.fail(f"node {number} comes twice", at=node.at)
    chunks.nodes[number] = node


def _layer(part: Cursor, chunks: Chunks) -> None:
    number = part.int32("a layer's number")
    if part.attributes("LAYR").get("_hidden") == "1":
        chunks.hidden_layers.add(number)


def _material(part: Cursor, chunks: Chunks) -> None:
    number = part.int32("a material's number")
    chunks.materials[number & 255] = part.attributes("MATL")


def _old_material(part: Cursor, chunks: Chunks) -> None:
    """MATT of version 150, converted to the keys of MATL."""
    number, kind, weight = part.int32("MATT"), part.int32("kind of MATT"), part.float32("weight of MATT")
    if not 0 <= kind <= 3:
        part.fail(f"kind of a MATT material must lie in 0..3, got {kind}")
    bits = part.int32("properties of MATT")
    told = {"_type": ("_diffuse", "_metal", "_glass", "_emit")[kind], "_weight": repr(weight)}
    for bit, key in enumerate(("_plastic", "_rough", "_spec", "_ior", "_att", "_flux", "_glow")):
        if bits >> bit & 1:
            told[key] = repr(part.float32(f"{key} of MATT"))
    if "_flux" in told:
        told["_flux"] = repr(4.0 * float(told["_flux"]))  # MATT's power is a share, MATL's flux counts to 4
    chunks.materials[number & 255] = told


def _whole(part: Cursor, text: str, key: str, low: int, high: int) -> int:
    try:
        value = int(text)
    except ValueError:
        part.fail(f"{key} must be a whole number, got {text!r}")
    if not low <= value <= high:
        part.fail(f"{key} must lie in {low}..{high}, got {value}")
    return value


_READERS = {
    "RGBA": _palette,
    "nTRN": _transform,
    "nGRP": _group,
    "nSHP": _shape,
    "LAYR": _layer,
    "MATL": _material,
    "MATT": _old_material,
}
