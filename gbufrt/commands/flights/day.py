"""Worlds under the sky of an hour, in rain, and with waves on their water."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gbufrt.commands.arguments.world import DayOptions
    from tracer.scene.scene import Scene
    from tracer.worlds.regions.stream import Stream


def under(scene: Scene | Stream, day: DayOptions) -> Scene | Stream:
    """A world as the options say."""
    if (when := day.parsed()) is not None:
        from tracer.scene.daylight import SunPath, at_hour

        path = SunPath(**dict(zip(("zenith", "azimuth"), when.pop("path", ()), strict=False)))
        scene = at_hour(scene, **when, path=path)
    if day.rain is not None:
        from tracer.weather.rain import raining

        scene = raining(scene, day.rain)
    if day.waves is not None:
        from tracer.scene.weather import Waves

        scene = replace(scene, waves=Waves(amplitude=day.waves))
    return scene
