"""Sun, moon and sky by the hour."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Protocol, TypeVar

import numpy as np
import torch

from gbufrt.atmosphere import Atmosphere, sky_picture, sun_transmittance
from gbufrt.atmosphere.sky import from_ground
from gbufrt.numeric import check_kind, check_numbers
from tracer.scene.checks import check_open, keeps_its_light
from tracer.scene.material import RGB
from tracer.scene.scene import Plain, Sky, Sun
from tracer.scene.view import View

MONTH = 29.53  # days from one full moon to the next
MOON = 1 / 300  # a full moon's light over the sun's: an eye that has adapted to the night takes it for as much
TINGE = (0.80, 0.93, 1.20)  # of moonlight, which such an eye sees bluer than it is
GLOW = (0.0001, 0.00014, 0.00022)  # radiance of a sky without sun and moon, for a sun of irradiance 1
DISC = 0.27  # degrees: the radius of sun and moon
SIZE = (256, 512)  # of the sky's picture
NIGHT = 0.13  # sine of the sun's elevation, 7.5 degrees, below which nothing is seen under water
LOWEST = -0.31  # sine of 18 degrees: further down the sun lights no part of the sky


@dataclass(frozen=True, kw_only=True)
class SunPath:
    """The circle on which sun and moon go round: up in the east (+x) at 6, down in the west at 18.

    Args:
        zenith: degrees by which the circle is turned about the east-west axis, so that the sun of noon stands that far
            from the zenith, toward -z: what it lights from straight above has no shadows to show its form.
        azimuth: degrees by which it is then turned about the vertical, so that walls that face along the axes have
            different light; from -z toward +x.

    Source: BetterRTX's sun path.
    """

    zenith: float = 30.0
    azimuth: float = 12.0

    def __post_init__(self) -> None:
        check_numbers(zenith=self.zenith, azimuth=self.azimuth)
        for name, most in (("zenith", 90.0), ("azimuth", 360.0)):
            if not abs(getattr(self, name)) <= most:
                raise ValueError(f"{name} must be -{most:g} to {most:g} degrees, got {getattr(self, name)}")

    def sun(self, hour: float) -> RGB:
        """Unit vector toward the sun at an hour."""
        angle = math.pi * (hour - 6.0) / 12.0
        return self.turned((math.cos(angle), math.sin(angle), 0.0))

    def moon(self, hour: float, day: float = 0.0) -> RGB:
        """Unit vector toward the moon: opposite the sun on day 0, when it is full, and later every day."""
        return self.sun(hour - 12.0 - 24.0 * (day / MONTH % 1.0))

    def turned(self, direction: RGB, *, inverse: bool = False) -> RGB:
        """A direction turned with the circle, or back: for what is drawn on the sky and goes round with it."""
        a, b = math.radians(self.zenith), math.radians(self.azimuth)
        tilt = np.array([[1, 0, 0], [0, math.cos(a), math.sin(a)], [0, -math.sin(a), math.cos(a)]])
        turn = np.array([[math.cos(b), 0, -math.sin(b)], [0, 1, 0], [math.sin(b), 0, math.cos(b)]])
        matrix = turn @ tilt
        return _rgb((matrix.T if inverse else matrix) @ np.asarray(direction))


class Lit(Protocol):
    """A dataclass with a sun and a sky: a `Scene`, or a `tracer.worlds.regions.stream.Stream`."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    @property
    def sun(self) -> Sun | None: ...
    @property
    def sky(self) -> Sky: ...
    @property
    def views(self) -> Mapping[str, View]: ...
    @property
    def device(self) -> torch.device | str: ...


L = TypeVar("L", bound=Lit)


def at_hour(
    scene: L,
    hour: float,
    *,
    day: float = 0.0,
    path: SunPath | None = None,
    atmosphere: Atmosphere | None = None,
) -> L:
    """A scene under the sky of an hour: blue by day, red where the sun is low, and moonlit by night.

    The scene's own sun says how much light noon has; the atmosphere does the rest. Nothing but sun and sky changes, so
    that lamps light the night; by night views that need the day come last. Sun and moon are the size that they are,
    and cast sharp shadows.

    Args:
        scene: any scene or stream; one without a sun gets the default one. For each of several hours, the one that
            they begin from: the sun of what comes back is that of its hour, and no noon's.
        hour: 0 to 24.
        day: days since a full moon: 14.8 is a night without moon.
        path: which way sun and moon go.
        atmosphere: what they shine through; Earth's by default.

    Returns:
        A scene or stream like it, under that sky. One without a day, as the Nether, comes back as it is.

    Raises:
        TypeError: it is no scene, or hour or day is no number.
        ValueError: another hour, or a day that is not finite.

    Warns:
        UserWarning: the scene has no day.
    """
    check_open(scene)
    check_numbers(hour=hour, day=day)
    for name, kind, given in (("path", SunPath, path), ("atmosphere", Atmosphere, atmosphere)):
        if given is not None:
            check_kind(kind, name, given)
    if not 0.0 <= hour <= 24.0:
        raise ValueError(f"hour must lie in 0..24, got {hour}")
    if not math.isfinite(day):
        raise ValueError(f"day must be finite, got {day}")
    if keeps_its_light(scene, "hours"):
        return scene
    path, air = path or SunPath(), atmosphere or Atmosphere()
    noon = scene.sun or Sun()
    brightness = sum(noon.irradiance) / max(_transmitted(air, path.sun(12.0)).sum(), 1e-3)
    above = np.full(3, brightness)  # white, before the air takes its share
    shape = (1 + math.cos(2 * math.pi * day / MONTH)) / 2  # the share of the moon that is lit
    bodies = (path.sun(hour), above), (path.moon(hour, day), above * (MOON * shape**1.5) * TINGE)
    plain = scene.sky.plain
    ground, water = plain or (None, 0.0)
    sky = _glow(torch.tensor(above * GLOW, dtype=torch.float32), plain)
    for toward, light in bodies:
        if toward[1] > LOWEST and light.any():
            sky = sky + sky_picture(air, toward, irradiance=light.tolist(), ground=ground, water=water, size=SIZE)
    arriving = [light * _transmitted(air, toward) for toward, light in bodies]
    shines = int(arriving[1].sum() > arriving[0].sum())
    sun = replace(noon, direction=bodies[shines][0], irradiance=_rgb(arriving[shines]), angular_radius=DISC)
    device = scene.device
    axes = [path.turned(axis, inverse=True) for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))]
    stars = (_about_z(hour) @ torch.tensor(axes).T).to(device)
    views, dark = scene.views, path.sun(hour)[1] < NIGHT
    views = dict(sorted(views.items(), key=lambda named: dark and named[1].by_day))
    return replace(scene, sun=sun, sky=Sky(plain=plain, picture=sky.to(device), stars=stars), views=views)


def _glow(radiance: torch.Tensor, plain: Plain | None) -> torch.Tensor:
    """A sky that is alike on all sides, over what lies below the horizon."""
    even = radiance.expand(*SIZE, 3)
    if plain is not None:
        up = ((torch.arange(SIZE[0] // 2) + 0.5) * (math.pi / SIZE[0])).sin()[:, None].expand(-1, SIZE[1])
        upper = even[: SIZE[0] // 2]
        even = torch.cat([upper, from_ground(up, upper, upper, torch.tensor(plain.albedo), plain.water)])
    return even.permute(2, 0, 1)[None]


def _about_z(hour: float) -> torch.Tensor:
    """``(3, 3)`` the turn of an hour about the axis of the circle before it is tilted."""
    angle = -2 * math.pi * hour / 24
    c, s = math.cos(angle), math.sin(angle)
    return torch.tensor([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _transmitted(air: Atmosphere, toward: RGB) -> np.ndarray:
    return sun_transmittance(air, toward).double().numpy()


def _rgb(values: object) -> RGB:
    r, g, b = (float(v) for v in np.asarray(values, np.float64))
    return r, g, b
