"""Pictures of textures, with the maps of LabPBR 1.3 or of Bedrock's texture sets beside them."""

from __future__ import annotations

import io
import re
from dataclasses import dataclass
from typing import Any
from warnings import catch_warnings

import numpy as np
from numpy.typing import NDArray

from tracer.formats.minecraft.pack.archive import Archive, PackError

MAX_SIDE = 128  # texels of a texture; larger pictures are reduced to it
MAX_WIDTH = 4096
MAX_PIXELS = 1 << 24
METALS = 230  # LabPBR's F0 from which on it names a metal
NOT_LIT = 255  # LabPBR's emission that stands for none
MER = ("metalness_emissive_roughness", "metalness_emissive_roughness_subsurface")
GRASS = ("grass_block_side", "grass_block_side_overlay")
RELIEF = 1 / 16  # of a block
PICTURE_ERRORS = (OSError, ValueError, SyntaxError, EOFError)  # Pillow's, for broken files

Plane = NDArray[np.float32]


@dataclass(frozen=True, eq=False, kw_only=True)
class Picture:
    """A texture of S x S texels, rows downward.

    Args:
        color: ``(S, S, 4)`` linear RGB, and opacity. What is not opaque has the mean colour of what is.
        tilt: ``(S, S, 2)`` of the normal, rightward and downward; None where there is no map.
        roughness: ``(S, S)`` perceptual.
        metallic: ``(S, S)``.
        glow: ``(S, S)`` share of the most that it can emit.
    """

    color: Plane
    tilt: Plane | None = None
    roughness: Plane | None = None
    metallic: Plane | None = None
    glow: Plane | None = None

    @property
    def side(self) -> int:
        """S."""
        return len(self.color)


def read_picture(archive: Archive, texture: str) -> Picture | None:
    """A texture and its maps, or None where the pack has no such picture.

    Normals point down for low green, as DirectX has them; of an animation the first frame is taken.

    Raises:
        ValueError: a picture is damaged or too large.
    """
    stem = archive.stem(texture)
    image = None if stem is None else _pixels(archive, stem, None)
    if stem is None or image is None:
        return None
    side, sets = len(image), _set_of(archive, stem)
    layers = {key: _layer(archive, stem, value, side) for key, value in sets.items()}
    layers = {key: layer for key, layer in layers.items() if layer is not None}
    image = layers.get("color", image)
    if not archive.java and (name := texture.rpartition("/")[2]) in GRASS:
        image = _of_grass(image, blades=name == GRASS[1])
    color, tilt = _opaque(image), None
    normal = layers["normal"] if "normal" in layers else _pixels(archive, f"{stem}_n", side)
    if normal is not None:
        tilt = _tilt(normal)
    elif "heightmap" in layers:
        tilt = _slope(layers["heightmap"][..., 0])
    if (bedrock := next((layers[key] for key in MER if key in layers), None)) is not None:
        metallic, glow, roughness = bedrock[..., 0], bedrock[..., 1], bedrock[..., 2]
        return Picture(color=color, tilt=tilt, roughness=roughness, metallic=metallic, glow=glow)
    lab = _pixels(archive, f"{stem}_s", side)
    if lab is None:
        return Picture(color=color, tilt=tilt)
    glow = np.where(lab[..., 3] * 255 > NOT_LIT - 0.5, 0.0, lab[..., 3] * (255 / (NOT_LIT - 1)))
    return Picture(
        color=color,
        tilt=tilt,
        roughness=1 - lab[..., 0],
        metallic=(lab[..., 1] * 255 > METALS - 0.5).astype(np.float32),
        glow=glow.astype(np.float32),
    )


def _set_of(archive: Archive, stem: str) -> dict[str, Any]:
    """What Bedrock's file of a texture's maps says; empty where there is none."""
    own = (archive.json(f"{stem}.texture_set.json") or {}).get("minecraft:texture_set")
    return own if isinstance(own, dict) else {}


def _layer(archive: Archive, stem: str, value: Any, side: int) -> Plane | None:
    """``(S, S, 4)`` a map of a texture set: a picture beside its own by its name, or one value everywhere."""
    if isinstance(value, str) and (digits := re.fullmatch("#([0-9a-fA-F]{2})?([0-9a-fA-F]{6})", value)):
        value = [*bytes.fromhex(digits[2]), *bytes.fromhex(digits[1] or "ff")]
    if isinstance(value, str):
        return _pixels(archive, f"{stem.rpartition('/')[0]}/{value}", side)
    numbers = value if isinstance(value, list) else [value] * 3
    if len(numbers) not in (3, 4) or not all(type(n) is int and 0 <= n <= 255 for n in numbers):
        return None
    return np.full((side, side, 4), [*numbers, 255][:4], np.float32) / np.float32(255)


def _pixels(archive: Archive, stem: str, side: int | None) -> Plane | None:
    """``(S, S, 4)`` in [0, 1]; S is ``side``, else the largest power of two that fits into the picture's width."""
    from PIL import Image

    name = archive.picture(stem)
    data = None if name is None else archive.read(name)
    if data is None:
        return None
    try:
        with catch_warnings(action="ignore"), Image.open(io.BytesIO(data), formats=["PNG", "TGA"]) as picture:
            width, height = picture.size
            if width > MAX_WIDTH or width * height > MAX_PIXELS:
                raise ValueError(
                    f"it claims {width} x {height} pixels, more than {MAX_WIDTH} wide or {MAX_PIXELS} in all"
                )
            narrow = min(width, height)
            wanted = side or min(1 << (narrow.bit_length() - 1), MAX_SIDE)
            part = picture.crop((0, 0, narrow, narrow))
            if part.mode.startswith("I"):  # grey of 16 bits, which Pillow would cut off at 255
                part = Image.fromarray((np.asarray(part, np.float32) / 257 + 0.5).astype(np.uint8))
            frame = np.asarray(part.convert("RGBA"), np.float32) / np.float32(255)
    except (*PICTURE_ERRORS, Image.DecompressionBombError) as error:
        raise PackError(f"pack {archive.path}: {name} is damaged: {error}") from None
    place = ((np.arange(wanted) + 0.5) * narrow / wanted).astype(np.int64)
    return frame[place][:, place]


def _of_grass(image: Plane, *, blades: bool) -> Plane:
    """Of Bedrock's one picture of a grass block's side, opaque where it is grass: the grass, or the soil below it."""
    opacity = np.zeros_like(image[..., 3:]) if image[..., 3].min() > 0.5 else image[..., 3:]
    return np.concatenate([image[..., :3], opacity if blades else np.ones_like(opacity)], axis=-1)


def _opaque(image: Plane) -> Plane:
    color, alpha = image[..., :3], image[..., 3:]
    rgb = np.where(color <= 0.04045, color / 12.92, ((color + 0.055) / 1.055) ** 2.4)
    mean = (rgb * alpha).sum(axis=(0, 1)) / max(float(alpha.sum()), 1e-6)
    return np.concatenate([np.where(alpha > 0.5, rgb, mean), alpha], axis=-1).astype(np.float32)


def _tilt(normal: Plane) -> Plane:
    """The map's first two channels; those of a length over one, which no normal has, are shortened."""
    tilt = normal[..., :2] * (255 / 127.5) - 1
    tilt[np.abs(tilt) < 0.006] = 0.0  # 127 and 128 both stand for flat
    return tilt / np.maximum(np.linalg.norm(tilt, axis=-1, keepdims=True) / 0.98, 1.0)


def _slope(height: Plane) -> Plane:
    """The tilt of a height map whose white lies `RELIEF` of a block over its black, and that goes on all round."""
    per_block = RELIEF * len(height) / 2
    down, right = ((np.roll(height, 1, axis) - np.roll(height, -1, axis)) * per_block for axis in (0, 1))
    return (np.stack([right, down], axis=-1) / np.sqrt(1 + right**2 + down**2)[..., None]).astype(np.float32)
