"""Options that say which part of a world is taken, when, and in what weather. Does not import torch."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from cyclopts import Parameter

from gbufrt.commands.arguments.values import Numbers, Whole, at_least, finite, whole_numbers

FOG_UNITS = 100  # world units over which --fog takes its share


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class PartOptions:
    """Which part of a Minecraft world is taken, and its textures."""

    box: Numbers = None
    """Blocks of a Minecraft world to take, as X0,Y0,Z0,X1,Y1,Z1, the last three not included; along x and z whole
    chunks, but for --bare and --window."""

    around: Numbers = None
    """Place X,Z in a Minecraft world round which chunks are taken. [default: the player's, else the middle]"""

    chunks: Whole | None = None
    """How many chunks along each side are taken. [default: all of a .mca file, 24 of a save folder]"""

    window: Whole | None = None
    """Chunks along each side that are in memory at once: they follow the camera over a region or a save of any size,
    and haze hides their border. Such a world has the view flight, under a roof of bedrock landscape and panorama.
    [default: the whole part is loaded]"""

    pack: str | None = None
    """Resource pack (jar, zip or folder) with textures for the blocks of a Minecraft world or a schematic."""

    bare: bool = False
    """A Minecraft world ends where its blocks end, in place of going on as the sea, or as land mirrored into haze."""

    def parsed(self) -> dict[str, Any]:
        """The part as arguments of `tracer.load`, or of `tracer.stream` with a window; those that are given.

        Raises:
            ValueError: not as many whole numbers as wanted, or both a window and nothing beyond.
        """
        if self.bare and self.window is not None:
            raise ValueError("--bare is for worlds that are in memory as a whole; leave it out with --window")
        part = {
            "box": whole_numbers("--box", self.box, "X0,Y0,Z0,X1,Y1,Z1"),
            "around": whole_numbers("--around", self.around, "X,Z"),
            "chunks": self.chunks,
            "window": self.window,
            "pack": self.pack,
            "bare": self.bare or None,
        }
        return {name: value for name, value in part.items() if value is not None}


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class FogOptions:
    """Fog."""

    fog: float | None = None
    """Share of light that fog takes over 100 world units, below 1: 0.3 is thin, 0.9 makes rooms glow.
    [default: none]"""

    fog_height: float | None = None
    """With --fog: world units over which it thins to 0.37 of itself, from the first camera up. [default: even]"""

    def parsed(self) -> dict[str, float] | None:
        """``extinction`` and ``falloff`` of `tracer.Fog`; None without fog.

        Raises:
            ValueError: a share or height that makes no sense, or a height without fog.
        """
        if self.fog is None:
            if self.fog_height is not None:
                raise ValueError("--fog-height needs --fog")
            return None
        if not 0.0 <= self.fog < 1.0:
            raise ValueError(f"--fog must be at least 0 and below 1, got {self.fog:g}")
        if self.fog_height is not None:
            at_least("--fog-height", self.fog_height, 0.1)
        falloff = 0.0 if self.fog_height is None else 1 / self.fog_height
        return {"extinction": -math.log(1 - self.fog) / FOG_UNITS, "falloff": falloff}


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class DayOptions:
    """The time of day, and the weather."""

    hour: float | None = None
    """Hour of the day, 0 to 24, whose sun or moon and sky the world gets; lamps light the night. [default: its own]"""

    day: float | None = None
    """With --hour: days since a full moon; 14.8 is a night without moon. [default: 0]"""

    sun_path: str | None = None
    """With --hour: ZENITH,AZIMUTH, degrees that noon's sun stands off the zenith, and off -z. [default: 30,12]"""

    rain: float | None = None
    """How hard it rains, 0 to 1: grey sky, haze, and what is under the open sky wet. [default: not at all]"""

    waves: float | None = None
    """Height of waves on water over its mean, world units, 0 to 0.45, such as 0.1. [default: still water; 0.08 on the
    open sea]"""

    def parsed(self) -> dict[str, Any] | None:
        """Arguments of `tracer.at_hour`, ``path`` as two numbers; None where the world keeps its own sun.

        Raises:
            ValueError: an hour that no day has, other numbers than two, what goes with an hour without one, or
                rain or waves that cannot be.
        """
        if self.rain is not None and not 0.0 <= self.rain <= 1.0:
            raise ValueError(f"--rain must lie in 0..1, got {self.rain:g}")
        if self.waves is not None and not 0.0 <= self.waves <= 0.45:
            raise ValueError(f"--waves must lie in 0..0.45, got {self.waves:g}")
        if self.hour is None:
            for option, value in (("--day", self.day), ("--sun-path", self.sun_path)):
                if value is not None:
                    raise ValueError(f"{option} needs --hour")
            return None
        if not 0.0 <= self.hour <= 24.0:
            raise ValueError(f"--hour must lie in 0..24, got {self.hour:g}")
        if self.day is not None:
            at_least("--day", self.day, 0, 1_000_000)
        path = self.sun_path and finite(self.sun_path, 2)
        if path == () or (path and not (abs(path[0]) <= 90 and abs(path[1]) <= 360)):
            raise ValueError(f"--sun-path must be ZENITH,AZIMUTH, degrees up to 90 and 360, got {self.sun_path!r}")
        given = {"hour": self.hour, "day": self.day, "path": path}
        return {name: value for name, value in given.items() if value is not None}
