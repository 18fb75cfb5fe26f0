"""The frame of Minecraft RTX: few noisy paths in a small picture, made a clean and large one by filters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, get_args

from gbufrt import Pipeline
from gbufrt.names import meant
from gbufrt.reduction import LightKept
from post.passes.denoising.asvgf import ASVGF
from post.passes.denoising.denoise import Denoise
from post.passes.display.exposure import Exposure
from post.passes.display.overlay import Overlay
from post.passes.display.pulse import Pulse
from post.passes.display.tone_map import DisplayEncode, ToneMap
from post.passes.display.vignette import Vignette
from post.passes.lens.upscale import Upscale
from post.passes.light.composite import Composite
from post.passes.light.outgoing import Outgoing
from post.upsampling.enlarged import Enlarged

Preset = Literal["low", "medium", "high", "ultra"]
Denoiser = Literal["asvgf", "denoise"]


@dataclass(frozen=True, kw_only=True)
class Quality:
    """One row of the table of presets."""

    ratio: float
    """Sides of the picture over those of what is traced."""
    iterations: int
    """Of the wavelets of `Denoise`."""


QUALITIES: Mapping[str, Quality] = {
    "low": Quality(ratio=3.0, iterations=3),
    "medium": Quality(ratio=2.0, iterations=3),
    "high": Quality(ratio=2.0, iterations=4),
    "ultra": Quality(ratio=1.5, iterations=5),
}


def minecraft_rtx(
    preset: Preset | str = "high", *, denoiser: Denoiser = "asvgf", tunables: Mapping[str, Any] | None = None
) -> Pipeline:
    """Minecraft RTX's frame: light of one sample a pixel, denoised, composited, upscaled over time, and displayed.

    The order is that of the game's renderer, with a temporal upscaler of our own where it has a trained one. Stages
    from exposure on run in a frame as large as the picture, see `post.Enlarged`. `post.with_fog` puts fog before the
    composite. ``light`` takes any pipeline that writes ``composite`` and ``color``; the noisy light stays in the frame.

    Args:
        preset: ``low``, ``medium``, ``high`` or ``ultra``.
        denoiser: ``asvgf`` for diffuse and specular light apart, with replayed samples, as `tracer.sampled` gives it;
            ``denoise`` for all light in one ``radiance``, as `tracer.one_path` gives it.
        tunables: changes by dotted name, see `Pipeline.with_tunables`.

    Returns:
        A pipeline that reads a frame with such light, whose camera is jittered, and writes everything up to ``image``;
        ``color`` and ``image`` are ``upscale.ratio`` times as large as the frame.

    Raises:
        ValueError: unknown preset, denoiser or tunable.

    Source: an analysis of a frame of the beta of Minecraft RTX, habr.com/ru/post/503198.
    """
    if preset not in QUALITIES:
        raise ValueError(f"preset must be one of {', '.join(QUALITIES)}, got {preset!r}{meant(preset, QUALITIES)}")
    if denoiser not in get_args(Denoiser):
        raise ValueError(f"denoiser must be one of {', '.join(get_args(Denoiser))}, got {denoiser!r}")
    quality = QUALITIES[preset]
    pipeline = Pipeline(
        light=_light(denoiser, quality),
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


def _light(denoiser: Denoiser, quality: Quality) -> Pipeline:
    if denoiser == "denoise":
        clean = Denoise(signal="radiance", iterations=quality.iterations)
        return Pipeline(reduction=LightKept(), denoise=clean, composite=Composite())
    return Pipeline(
        reduction=LightKept(), **_apart(), behind=Pipeline(layer="behind", **_apart()), composite=Composite()
    )


def _apart() -> dict[str, Any]:
    return {"diffuse": ASVGF(), "specular": ASVGF(signal="specular"), "outgoing": Outgoing()}
