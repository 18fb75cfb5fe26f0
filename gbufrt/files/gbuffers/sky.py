"""The sky that mirrors show, for frames of other renderers."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt.files.gbuffers.layers import Layers
from gbufrt.files.guard import read_parts
from gbufrt.frame import Frame

MOST_ROWS = 512  # larger skies are averaged: every frame's file holds its sky
COUNTED = (1, 3, 1, 2)
"""Shape of the black sky of a frame whose light holds the sky in mirrors already."""


def read_environment(path: str | Path, *, turn: float = 0.0) -> Tensor:
    """A lat-long picture of the sky from an EXR file, as `gbufrt.environment` has it, of at most 512 rows.

    Args:
        path: of the file; its R, G and B, of whatever layer, are linear radiance.
        turn: degrees by which the picture is to be turned, to the right; see `Profile.environment_turn`.

    Returns:
        ``(1, 3, h, 2h)``.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is damaged, has no R, G and B, is not twice as wide as high, or not finite and positive.
    """
    layers = Layers(path, read_parts(path))
    keys = layers.find(("", "*"), 3)
    if not keys:
        raise ValueError(f"{path} has no R, G and B; give a lat-long picture of the sky")
    sky = layers.stack(keys)
    height, width = sky.shape[-2:]
    if width != 2 * height:
        raise ValueError(f"{path} must be a lat-long picture, twice as wide as high, got {width}x{height}")
    if not bool(torch.isfinite(sky).all()) or bool((sky < 0).any()):
        raise ValueError(f"{path} must hold finite radiance of at least 0; mend it first")
    sky = sky.roll(round(width * turn / 360), dims=-1)
    return F.adaptive_avg_pool2d(sky, (MOST_ROWS, 2 * MOST_ROWS)) if height > MOST_ROWS else sky


def under(frames: Iterable[Frame], environment: Tensor) -> Iterator[Frame]:
    """The frames, with mirrors that show a sky where they show nothing that is on screen.

    Raises:
        ValueError: a frame's light holds that already.
    """
    for frame in frames:
        if frame.radiance is None:
            raise ValueError(
                "the sky would be added to a finished picture, which holds what mirrors show; leave it out"
            )
        if frame.environment is not None:
            raise ValueError(
                "the files' direct light holds the sky in mirrors already (Blender: Glossy Direct), and it would count "
                "twice; leave the environment out"
            )
        yield frame.replace(environment=environment)
