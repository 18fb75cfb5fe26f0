"""The frame of Minecraft RTX and the world of BetterRTX against their truths, each in a small picture of its own."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from gbufrt.commands.ablation.place import Place
from gbufrt.commands.ablation.subjects import Outcome
from gbufrt.commands.ablation.world import caustics, cut, fog, lights_out, programs, sky, upscaling
from gbufrt.commands.ablation.world.bars import BARS
from gbufrt.commands.ablation.world.sections import SECTIONS

__all__ = ["BARS", "JUDGES", "PLACELESS", "SECTIONS", "VIEWS"]

JUDGES: Mapping[str, Callable[[Place], Outcome]] = {
    "asvgf": lights_out.judge,
    "irradiance_cache": cut.judge,
    "fog": fog.judge,
    "upscale": upscaling.judge,
    "sky": sky.judge,
    "caustics": caustics.judge,
    "dispatch": programs.judge,
}
VIEWS: Mapping[str, tuple[str, ...]] = {
    "asvgf": ("hall",),
    "irradiance_cache": tuple(cut.CUTS),
    "fog": tuple(fog.HOURS),
    "upscale": ("flythrough", "orbit"),
    "sky": tuple(sky.HOURS),
    "caustics": tuple(caustics.SUNS),
    "dispatch": ("village",),
}
PLACELESS = ("sky", "caustics")  # what they call views are cases of their own, not the world's
