"""How pictures lie on the faces of blocks: turned, tinted, over one another, with the light that they give."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tracer.formats.minecraft.colors import BRIGHTEST
from tracer.formats.minecraft.lamps import FRONTS
from tracer.formats.minecraft.pack.models import SIDES, Layer, Part, side_uv
from tracer.formats.minecraft.pack.pictures import Picture, Plane
from tracer.scene.material import Material
from tracer.scene.textures import COLOR, COLUMNS, GLOW, METAL, ROUGH, TILT

SHINE = 5.0  # radiance of white texels that an emission map has at its most, on blocks that give no light of their own
STEP = 1e-3

EIGHTHS = 8

Mask = NDArray[np.bool_]


def over(below: tuple[Plane, Plane] | None, above: tuple[Plane, Plane]) -> tuple[Plane, Plane]:
    """A layer over another one of the same size."""
    if below is None or len(below[0]) != len(above[0]):
        return above
    return np.where(above[1] > 0.5, above[0], below[0]), np.maximum(above[1], below[1])


def eighths(opacity: Plane) -> Mask:
    """``(8, 8)`` where most of a face is there."""
    repeated = opacity[..., 0].repeat(max(EIGHTHS // len(opacity), 1), axis=0)
    repeated = repeated.repeat(max(EIGHTHS // len(opacity), 1), axis=1)
    share = len(repeated) // EIGHTHS
    return repeated.reshape(EIGHTHS, share, EIGHTHS, share).mean(axis=(1, 3)) >= 0.5


def turned_side(part: Part, side: int) -> str:
    """The side of a model that shows on a side of the block."""
    return SIDES[_direction(_unturned(part, _outward(side)))]


def laid(
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
