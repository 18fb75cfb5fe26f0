"""What weather there is in a scene: rain, and waves of water. `tracer.weather` says what it looks like."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from gbufrt.numeric import check_numbers


@dataclass(frozen=True, kw_only=True)
class Rain:
    """Rain that wets what stands under the open sky, in G-buffers and frames; what truth's rays meet later stays dry.

    Args:
        level: how hard it rains, 0 to 1.
        disc_radius: of the disc, one world unit above a surface, through which rays look for cover: how far rain
            slants, and so how soft the border of what stays dry is.
        puddle_scale: world units of a cell of the noise that makes puddles.
        puddle_low: value of that noise, 0 to 1, from which on there is a puddle's rim.
        puddle_high: and from which on the puddle is full.
        wetness: of a full puddle, in hardest rain.
        uniform_wetness: of all between puddles, for roughness alone.
        runoff: share of the wetness that stays where no puddle can be: on walls, and on what moves.
        puddle_roughness: perceptual roughness of a full puddle.
        colour_reduction: albedo of what is wet over that of what is dry.
        metalness_reduction: likewise.
        ripples: slope of the rings round drops at their steepest; 0 for none.

    Source: BetterRTX's rain puddles.
    """

    level: float
    disc_radius: float = 0.2
    puddle_scale: float = 3.0
    puddle_low: float = 0.48
    puddle_high: float = 0.62
    wetness: float = 1.0
    uniform_wetness: float = 0.4
    runoff: float = 0.5
    puddle_roughness: float = 0.04
    colour_reduction: float = 0.55
    metalness_reduction: float = 0.5
    ripples: float = 0.25

    def __post_init__(self) -> None:
        check_numbers(**{field.name: getattr(self, field.name) for field in fields(self)})
        for name in (field.name for field in fields(self)):
            value, most = getattr(self, name), 100.0 if name in ("disc_radius", "puddle_scale", "ripples") else 1.0
            if not (math.isfinite(value) and 0.0 <= value <= most):
                raise ValueError(f"{name} of rain must lie in 0..{most:g}, got {value}")
        if not self.puddle_low < self.puddle_high:
            raise ValueError(f"puddle_low must be less than puddle_high, got {self.puddle_low} and {self.puddle_high}")
        if self.puddle_scale < 1e-3:
            raise ValueError(f"puddle_scale of rain must be 0.001 or more, got {self.puddle_scale}")


@dataclass(frozen=True, kw_only=True)
class Waves:
    """Waves on water, in G-buffers and direct light; rays that are not the camera's find it flat.

    Args:
        amplitude: of the highest waves, world units; their crests are as high as still water.
        frequency: cells of the coarsest noise a world unit, along x; twice as many along z.
        speed: cells a second by which the waves go on.
        caustics: how far from the water sunlight that it reflects is seen, world units; 0 for none.

    Source: BetterRTX's water parallax.
    """

    amplitude: float = 0.1
    frequency: float = 0.3
    speed: float = 0.6
    caustics: float = 16.0

    def __post_init__(self) -> None:
        check_numbers(**{field.name: getattr(self, field.name) for field in fields(self)})
        for name, most in (("amplitude", 0.45), ("frequency", 10.0), ("speed", 100.0), ("caustics", 1000.0)):
            if not (math.isfinite(value := getattr(self, name)) and 0.0 <= value <= most):
                raise ValueError(f"{name} of waves must lie in 0..{most:g}, got {value}")
