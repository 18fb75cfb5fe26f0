"""Pictures of textures, with the maps of LabPBR 1.3 or of Bedrock's texture sets beside them."""

from __future__ import annotations

import io
from dataclasses import dataclass
from warnings import catch_warnings

import numpy as np
from numpy.typing import NDArray

from tracer.formats.minecraft.pack.archive import Archive, PackError

MAX_SIDE = 128  # texels of a texture; larger pictures are reduced to it
MAX_WIDTH = 4096
MAX_PIXELS = 1 << 24
METALS = 230  # LabPBR's F0 from which on it names a metal
NOT_LIT = 255  # LabPBR's emission that stands for none
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
    image = _pixels(archive, f"{stem}.png", None)
    if image is None:
        return None
    color, side = _opaque(image), len(image)
    sets = archive.json(f"{stem}.texture_set.json")
    own = sets.get("minecraft:texture_set") if sets is not None else None
    own = own if isinstance(own, dict) else {}
    home = stem.rpartition("/")[0]
    bedrock = _pixels(archive, f"{home}/{own.get('metalness_emissive_roughness', '')}.png", side)
    normal = _pixels(archive, f"{home}/{own['normal']}.png" if "normal" in own else f"{stem}_n.png", side)
    tilt = None if normal is None else _tilt(normal)
    if bedrock is not None:
        metallic, glow, roughness = bedrock[..., 0], bedrock[..., 1], bedrock[..., 2]
        return Picture(color=color, tilt=tilt, roughness=roughness, metallic=metallic, glow=glow)
    lab = _pixels(archive, f"{stem}_s.png", side)
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


def _pixels(archive: Archive, name: str, side: int | None) -> Plane | None:
    """``(S, S, 4)`` in [0, 1]; S is ``side``, else the largest power of two that fits into the picture's width."""
    from PIL import Image

    data = archive.read(name)
    if data is None:
        return None
    try:
        with catch_warnings(action="ignore"), Image.open(io.BytesIO(data), formats=["PNG"]) as picture:
            width, height = picture.size
            if width > MAX_WIDTH or width * height > MAX_PIXELS:
                raise ValueError(
                    f"it claims {width} x {height} pixels, more than {MAX_WIDTH} wide or {MAX_PIXELS} in all"
                )
            narrow = min(width, height)
            wanted = side or min(1 << (narrow.bit_length() - 1), MAX_SIDE)
            frame = np.asarray(picture.crop((0, 0, narrow, narrow)).convert("RGBA"), np.float32) / np.float32(255)
    except (*PICTURE_ERRORS, Image.DecompressionBombError) as error:
        raise PackError(f"pack {archive.path}: {name} is damaged: {error}") from None
    place = ((np.arange(wanted) + 0.5) * narrow / wanted).astype(np.int64)
    return frame[place][:, place]


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
