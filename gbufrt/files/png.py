"""Pictures as PNG files of 8 or 16 bits, tagged as sRGB."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
import torch
from PIL import Image
from PIL.PngImagePlugin import PngInfo
from torch import Tensor

from gbufrt.files.output import MAX_PIXELS, atomic, check_ending

LEVEL = 4  # of deflate
PERCEPTUAL = b"\0"  # the rendering intent in the sRGB chunk


def to_pil(picture: Tensor) -> Image.Image:
    """A Pillow image of one picture.

    Args:
        picture: ``(3, H, W)`` or ``(1, 3, H, W)``, display-referred in [0, 1]; what lies outside is clipped and NaN is
            black.

    Raises:
        ValueError: another shape.
    """
    return Image.fromarray(_levels(picture, 255).astype(np.uint8))


def write_png(path: str | Path, picture: Tensor | Image.Image, *, bits: int = 8) -> None:
    """Write one picture, whole or not at all.

    Args:
        path: the file to make.
        picture: see `to_pil`; a Pillow image has 8 bits.
        bits: 8 or 16 a channel.

    Raises:
        ValueError: another ending, shape or number of bits.
    """
    check_ending(path, ".png", "gbufrt.files.exr.write_exr writes whole frames")
    if bits not in (8, 16) or (bits == 16 and isinstance(picture, Image.Image)):
        raise ValueError(f"bits must be 8, or 16 for a tensor, got {bits}")
    if bits == 16:
        with atomic(path) as part:
            part.write_bytes(_png16(_levels(picture, 65535)))  # pyright: ignore[reportArgumentType]
        return
    image = picture if isinstance(picture, Image.Image) else to_pil(picture)
    tags = PngInfo()
    tags.add(b"sRGB", PERCEPTUAL)
    with atomic(path) as part:
        image.save(part, format="PNG", compress_level=LEVEL, pnginfo=tags)


def read_rgba(path: str | Path) -> Tensor:
    """A picture with alpha.

    Args:
        path: of a file that Pillow reads, such as a PNG.

    Returns:
        ``(1, 4, H, W)`` encoded values in [0, 1], alpha last and not multiplied into colour.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is no picture, is too large, or has no alpha.
    """
    if not Path(path).is_file():
        raise FileNotFoundError(f"{path} does not exist; check the path")
    try:
        with Image.open(path) as image:
            if image.width * image.height > MAX_PIXELS:
                raise ValueError(f"{path} has more than {MAX_PIXELS} pixels")
            if not image.has_transparency_data:
                raise ValueError(f"{path} has no alpha, and would hide the whole frame; save it with transparency")
            levels = np.array(image.convert("RGBA"))
    except (OSError, SyntaxError, Image.DecompressionBombError) as error:  # SyntaxError: how Pillow names broken PNGs
        raise ValueError(f"{path} is no picture that can be read: {error}") from error
    return torch.from_numpy(levels).permute(2, 0, 1)[None].float() / 255


def _levels(picture: Tensor, most: int) -> np.ndarray:
    """``(H, W, 3)`` whole numbers up to ``most``."""
    picture = picture[0] if picture.ndim == 4 and picture.shape[0] == 1 else picture
    if picture.ndim != 3 or picture.shape[0] != 3:
        raise ValueError(f"picture must be (3,H,W) or (1,3,H,W) in [0, 1], got {tuple(picture.shape)}")
    levels = (picture.detach().cpu().float().nan_to_num(0.0).clamp(0, 1) * most).round().to(torch.int32)
    return levels.permute(1, 2, 0).contiguous().numpy()


def _png16(levels: np.ndarray) -> bytes:
    """A PNG file; Pillow writes no colour of 16 bits. Each row is filtered by the one above (filter 2).

    Source: Portable Network Graphics Specification, third edition, 5 and 9.
    """
    height, width, _ = levels.shape
    rows = levels.astype(">u2").view(np.uint8).reshape(height, width * 6)
    filtered = np.full((height, 1 + width * 6), 2, np.uint8)
    filtered[:, 1:] = np.diff(rows, axis=0, prepend=np.zeros_like(rows[:1]))
    head = struct.pack(">IIBBBBB", width, height, 16, 2, 0, 0, 0)
    body = zlib.compress(filtered.tobytes(), LEVEL)
    chunks = ((b"IHDR", head), (b"sRGB", PERCEPTUAL), (b"IDAT", body), (b"IEND", b""))
    framed = (struct.pack(">I", len(data)) + kind + data + struct.pack(">I", _crc(kind, data)) for kind, data in chunks)
    return b"\x89PNG\r\n\x1a\n" + b"".join(framed)


def _crc(kind: bytes, data: bytes) -> int:
    return zlib.crc32(data, zlib.crc32(kind))
