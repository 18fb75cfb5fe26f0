"""Viewpoints on the valley, and camera paths through it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from tracer.scene.view import View

Point = tuple[float, float, float]
TAU = 2.0 * math.pi


def still(eye: Point, target: Point, *, fov_y: float, description: str, by_day: bool = False) -> View:
    """A view that never moves."""
    return View(eye=lambda _: eye, target=lambda _: target, fov_y=fov_y, description=description, by_day=by_day)


def loop(points: Sequence[Point], seconds: float) -> Callable[[float], Point]:
    """A smooth closed curve through ``points``, once round in ``seconds`` (a uniform Catmull-Rom spline)."""
    knots = np.asarray(points, np.float64)

    def at(time: float) -> Point:
        s = time / seconds % 1.0 * len(knots)
        i, t = int(s), s - int(s)
        a, b, c, d = (knots[(i + k) % len(knots)] for k in (-1, 0, 1, 2))
        p = b + 0.5 * t * (c - a + t * (2 * a - 5 * b + 4 * c - d + t * (3 * (b - c) + d - a)))
        return float(p[0]), float(p[1]), float(p[2])

    return at


def round_trip(middle: Point, radius: float, height: float, seconds: float) -> Callable[[float], Point]:
    """A circle at ``height`` above ``middle``, once round in ``seconds``."""

    def at(time: float) -> Point:
        angle = TAU * time / seconds + 0.75 * math.pi
        return middle[0] + radius * math.cos(angle), middle[1] + height, middle[2] + radius * math.sin(angle)

    return at


FLIGHT_EYE: tuple[Point, ...] = (
    (70.0, 36.0, 206.0),
    (98.0, 31.0, 168.0),
    (122.0, 36.0, 130.0),
    (152.0, 43.0, 127.0),
    (180.0, 44.0, 138.0),
    (224.0, 58.0, 170.0),
    (196.0, 60.0, 214.0),
    (128.0, 55.0, 222.0),
)
FLIGHT_TARGET: tuple[Point, ...] = (
    (150.0, 34.0, 125.0),
    (108.0, 36.0, 62.0),
    (150.0, 34.0, 66.0),
    (186.0, 33.0, 112.0),
    (186.0, 36.0, 90.0),
    (186.0, 32.0, 116.0),
    (120.0, 32.0, 130.0),
    (60.0, 44.0, 120.0),
)


def views() -> dict[str, View]:
    """The valley's views by name; the first is the default."""
    return {
        "village": still(
            (77.0, 37.0, 204.0), (148.0, 38.0, 118.0), fov_y=44.0, description="across the lake to the village"
        ),
        "lake": still((128.0, 27.5, 184.0), (104.0, 35.0, 92.0), fov_y=54.0, description="from the water to the fall"),
        "cave": still((113.0, 34.5, 35.0), (140.0, 31.5, 28.5), fov_y=62.0, description="the mine, lit by lamps"),
        "plaza": still(
            (183.5, 33.0, 138.8), (187.5, 33.5, 108.0), fov_y=56.0, description="polished stone, the walker"
        ),
        "hall": still((201.0, 36.0, 88.5), (176.0, 34.8, 85.0), fov_y=58.0, description="coloured walls, shiny floor"),
        "horizon": still((236.0, 70.0, 226.0), (112.0, 27.0, 84.0), fov_y=44.0, description="the whole valley"),
        "closeup": still((162.6, 31.0, 123.2), (169.5, 30.7, 127.2), fov_y=52.0, description="market stall, lantern"),
        "mill": still((70.0, 47.0, 132.0), (46.0, 57.0, 113.0), fov_y=58.0, description="the windmill"),
        "flythrough": View(
            eye=loop(FLIGHT_EYE, 40.0),
            target=loop(FLIGHT_TARGET, 40.0),
            fov_y=58.0,
            description="a flight through the valley, 40 s",
        ),
        "orbit": View(
            eye=round_trip((160.0, 30.0, 132.0), 70.0, 42.0, 36.0),
            target=lambda _: (172.0, 30.0, 122.0),
            fov_y=52.0,
            description="round the village, 36 s",
        ),
    }
