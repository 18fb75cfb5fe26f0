"""MagicaVoxel's colours and materials as ours."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tracer.formats.vox.chunks import Chunks
from tracer.formats.vox.cursor import Attributes
from tracer.scene.material import RGB, Material, MaterialTable

WHITEST = 0.85  # no real wall reflects more, and a palette's 255 means white paint
EMISSION = 4.0  # radiance of white at weight 1 and flux 0: a lamp that shows by day; each step of flux doubles it
METAL_ROUGH, GLASS_ROUGH, MATTE_ROUGH = 0.1, 0.05, 0.9
VARIATION = 0.03


def default_palette() -> NDArray[np.uint8]:
    """The 256 colours that a file without RGBA means, as RGBA bytes; index 0 is empty.

    A cube of six levels of red, green and blue from white down, without black; then ramps of ten levels between those
    in red, green, blue and grey.
    """
    levels = range(255, -1, -51)
    cube = [(r, g, b) for r in levels for g in levels for b in levels][:-1]
    ramp = [17 * n for n in (14, 13, 11, 10, 8, 7, 5, 4, 2, 1)]
    ramps = [tuple(v if on else 0 for on in mask) for mask in _RAMPS for v in ramp]
    table = np.zeros((256, 4), np.uint8)
    table[1:, :3], table[1:, 3] = cube + ramps, 255
    return table


_RAMPS = ((1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1))


def material_table(chunks: Chunks, name: str) -> MaterialTable:
    """A row for each of the 255 colours, so that a colour index is a voxel id.

    Raises:
        ValueError: a material property is no number.
    """
    palette = default_palette() if chunks.palette is None else chunks.palette
    srgb = palette[:, :3].astype(np.float64) / 255.0
    linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    rows = []
    for i in range(1, 256):
        r, g, b = (float(c) for c in linear[i])
        try:
            rows.append(_material(f"color {i}", (r, g, b), chunks.materials.get(i, {})))
        except ValueError as error:
            raise ValueError(f"{name}, material {i}: {error}") from None
    return MaterialTable.of(rows)


def _material(name: str, color: RGB, told: Attributes) -> Material:
    """One material.

    Metal: ``_weight`` or ``_metal`` is its metalness. Glass: ``_weight``, ``_trans`` or ``_alpha`` is its
    transmission, tinted by its colour per voxel. Emit: it also emits its colour times weight (``_emit``) and flux.
    """
    kind = told.get("_type", "_diffuse")
    weight = _share(told, "_weight", 1.0)
    r, g, b = color
    albedo = (min(r, WHITEST), min(g, WHITEST), min(b, WHITEST))
    if kind == "_metal":
        metallic, rough = _share(told, "_metal", weight), _share(told, "_rough", METAL_ROUGH)
        return Material(name=name, albedo=albedo, roughness=rough, metallic=metallic, variation=VARIATION)
    if kind in ("_glass", "_media", "_blend"):
        through = _share(told, "_trans", _share(told, "_alpha", weight))
        rough = _share(told, "_rough", GLASS_ROUGH)
        metallic = _share(told, "_metal", 0.0) if kind == "_blend" else 0.0
        return Material(
            name=name,
            albedo=albedo,
            roughness=rough,
            metallic=metallic,
            opacity=1.0 - through,
            tint=color,
            variation=VARIATION,
        )
    if kind == "_emit":
        power = EMISSION * _share(told, "_emit", weight) * 2.0 ** _number(told, "_flux", 0.0, low=0.0, high=5.0)
        emission = (r * power, g * power, b * power)
        return Material(name=name, albedo=albedo, roughness=MATTE_ROUGH, emission=emission, variation=0.0)
    return Material(name=name, albedo=albedo, roughness=MATTE_ROUGH, variation=VARIATION)


def _number(told: Attributes, key: str, default: float, *, low: float, high: float) -> float:
    text = told.get(key)
    if text is None:
        return default
    try:
        value = float(text)
    except ValueError:
        raise ValueError(f"{key} must be a number, got {text!r}") from None
    if not math.isfinite(value):
        raise ValueError(f"{key} must be finite, got {text!r}")
    return min(max(value, low), high)


def _share(told: Attributes, key: str, default: float) -> float:
    return _number(told, key, default, low=0.0, high=1.0)
