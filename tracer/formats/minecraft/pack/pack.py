"""From blocks to textured materials."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from os import PathLike
from typing import final

import numpy as np
import torch
from numpy.typing import NDArray

from tracer.formats.minecraft.colors import tint_kind, tint_of
from tracer.formats.minecraft.lamps import FRONTS, front_of
from tracer.formats.minecraft.pack.archive import Archive, PackError
from tracer.formats.minecraft.pack.faces import Mask, eighths, laid, over, turned_side
from tracer.formats.minecraft.pack.models import SIDES, Part, parts_of
from tracer.formats.minecraft.pack.pictures import Picture, Plane, read_picture
from tracer.scene.material import Material
from tracer.scene.textures import COLOR, COLUMNS, GLOW, MAX_ROWS, METAL, ROUGH, Textures, with_mips

ALIASES = {"short_grass": "grass", "grass": "short_grass", "dirt_path": "grass_path", "grass_path": "dirt_path"}
"""Names that changed between versions."""
HOLEY = 0.06  # share of a face that is cut out, from which on its shape is too
Faces = tuple[tuple[int, int], ...]
NONE: Faces = ((0, 0),) * 6


@dataclass(frozen=True, eq=False, kw_only=True)
class Dressed:
    """A block with its textures.

    Args:
        material: with their means.
        faces: where those of each face lie; see `tracer.scene.textures.Textures`.
        solid: ``(6, 8, 8)``: of each face, where it is not cut out, in eighths of a block, rows along the second of
            its axes; None where it is nowhere.
    """

    material: Material
    faces: Faces = NONE
    solid: Mask | None = None


@final
class Pack:
    """The textures that a world uses of a resource pack.

    Args:
        path: of a jar, a zip or a folder.

    Raises:
        FileNotFoundError: there is nothing.
        ValueError: see `tracer.formats.minecraft.pack.archive.Archive`.
    """

    def __init__(self, path: str | PathLike[str]) -> None:
        self.missing: set[str] = set()
        self._archive = Archive(path)
        self._pictures: dict[str, Picture | None] = {}
        self._rows: list[torch.Tensor] = []
        self._places: dict[bytes, tuple[int, int]] = {}
        self._count = 0

    def dress(self, plain: Material, name: str, told: Mapping[str, str], biome: str) -> Dressed:
        """A block's material with its textures; as it is where the pack has none.

        Args:
            plain: the material without textures.
            name: of the block, without ``minecraft:``.
            told: the properties of its state.
            biome: its name.

        Raises:
            ValueError: a file of the pack is damaged or too large.
        """
        parts = parts_of(self._archive, name, told)
        if not parts and name in ALIASES:
            parts = parts_of(self._archive, ALIASES[name], told)
        kind = tint_kind(name)
        tint = None if kind in (None, "water") else np.array(tint_of(kind, biome))  # water: as clear as its material
        dark = replace(plain, emission=(0.0, 0.0, 0.0))
        front = SIDES.index(front_of(told)) if plain.name in FRONTS and front_of(told) in SIDES else None
        lit = [plain if front in (None, side) else dark for side in range(6)]
        tiles = [tile for side in range(6) if (tile := self._tile(lit[side], parts, side, tint)) is not None]
        if len(tiles) < 6:
            self.missing.add(name)
            return Dressed(material=plain)
        mean = np.mean([tile.mean(axis=(0, 1)) for tile, _ in tiles], axis=0).tolist()
        solid = np.stack([eighths(opacity) for _, opacity in tiles])
        r, g, b = mean[COLOR : COLOR + 3]
        glow = mean[GLOW : GLOW + 3]
        made = replace(
            plain,
            albedo=(r, g, b),
            roughness=min(mean[ROUGH], 1.0),
            metallic=min(mean[METAL], 1.0),
            emission=(glow[0], glow[1], glow[2]),
            variation=0.0,
        )
        faces = tuple(self._kept(tile) for tile, _ in tiles)
        return Dressed(material=made, faces=faces, solid=solid if 1 - solid.mean() > HOLEY else None)

    def textures(self, faces: list[Faces]) -> Textures:
        """The textures of materials, from the faces of each after air."""
        texels = torch.cat(self._rows) if self._rows else torch.zeros(0, COLUMNS)
        return Textures(faces=torch.tensor([NONE, *faces], dtype=torch.int32), texels=texels)

    def _kept(self, tile: Plane) -> tuple[int, int]:
        """First row and side of a texture, which is stored once."""
        key = tile.tobytes()
        if key not in self._places:
            rows = with_mips(torch.from_numpy(tile))
            self._places[key] = self._count, len(tile)
            self._count += len(rows)
            if self._count * rows[0].nbytes > self._archive.most or self._count > MAX_ROWS:
                raise PackError(
                    f"pack {self._archive.path} has more than {MAX_ROWS} texels, or GBUFRT_MAX_GB; take fewer blocks"
                )
            self._rows.append(rows)
        return self._places[key]

    def _tile(
        self, plain: Material, parts: list[Part], side: int, tint: NDArray[np.float64] | None
    ) -> tuple[Plane, Plane] | None:
        """``(S, S, 10)`` what one side of a block shows, and ``(S, S, 1)`` its opacity; or None."""
        found = None
        for part in parts:
            turned = turned_side(part, side)
            for layer in part.sides.get(turned) or part.sides.get("up", next(iter(part.sides.values()))):
                picture = self._picture(layer.texture)
                if picture is not None:
                    found = over(found, laid(picture, layer, part, side, turned, plain, tint))
            if found is not None:
                return found
        return None

    def _picture(self, texture: str) -> Picture | None:
        if texture not in self._pictures:
            self._pictures[texture] = read_picture(self._archive, texture)
        return self._pictures[texture]
