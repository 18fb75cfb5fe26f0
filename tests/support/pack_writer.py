"""A tiny writer of resource packs, for tests: what they hold is drawn by numpy."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

JAVA = "assets/minecraft/"


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
