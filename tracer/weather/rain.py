"""Rain: the sky that it falls from, and haze."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, ClassVar, Protocol, TypeVar

import torch
from torch import Tensor

from gbufrt.environment import environment_directions, environment_solid_angles
from tracer.lights.sky import sky_radiance
from tracer.scene.checks import check_open, keeps_its_light
from tracer.scene.scene import Haze, Scene, Sky, Sun
from tracer.scene.view import View
from tracer.scene.weather import Rain

SIZE = (64, 128)  # pixels of the sky's picture
DULL = 0.4  # light on the ground in hardest rain, over that of a clear sky
TINGE = (0.94, 1.00, 1.08)  # of cloud
SOIL = 0.2  # what the ground sends back up
NEAR, FAR = 4.0, 170.0  # world units: where the haze of the hardest rain begins, and where nothing else is seen
SIGHT = 112.0  # and how far off what the first view looks to may lie; where that is farther, haze is so much thinner


class Open(Protocol):
    """A dataclass with sun, sky, haze, rain and views: a `Scene`, or a `tracer.worlds.regions.stream.Stream`."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    @property
    def sun(self) -> Sun | None: ...
    @property
    def sky(self) -> Sky: ...
    @property
    def haze(self) -> Haze | None: ...
    @property
    def views(self) -> Mapping[str, View]: ...
    @property
    def device(self) -> torch.device | str: ...


S = TypeVar("S", bound=Open)


def raining(scene: S, level: float) -> S:
    """A scene in the rain: grey sky, haze, and all that is under the open sky wet.

    Clouds take the sun first and let through part of the light of sun and sky together, so that a night stays dark.
    Haze is thinner in a scene whose first view stands far off, as before large models of small voxels.
    `at_hour` goes before, as it makes a clear sky. Other numbers of `Rain` are set by ``replace(scene, rain=...)``.

    Args:
        scene: any scene or stream.
        level: how hard it rains, 0 to 1; 0 leaves the scene as it is.

    Returns:
        A scene or stream like it, in that rain. One without a day, as the Nether, comes back as it is.

    Raises:
        TypeError: it is no scene, or level is no number.
        ValueError: another level.

    Warns:
        UserWarning: the scene has no day.

    Source: Moon and Spencer 1942 for the overcast sky (CIE S 011).
    """
    check_open(scene)
    rain = Rain(level=level)
    if level == 0.0 or keeps_its_light(scene, "rain"):
        return scene
    cloudy = 1 - (1 - level) ** 2
    directions = environment_directions(SIZE, device=scene.device)
    clear = sky_radiance(_as_scene(scene), directions)
    grey = overcast(directions, _on_ground(scene.sun, clear, directions))
    sun = scene.sun and replace(scene.sun, irradiance=_scaled(scene.sun.irradiance, (1 - cloudy) ** 1.5))
    thin = max(1.0, _sight(scene.views) / SIGHT) / level
    haze = Haze(begin=NEAR * thin, end=FAR * thin).and_also(scene.haze)
    sky = Sky(plain=scene.sky.plain, picture=torch.lerp(clear, grey, cloudy))
    return replace(scene, sun=sun, sky=sky, haze=haze, rain=rain)


def overcast(directions: Tensor, irradiance: Tensor) -> Tensor:
    """Radiance of a sky of cloud, three times as bright at the zenith as at the horizon.

    Args:
        directions: ``(1, 3, ...)`` unit length.
        irradiance: ``()`` on level ground.

    Returns:
        ``(1, 3, ...)``.
    """
    up = directions[:, 1:2]
    zenith = irradiance * 9 / (7 * math.pi)
    radiance = torch.where(up > 0, zenith * (1 + 2 * up) / 3, irradiance * SOIL / math.pi)
    return radiance * radiance.new_tensor(TINGE).view(1, 3, *(1,) * (directions.ndim - 2))


def _on_ground(sun: Sun | None, sky: Tensor, directions: Tensor) -> Tensor:
    """``()`` what a sky of cloud lets through of the irradiance on level ground, mean of the colours."""
    power = sky * environment_solid_angles(SIZE, device=sky.device) * directions[:, 1:2].clamp_min(0)
    total = power.sum(dim=(2, 3)).mean()
    if sun is not None:
        height = sun.direction[1] / math.hypot(*sun.direction)
        total = total + max(height, 0.0) * sum(sun.irradiance) / 3
    return DULL * total


def _sight(views: Mapping[str, View]) -> float:
    """How far off what the first view looks to lies; 0 without views."""
    return max((math.dist(view.eye(0.0), view.target(0.0)) for view in [*views.values()][:1]), default=0.0)


def _as_scene(scene: Any) -> Scene:
    """All that the sky's radiance asks of a scene is its sun and sky, which a stream has too."""
    return scene


def _scaled(values: tuple[float, float, float], factor: float) -> tuple[float, float, float]:
    return values[0] * factor, values[1] * factor, values[2] * factor
