"""MagicaVoxel .vox files, versions 150 and 200: palette, materials, scene graph, layers.

The file's z points up, ours y. A point ``(x, y, z)`` of the file lies at ``(x, z, -y)`` here: a quarter turn about x,
so that nothing is mirrored, and what faces MagicaVoxel's front (-y) faces +z.
"""

from __future__ import annotations

import os
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tracer.formats.vox.chunks import MAX_FILE, Chunks, Model, Node, read_chunks
from tracer.formats.vox.materials import material_table
from tracer.scene.cells import world_of_cells
from tracer.scene.placement import place
from tracer.scene.scene import Scene
from tracer.scene.world import World

MAX_DEPTH = 256
MAX_VISITS = 1 << 16
MAX_VOXELS = 1 << 23  # a gigabyte while a file is read; the environment variable GBUFRT_MAX_VOXELS raises it
MAX_EXTENT = 4096

Matrix = NDArray[np.int64]
Placement = tuple[int, Matrix, Matrix]


def read_vox(path: str | PathLike[str], *, max_voxels: int | None = None) -> World:
    """The voxels of a MagicaVoxel file, hidden ones left out, each colour of its palette a material.

    A shape's or transform's first frame is read; of a file without scene graph, the first model.

    Args:
        path: the file.
        max_voxels: the most visible voxels to accept; each takes about 120 bytes while the file is read. [default:
            GBUFRT_MAX_VOXELS of the environment, or `MAX_VOXELS`]

    Returns:
        The world, y up, in the file's own position.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: truncated, corrupt, too large or empty: file, offset and what was wrong.
    """
    path = Path(path)
    size = path.stat().st_size
    if size > MAX_FILE:
        raise ValueError(f"{path}: {size} bytes; at most {MAX_FILE} are read")
    chunks = read_chunks(path.read_bytes(), str(path))
    cells, ids = _placed(chunks, str(path), _most_voxels() if max_voxels is None else max_voxels)
    return world_of_cells(cells, ids, material_table(chunks, str(path)))


def load_vox_scene(path: str | PathLike[str]) -> Scene:
    """A MagicaVoxel file on ground under the sky.

    Args:
        path: of a .vox file, version 150 or 200.

    Returns:
        The scene, with views that frame it.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: see `read_vox`.
    """
    return place(read_vox(path))


def _placed(chunks: Chunks, name: str, most: int) -> tuple[Matrix, NDArray[np.int16]]:
    """Coordinates (y up) and colour index of every visible voxel."""
    if not chunks.models:
        raise ValueError(f"{name}: no model (chunks SIZE and XYZI)")
    placements = _placements(chunks, name)
    count = sum(len(chunks.models[model].voxels) for model, _, _ in placements)
    if not count:
        raise ValueError(f"{name}: 0 visible voxels; show a layer or fill a model in MagicaVoxel")
    if count > most:
        raise ValueError(f"{name}: {count} visible voxels; at most {most} are read; if true, set GBUFRT_MAX_VOXELS")
    parts = [_moved(chunks.models[model], rotation, offset) for model, rotation, offset in placements]
    cells = np.concatenate([p for p in parts if len(p)])
    extent = cells.max(axis=0) - cells.min(axis=0)
    if extent.max() >= MAX_EXTENT:
        raise ValueError(
            f"{name}: the scene spans {tuple(extent.tolist())} voxels; at most {MAX_EXTENT} a side are read"
        )
    ids = np.concatenate([chunks.models[model].voxels[:, 3] for model, _, _ in placements]).astype(np.int16)
    x, y, z = cells.T
    return np.stack([x, z, -y - 1], axis=1), ids


def _most_voxels() -> int:
    text = os.environ.get("GBUFRT_MAX_VOXELS", "")
    if text and not (text.isascii() and text.isdecimal() and len(text) < 19):
        raise ValueError(f"GBUFRT_MAX_VOXELS must be a whole number of voxels, got {text!r}")
    return int(text) if text else MAX_VOXELS


def _moved(model: Model, rotation: Matrix, offset: Matrix) -> Matrix:
    """Voxel coordinates after a signed permutation about the model's middle: worked in halves, at voxel centres."""
    pivot = np.asarray(model.size, np.int64) // 2
    centers = 2 * (model.voxels[:, :3].astype(np.int64) - pivot) + 1
    return (centers @ rotation.T + 2 * offset) // 2


def _placements(chunks: Chunks, name: str) -> list[Placement]:
    """Model, rotation and translation of every visible shape, found depth first from the root, node 0."""
    still = np.eye(3, dtype=np.int64), np.zeros(3, np.int64)
    if not chunks.nodes:
        return [(0, still[0], np.asarray(chunks.models[0].size, np.int64) // 2)]  # where the file says, unturned
    if 0 not in chunks.nodes:
        raise ValueError(f"{name}: the scene graph has no root, node 0")
    found: list[Placement] = []
    stack: list[tuple[int, Matrix, Matrix, tuple[int, ...]]] = [(0, *still, ())]
    visits = 0
    while stack:
        number, rotation, offset, above = stack.pop()
        node = chunks.nodes[number]
        visits += 1
        where = f"{name}, byte {node.at}"
        if len(above) > MAX_DEPTH or visits > MAX_VISITS:
            raise ValueError(f"{where}: scene graph deeper than {MAX_DEPTH} or longer than {MAX_VISITS} nodes")
        if node.hidden or node.layer in chunks.hidden_layers:
            continue
        if node.model is not None:
            if not 0 <= node.model < len(chunks.models):
                raise ValueError(f"{where}: model {node.model} of {len(chunks.models)}")
            found.append((node.model, rotation, offset))
        offset = offset + rotation @ np.asarray(node.translation)
        if node.rotation is not None:
            rotation = rotation @ _rotation(node, where)
        for child in reversed(node.children):
            if child not in chunks.nodes:
                raise ValueError(f"{where}: child {child} is no node")
            if child == number or child in above:
                raise ValueError(f"{where}: the scene graph runs in a circle through node {child}")
            stack.append((child, rotation, offset, (*above, number)))
    return found


def _rotation(node: Node, where: str) -> Matrix:
    """The signed permutation in a rotation byte: columns of the ones in rows 0 and 1, then the sign of each row."""
    bits = node.rotation or 0
    first, second = bits & 3, bits >> 2 & 3
    if first == 3 or second == 3 or first == second:
        raise ValueError(
            f"{where}: rotation byte {bits} names columns {first} and {second}; they must differ and be 0..2"
        )
    matrix = np.zeros((3, 3), np.int64)
    for row, column in enumerate((first, second, 3 - first - second)):
        matrix[row, column] = -1 if bits >> (4 + row) & 1 else 1
    return matrix
