"""The frame of Minecraft RTX: few noisy paths in a small picture, made a clean and large one by filters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from gbufrt import Pipeline
from gbufrt.names import meant
from gbufrt.reduction import LightKept
from post.passes.denoising.denoise import Denoise
from post.passes.display.exposure import Exposure
from post.passes.display.overlay import Overlay
from post.passes.display.pulse import Pulse
from post.passes.display.tone_map import DisplayEncode, ToneMap
from post.passes.display.vignette import Vignette
from post.passes.lens.upscale import Upscale
from post.passes.light.composite import Composite
from post.upsampling.enlarged import Enlarged

Preset = Literal["low", "medium", "high", "ultra"]


@dataclass(frozen=True, kw_only=True)
class Quality:
    """One row of the table of presets."""

    ratio: float
    """Sides of the picture over those of what is traced."""
    iterations: int
    """Of the denoiser's wavelets."""


QUALITIES: Mapping[str, Quality] = {
    "low": Quality(ratio=3.0, iterations=3),
    "medium": Quality(ratio=2.0, iterations=3),
    "high": Quality(ratio=2.0, iterations=4),
    "ultra": Quality(ratio=1.5, iterations=5),
}


def minecraft_rtx(preset: Preset | str = "high", *, tunables: Mapping[str, Any] | None = None) -> Pipeline:
    """Minecraft RTX's frame: light of one path a pixel, denoised, composited, upscaled over time, and displayed.

    The order is that of the game's renderer, with a temporal upscaler of our own where it has a trained one. Stages
    from exposure on run in a frame as large as the picture, see `post.Enlarged`. `post.with_fog` puts fog before the
    composite. ``light`` takes any pipeline that writes ``composite`` and ``color``; the noisy light stays in the frame.

    Args:
        preset: ``low``, ``medium``, ``high`` or ``ultra``.
        tunables: changes by dotted name, see `Pipeline.with_tunables`.

    Returns:
        A pipeline that reads a frame with noisy ``radiance``, as of `tracer.one_path`, whose camera is jittered, and
        writes everything up to ``image``; ``color`` and ``image`` are ``upscale.ratio`` times as large as the frame.

    Raises:
        ValueError: unknown preset or tunable.

    Source: an analysis of a frame of the beta of Minecraft RTX, habr.com/ru/post/503198.
    """
    if preset not in QUALITIES:
        raise ValueError(f"preset must be one of {', '.join(QUALITIES)}, got {preset!r}{meant(preset, QUALITIES)}")
    quality = QUALITIES[preset]
    pipeline = Pipeline(
        light=Pipeline(
            reduction=LightKept(),
            denoise=Denoise(signal="radiance", iterations=quality.iterations),
            composite=Composite(),
        ),
        upscale=Upscale(ratio=quality.ratio),
        display=Pipeline(
            given={"color"},
            reduction=Enlarged(),
            exposure=Exposure(),
            pulse=Pulse(),
            tone_map=ToneMap(),
            vignette=Vignette(),
            encode=DisplayEncode(),
            ui=Overlay(),
        ),
    )
    return pipeline.with_tunables(tunables or {})
