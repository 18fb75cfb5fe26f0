"""Pictures as 8-bit PNG files."""

from __future__ import annotations

from pathlib import Path

import torch
from PIL import Image
from torch import Tensor

from gbufrt.files.output import atomic


def to_pil(picture: Tensor) -> Image.Image:
    """A Pillow image of one picture.

    Args:
        picture: ``(3, H, W)`` or ``(1, 3, H, W)``, display-referred in [0, 1]; what lies outside is clipped and NaN is
            black.

    Raises:
        ValueError: another shape.
    """
    picture = picture[0] if picture.ndim == 4 and picture.shape[0] == 1 else picture
    if picture.ndim != 3 or picture.shape[0] != 3:
        raise ValueError(f"picture must be (3,H,W) or (1,3,H,W) in [0, 1], got {tuple(picture.shape)}")
    levels = (picture.detach().cpu().float().nan_to_num(0.0).clamp(0, 1) * 255).round().to(torch.uint8)
    return Image.fromarray(levels.permute(1, 2, 0).contiguous().numpy())


def write_png(path: str | Path, picture: Tensor | Image.Image) -> None:
    """Write one picture (see `to_pil`), whole or not at all."""
    image = picture if isinstance(picture, Image.Image) else to_pil(picture)
    with atomic(path) as part:
        image.save(part, format="PNG", compress_level=4)
