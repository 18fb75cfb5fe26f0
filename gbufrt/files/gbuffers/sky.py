"""The sky that mirrors show, for frames of other renderers."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator
from pathlib import Path

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt.environment import lookup_environment
from gbufrt.files.gbuffers.layers import Layers
from gbufrt.files.guard import read_parts
from gbufrt.frame import Frame
from gbufrt.luminance import luminance
from gbufrt.validation.geometry import FEW

SHOWN = 0.25  # of the mirrors' pixels: what is on screen or hidden from the sky may cover the rest
SMOOTH = 0.15  # roughness of mirrors
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


def under(frames: Iterable[Frame], environment: Tensor, *, known: bool = True) -> Iterator[Frame]:
    """The frames, with mirrors that show a sky where they show nothing that is on screen.

    Warns where neither the profile nor the first frame tells whether its light holds that already.

    Args:
        frames: of other renderers.
        environment: see `read_environment`.
        known: whether the profile tells which layers hold the sky in mirrors.

    Raises:
        ValueError: a frame's light holds that already.
    """
    for place, frame in enumerate(frames):
        if frame.radiance is None:
            raise ValueError(
                "the sky would be added to a finished picture, which holds what mirrors show; leave it out"
            )
        if frame.environment is not None:
            raise ValueError(
                "the files' direct light holds the sky in mirrors already (Blender: Glossy Direct), and it would count "
                "twice; leave the environment out"
            )
        share = share_shown(frame, environment) if place == 0 and not known else 0.0
        if share is None:
            warnings.warn(
                "whether direct light holds the sky in mirrors already cannot be told, as the files show no mirror "
                "with roughness and metalness; if it does, leave the environment out",
                stacklevel=2,
            )
        elif share > SHOWN:
            raise ValueError(
                f"the files' direct light is as bright as the sky at {share:.0%} of the mirrors' pixels: it holds the "
                "sky already, which would count twice; leave the environment out"
            )
        yield frame.replace(environment=environment)


def share_shown(frame: Frame, environment: Tensor) -> float | None:
    """The share of the pixels of metal mirrors whose direct light is that of the sky in them, or more.

    Without its sky a mirror has no direct light but the highlights of lamps. None where no mirror tells.
    """
    g, light = frame.gbuffer, frame.radiance
    if g.roughness is None or g.metallic is None or g.albedo is None or light is None:
        return None
    eye = g.camera.rotate_to_world(g.camera.to_eye(g.camera.unproject(g.depth)))
    mirrored = 2 * (eye * g.normal).sum(1, keepdim=True) * g.normal - eye
    sky = luminance(lookup_environment(environment, mirrored) * g.albedo)
    tells = g.hit & (g.roughness < SMOOTH) & (g.metallic > 0.5) & (sky > sky.mean() / 8)
    own = luminance(light if g.emission is None else light - g.emission)
    return float((own > sky / 2)[tells].float().mean()) if int(tells.sum()) >= FEW else None


def sky_lacks(direct: Tensor, finished: Tensor, hit: Tensor) -> bool:
    """Whether direct light is black all over a sky that the finished picture shows: its pass is missing.

    Args:
        direct: ``(1, 3, H, W)`` radiance.
        finished: likewise, with all light.
        hit: ``(1, 1, H, W)`` bool.
    """
    sky = ~hit.expand_as(direct)
    return bool((direct[sky] == 0).all()) and bool((finished[sky] > 0).any())
