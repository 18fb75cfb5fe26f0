"""Where directions stand in the tables of an atmosphere: scales that are fine where light changes fast."""

from __future__ import annotations

import math

from torch import Tensor

SUN_RADIUS = 0.0047  # radians: the horizon takes the sun away over its disc
NEAR = 0.02  # cosines to the zenith are told apart best within this of the horizon
DUSK = 0.1  # as NEAR, for heights of the sun: by day light changes slowly
NIGHT = -0.35  # sine of the sun's height under which tables tell nothing apart: all is dark
DARKEST, BRIGHTEST = math.asinh(NIGHT / DUSK), math.asinh(1 / DUSK)
LONGEST = math.sqrt(1 + NEAR) - math.sqrt(NEAR)
AHEAD = 0.3  # as NEAR, for azimuths near the sun's: half of one minus their cosine


def sun_place(sun: Tensor) -> Tensor:
    """Place in tables, 0 to 1, of a cosine between sun and zenith."""
    return ((sun / DUSK).asinh() - DARKEST) / (BRIGHTEST - DARKEST)


def sun_at(place: Tensor) -> Tensor:
    """The reverse of `sun_place`."""
    return (DUSK * (DARKEST + place * (BRIGHTEST - DARKEST)).sinh()).clamp(-1.0, 1.0)


def rise_place(up: Tensor) -> Tensor:
    """Likewise of a cosine between a ray and the zenith."""
    return 0.5 + 0.5 * spread(up) / LONGEST


def rise_at(place: Tensor) -> Tensor:
    """The reverse of `rise_place`."""
    return gathered_in((2 * place - 1) * LONGEST).clamp(-1.0, 1.0)


def azimuth_place(cosine: Tensor) -> Tensor:
    """Likewise of the cosine of the angle between ray and sun round the zenith."""
    turn = 0.5 - 0.5 * cosine
    return turn * (1 + AHEAD) / (turn + AHEAD)


def azimuth_at(place: Tensor) -> Tensor:
    """The reverse of `azimuth_place`: the cosine."""
    return 1 - 2 * AHEAD * place / (1 + AHEAD - place)


def spread(cosine: Tensor) -> Tensor:
    """A cosine to the zenith on a scale that is finer near the horizon, where light changes fast."""
    return cosine.sign() * ((cosine.abs() + NEAR).sqrt() - NEAR**0.5)


def gathered_in(scale: Tensor) -> Tensor:
    """The reverse of `spread`."""
    return scale.sign() * ((scale.abs() + NEAR**0.5) ** 2 - NEAR)
