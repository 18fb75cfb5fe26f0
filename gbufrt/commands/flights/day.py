"""Worlds under the sky of an hour, in rain, and with waves on their water."""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gbufrt.commands.arguments.world import DayOptions
    from tracer.scene.scene import Scene
    from tracer.worlds.regions.stream import Stream


def under(scene: Scene | Stream, day: DayOptions, world: str) -> Scene | Stream:
    """A world as the options say; one that has no day, such as the Nether, keeps its own light, and that is told."""
    from tracer.worlds.regions.landscape import is_dayless

    when, rain = day.parsed(), day.rain
    if (when is not None or rain is not None) and is_dayless(scene.sky):
        warnings.warn(f"--hour and --rain leave {world} as it is: the Nether and the End have no day", stacklevel=2)
        when, rain = None, None
    if when is not None:
        from tracer.scene.daylight import SunPath, at_hour

        path = SunPath(**dict(zip(("zenith", "azimuth"), when.pop("path", ()), strict=False)))
        scene = at_hour(scene, **when, path=path)
    if rain is not None:
        from tracer.weather.rain import raining

        scene = raining(scene, rain)
    if day.waves is not None:
        from tracer.scene.weather import Waves

        scene = replace(scene, waves=Waves(amplitude=day.waves))
    return scene
