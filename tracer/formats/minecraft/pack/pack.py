"""From blocks to textured materials."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from os import PathLike
from typing import final

import numpy as np
import torch
from numpy.typing import NDArray

from tracer.formats.minecraft.colors import BRIGHTEST, tint_kind, tint_of
from tracer.formats.minecraft.pack.archive import Archive, PackError
from tracer.formats.minecraft.pack.models import SIDES, Layer, Part, parts_of, side_uv
from tracer.formats.minecraft.pack.pictures import Picture, Plane, read_picture
from tracer.formats.minecraft.shapes import FRONTS, front_of
from tracer.scene.material import Material
from tracer.scene.textures import COLOR, COLUMNS, GLOW, MAX_ROWS, METAL, ROUGH, TILT, Textures, with_mips

SHINE = 5.0  # radiance of white texels that an emission map has at its most, on blocks that give no light of their own
STEP = 1e-3
ALIASES = {"short_grass": "grass", "grass": "short_grass", "dirt_path": "grass_path", "grass_path": "dirt_path"}
"""Names that changed between versions."""
HOLEY = 0.06  # share of a face that is cut out, from which on its shape is too
EIGHTHS = 8
Faces = tuple[tuple[int, int], ...]
NONE: Faces = ((0, 0),) * 6
Mask = NDArray[np.bool_]


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
        solid = np.stack([_eighths(opacity) for _, opacity in tiles])
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
            turned = SIDES[_direction(_unturned(part, _outward(side)))]
            for layer in part.sides.get(turned) or part.sides.get("up", next(iter(part.sides.values()))):
                picture = self._picture(layer.texture)
                if picture is not None:
                    found = _over(found, _laid(picture, layer, part, side, turned, plain, tint))
            if found is not None:
                return found
        return None

    def _picture(self, texture: str) -> Picture | None:
        if texture not in self._pictures:
            self._pictures[texture] = read_picture(self._archive, texture)
        return self._pictures[texture]


def _over(below: tuple[Plane, Plane] | None, above: tuple[Plane, Plane]) -> tuple[Plane, Plane]:
    """A layer over another one of the same size."""
    if below is None or len(below[0]) != len(above[0]):
        return above
    return np.where(above[1] > 0.5, above[0], below[0]), np.maximum(above[1], below[1])


def _eighths(opacity: Plane) -> Mask:
    """``(8, 8)`` where most of a face is there."""
    repeated = opacity[..., 0].repeat(max(EIGHTHS // len(opacity), 1), axis=0)
    repeated = repeated.repeat(max(EIGHTHS // len(opacity), 1), axis=1)
    share = len(repeated) // EIGHTHS
    return repeated.reshape(EIGHTHS, share, EIGHTHS, share).mean(axis=(1, 3)) >= 0.5


def _laid(
    picture: Picture,
    layer: Layer,
    part: Part,
    side: int,
    turned: str,
    plain: Material,
    tint: NDArray[np.float64] | None,
) -> tuple[Plane, Plane]:
    """A layer as it lies on a face of the grid: ``(S, S, 10)``, see `tracer.scene.textures`; and its opacity."""
    (rows, columns), jacobian = _texels(picture.side, layer, part, side, turned)
    color = picture.color[rows, columns]
    if layer.tinted:
        own = np.array(plain.albedo) / np.maximum(picture.color[..., :3].mean(axis=(0, 1)), 1e-3)
        color[..., :3] *= own if tint is None else tint
    tile = np.zeros((*color.shape[:2], COLUMNS), np.float32)
    tile[..., COLOR : COLOR + 3] = color[..., :3].clip(0.0, BRIGHTEST)
    if picture.tilt is not None:
        tile[..., TILT : TILT + 2] = picture.tilt[rows, columns] @ jacobian
    tile[..., ROUGH] = plain.roughness if picture.roughness is None else picture.roughness[rows, columns]
    tile[..., METAL] = plain.metallic if picture.metallic is None else picture.metallic[rows, columns]
    tile[..., GLOW : GLOW + 3] = _glow(color[..., :3], picture.glow, rows, columns, plain)
    return tile, color[..., 3:]


def _glow(color: Plane, glow: Plane | None, rows: NDArray, columns: NDArray, plain: Material) -> Plane:
    """Radiance: a block that gives light keeps its power, spread by the emission map, else by brightness.

    Where one side alone glows, what is far brighter than most of it does: eyes and flames.
    """
    lit = glow is not None and bool(glow.any())
    share = color if glow is None or not lit else color * glow[rows, columns][..., None]
    power = max(plain.emission)
    if power == 0:
        return share * SHINE if lit else np.zeros_like(color)
    strength = share.max(axis=-1, keepdims=True)
    above = (strength - (np.median(strength) + strength.max()) / 2).clip(0.0)
    strength = above if plain.name in FRONTS and not lit and above.any() else strength
    return np.array(plain.emission, np.float32) * strength / max(float(strength.mean()), 1e-3)


def _texels(side: int, layer: Layer, part: Part, face: int, turned: str) -> tuple[tuple[NDArray, NDArray], Plane]:
    """Rows and columns of the picture at the texels of a face, and how its right and down lie along the face's axes."""
    axis = face // 2
    first, second = (1 if axis == 0 else 0), (1 if axis == 2 else 2)
    middle = (np.arange(side) + 0.5) / side

    def shown(a: NDArray, b: NDArray) -> tuple[NDArray, NDArray]:
        place = np.zeros((3, *np.broadcast_shapes(a.shape, b.shape)))
        place[axis], place[first], place[second] = face % 2, a, b
        at = place if part.locked else np.stack(_unturned(part, place - 0.5)) + 0.5
        return _pictured(layer, *side_uv(SIDES[face] if part.locked else turned, *at))

    u, v = shown(middle[None, :], middle[:, None])
    a, b = np.array([0.5, 0.5 + STEP, 0.5]), np.array([0.5, 0.5, 0.5 + STEP])
    ways = [np.sign(np.round((ends[1:] - ends[0]) / STEP, 2)) for ends in shown(a, b)]
    return (_cell(v, side), _cell(u, side)), np.array(ways, np.float32)


def _cell(share: NDArray, side: int) -> NDArray:
    return np.floor(share * side + 1e-6).astype(np.int64) % side


def _pictured(layer: Layer, u: NDArray, v: NDArray) -> tuple[NDArray, NDArray]:
    """Where in the picture a place on a side of a model lies."""
    (u0, v0, u1, v1), (s0, t0, s1, t1) = layer.covers, layer.shows
    s, t = (u - u0) / (u1 - u0 or 1.0), (v - v0) / (v1 - v0 or 1.0)
    for _ in range(layer.turns):
        s, t = t, 1 - s
    return s0 + s * (s1 - s0), t0 + t * (t1 - t0)


def _outward(face: int) -> NDArray[np.float64]:
    return np.eye(3)[face // 2] * (1 if face % 2 else -1)


def _unturned(part: Part, place: NDArray[np.float64]) -> tuple[NDArray, NDArray, NDArray]:
    """A place, from the middle of a block, as it is in the model before that is turned."""
    x, y, z = place
    for _ in range(part.y):
        x, z = z, -x
    for _ in range(part.x):
        y, z = -z, y
    return x, y, z


def _direction(outward: tuple[NDArray, NDArray, NDArray]) -> int:
    axis = int(np.argmax(np.abs(outward)))
    return 2 * axis + (1 if outward[axis] > 0 else 0)
