"""Small pictures beside their truth."""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor

from gbufrt.commands.ablation.figures.display import display, error_picture, exposure_of

WIDTH = 480  # pixels that a picture on the page has at least


def compared(name: str, lights: Mapping[str, Tensor], truth: Tensor) -> dict[str, Tensor]:
    """Displayed pictures of linear light by the names that a section expects, pixels as squares.

    Args:
        name: of the section's picture.
        lights: ``ours`` and others, each ``(1, 3, H, W)``.
        truth: likewise; it sets the exposure.
    """
    whole = torch.ones_like(truth[:, :1], dtype=torch.bool)
    exposure = exposure_of(truth, whole)
    return compared_displays(
        name, {key: display(light, exposure) for key, light in lights.items()}, display(truth, exposure)
    )


def compared_displays(name: str, shown: Mapping[str, Tensor], truth: Tensor) -> dict[str, Tensor]:
    """`compared` of pictures that are displayed already."""
    whole = torch.ones_like(truth[:, :1], dtype=torch.bool)
    pictures = {f"{name} {key}": picture for key, picture in shown.items() if key != "ours"}
    error = error_picture(shown["ours"], truth, whole)
    pictures |= {name: shown["ours"], f"{name} truth": truth, f"{name} error": error}
    return {key: enlarged(picture) for key, picture in pictures.items()}


def enlarged(picture: Tensor) -> Tensor:
    """As many whole times as wide as it takes to be seen."""
    times = max(-(-WIDTH // picture.shape[-1]), 1)
    return picture.repeat_interleave(times, dim=-1).repeat_interleave(times, dim=-2)
