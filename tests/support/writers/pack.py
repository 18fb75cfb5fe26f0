"""Tiny resource packs, drawn by numpy, and what their textures look like on blocks."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch
from PIL import Image

from tracer.formats.minecraft.build import Builder
from tracer.formats.minecraft.pack.pack import Pack
from tracer.formats.minecraft.sections import Section
from tracer.scene.material import MaterialTable
from tracer.scene.textures import COLOR

JAVA = "assets/minecraft/"
FACES = ("west", "east", "down", "up", "north", "south")
A, B, C, D = 188, 137, 99, 0  # sRGB of 0.5, 0.25, about 0.125 and 0: from left to right, then downward
CORNERS = np.array([[A, B], [C, D]], np.uint8)[..., None].repeat(3, axis=-1)
LOOK = {  # as the game draws it: which of x, y, z a picture's right and down are, and whether they fall
    "up": ((0, False), (2, False)),
    "down": ((0, False), (2, True)),
    "south": ((0, False), (1, True)),
    "north": ((0, True), (1, True)),
    "west": ((2, False), (1, True)),
    "east": ((2, True), (1, True)),
}
UPRIGHT = [[0.5, 0.25], [0.12, 0.0]]
"""`CORNERS` as `seen_from_outside` tells them."""


def png(pixels: Any) -> bytes:
    """A PNG of ``(H, W, 3 or 4)`` numbers in [0, 255]."""
    out = io.BytesIO()
    Image.fromarray(np.asarray(pixels, np.uint8)).save(out, "PNG")
    return out.getvalue()


def flat(*color: int, side: int = 2) -> np.ndarray:
    """A picture of one colour."""
    return np.broadcast_to(np.array(color, np.uint8), (side, side, len(color)))


def textures(**pictures: Any) -> dict[str, bytes]:
    """Files with the textures of blocks by their names."""
    return {f"{JAVA}textures/block/{name}.png": png(pixels) for name, pixels in pictures.items()}


def json_files(**values: Any) -> dict[str, bytes]:
    """JSON files of the game's name space; two underscores stand for a slash: ``models__block__a``."""
    return {f"{JAVA}{name.replace('__', '/')}.json": json.dumps(value).encode() for name, value in values.items()}


def write_pack(path: Path, files: Mapping[str, bytes]) -> Path:
    """A pack as a zip, or as a folder where the path has no ending."""
    if path.suffix:
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, data in files.items():
                archive.writestr(name, data)
        return path
    for name, data in files.items():
        (path / name).parent.mkdir(parents=True, exist_ok=True)
        (path / name).write_bytes(data)
    return path


def table_of(pack: Path, *states: str, biome: str = "plains") -> tuple[MaterialTable, torch.Tensor]:
    """The materials of blocks with a pack, and their numbers in the order of ``states``."""
    builder, blocks = Builder(Pack(pack)), np.zeros(4096, np.int64)
    blocks[:: 4096 // 16][: len(states)] = np.arange(1, len(states) + 1)  # along y, apart
    given = ("minecraft:air", *(f"minecraft:{state}" for state in states))
    builder.add(0, 0, Section(y=0, states=given, blocks=blocks, biomes=(biome,), biome=None))
    world = builder.build().world
    return world.materials, world.at(torch.tensor([[0, y, 0] for y in range(len(states))])).long()


def tile(table: MaterialTable, number: Any, face: str) -> torch.Tensor:
    """``(S, S, 10)`` texels of a face; rows go along its second axis."""
    assert table.textures is not None
    first, side = table.textures.faces[int(number), FACES.index(face)].tolist()
    return table.textures.texels[first : first + side * side].view(side, side, -1)


def at(table: MaterialTable, number: Any, face: str, place: tuple[float, float, float]) -> torch.Tensor:
    """The texel at a place on a face of a block."""
    own, axis = tile(table, number, face), FACES.index(face) // 2
    column, row = (int(place[k] * len(own)) for k in range(3) if k != axis)
    return own[row, column]


def seen_from_outside(table: MaterialTable, number: Any, face: str) -> list[list[float]]:
    """Albedo at the four corners of a face, as the game's viewer sees them: rows from the top, from left to right."""
    (right, mirrored), (down, flipped) = LOOK[face]
    rows = []
    for t in (0.25, 0.75):
        row = []
        for s in (0.25, 0.75):
            place = [0.0, 0.0, 0.0]
            place[right], place[down] = 1 - s if mirrored else s, 1 - t if flipped else t
            row.append(round(float(at(table, number, face, (place[0], place[1], place[2]))[COLOR]), 2))
        rows.append(row)
    return rows
