"""The sun and the sky by the hour."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from tracer.scene.material import RGB
from tracer.scene.scene import Scene, Sky, Sun

TILT = 30.0  # degrees between the sun's highest place and the zenith
TWILIGHT = 0.16  # sine of the elevation at which the day has its full light
MOON = (0.16, 0.21, 0.34)  # irradiance: the eye, and exposure, take it for much more
NIGHT = Sky(zenith=(0.004, 0.007, 0.022), horizon=(0.009, 0.013, 0.029), ground=(0.005, 0.006, 0.010))
LOW = ((1.0, 0.42, 0.16), (0.50, 0.24, 0.18))  # a low sun's colour, and the horizon's, over those of noon


def at_hour(scene: Scene, hour: float) -> Scene:
    """A scene with the sun where it is at an hour: it rises in the east (+x) at 6, and sets in the west at 18.

    From dusk to dawn the moon stands where the sun stood twelve hours before. What the scene's own sun and sky are is
    taken for noon; nothing else changes, so that lamps light the night.

    Args:
        scene: any scene; one without a sun gets the default one.
        hour: 0 to 24.

    Raises:
        ValueError: another hour.
    """
    if not 0.0 <= hour <= 24.0:
        raise ValueError(f"hour must lie in 0..24, got {hour}")
    angle = math.pi * (hour - 6.0) / 12.0
    height = math.sin(angle) * math.cos(math.radians(TILT))
    day = min(max((height + TWILIGHT / 2) / (1.5 * TWILIGHT), 0.0), 1.0)  # dusk begins over the horizon, ends under it
    gold = min(max(1.0 - height / 0.5, 0.0), 1.0) ** 2
    noon = scene.sun or Sun()
    moonlit = height < 0.0
    turned = angle + math.pi if moonlit else angle
    direction = (math.cos(turned), abs(height) + 0.02, -abs(math.sin(turned)) * math.sin(math.radians(TILT)) - 0.15)
    shown = min(max(height / TWILIGHT, 0.0), 1.0)
    strength = tuple(s * shown * (1.0 + gold * (c - 1.0)) for s, c in zip(noon.irradiance, LOW[0], strict=True))
    moon = tuple(m * min(-height / TWILIGHT, 1.0) for m in MOON)
    return replace(
        scene,
        sun=replace(noon, direction=direction, irradiance=_rgb(moon if moonlit else strength)),
        sky=_between(NIGHT, scene.sky, day, gold),
    )


def _between(night: Sky, noon: Sky, day: float, gold: float) -> Sky:
    warm = Sky(
        zenith=_rgb([0.55 * c for c in noon.zenith]),
        horizon=_rgb(np.asarray(LOW[1]) * 2.0 * np.asarray(noon.horizon)),
        ground=_rgb([0.5 * c for c in noon.ground]),
    )
    return Sky(
        **{
            part: _rgb(
                (1 - day) * np.asarray(getattr(night, part))
                + day * ((1 - gold) * np.asarray(getattr(noon, part)) + gold * np.asarray(getattr(warm, part)))
            )
            for part in ("zenith", "horizon", "ground")
        }
    )


def _rgb(values: object) -> RGB:
    r, g, b = (float(v) for v in np.asarray(values, np.float64))
    return r, g, b
