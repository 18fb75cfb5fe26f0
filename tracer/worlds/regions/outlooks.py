"""Views over land, found on a map of its heights: from where most is to be seen, and ways over and round it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tracer.scene.placement import framing_views
from tracer.scene.scene import Sun
from tracer.scene.view import View
from tracer.worlds.regions.height_map import HeightMap
from tracer.worlds.views import loop, round_trip, still

Floats = NDArray[np.float64]
Point = tuple[float, float, float]

SUN = Sun(direction=(-0.62, 0.60, 0.50), irradiance=(4.2, 3.7, 3.0))
HEADROOM = 3.0  # between eye and roof, blocks
FOV_Y = 55.0
PLACES, TURNS = 7, 10  # tried along each side of the map, and round the compass
RISES = (6.0, 18.0)  # above the highest ground near by, blocks
DIPS = (10.0, 20.0)  # below the horizon, degrees
RAYS = (16, 9)
STEPS = 1.6 * 1.09 ** np.arange(64)  # along a ray; the last one lies 365 blocks away
CLEAR = 14.0  # nothing is to be nearer than that, blocks
EMPTY = -1.5  # score below which a picture shows more of nothing than of land
SKY_SHARE = 0.30  # of a picture, as painters do
FLIGHT, ROUND = 48.0, 36.0  # seconds
KNOTS = 10  # of the flight's curve


def views_over(ground: HeightMap, widest: float = math.inf) -> dict[str, View]:
    """The views ``landscape``, ``orbit`` and ``flight``; ``orbit`` goes round no more than the ``widest`` half side."""
    return {"landscape": best_view(ground), "orbit": _orbit(ground, widest), "flight": _flight(ground)}


def best_view(ground: HeightMap) -> View:
    """The eye and direction that show most: many materials, far and near, some sky, and nothing before the lens.

    Where there is so little that each of them shows more of nothing, what there is, framed from above.
    """
    eyes, directions = _candidates(ground)
    scores = np.concatenate([_scores(ground, e, d) for e, d in zip(_split(eyes), _split(directions), strict=True)])
    best = int(np.argmax(scores))
    if scores[best] < EMPTY:
        return framing_views(ground.surface())["front"]
    eye, target = eyes[best], eyes[best] + 40.0 * directions[best]
    return still(_point(eye), _point(target), fov_y=FOV_Y, description="over the land, from where most is to be seen")


def _split(rows: Floats) -> list[Floats]:
    return np.array_split(rows, max(1, len(rows) // 256))


def _candidates(ground: HeightMap) -> tuple[Floats, Floats]:
    """``(N, 3)`` eyes over the land and ``(N, 3)`` unit directions."""
    x, z = np.nonzero(np.isfinite(ground.top))
    spots = np.stack(
        [
            g.reshape(-1)
            for g in np.meshgrid(*(np.linspace(a.min(), a.max(), PLACES + 2)[1:-1].round().astype(int) for a in (x, z)))
        ],
        axis=1,
    )
    spots = spots[np.isfinite(ground.top[spots[:, 0], spots[:, 1]])]
    if not len(spots):
        spots = np.array([[x[0], z[0]]])
    highest = np.array([ground.highest(i, j, 10) for i, j in spots])
    roof = np.array([ground.lowest_roof(i, j, 3) for i, j in spots])
    eyes = [
        np.stack([spots[:, 0] + ground.x0 + 0.5, highest + rise, spots[:, 1] + ground.z0 + 0.5], 1) for rise in RISES
    ]
    below = [eye[eye[:, 1] + HEADROOM < roof] for eye in eyes]
    eyes = below if sum(map(len, below)) else eyes
    angles = [(2 * math.pi * (n + 0.5) / TURNS, math.radians(dip)) for n in range(TURNS) for dip in DIPS]
    ways = [(math.cos(b) * math.cos(a), -math.sin(b), math.cos(b) * math.sin(a)) for a, b in angles]
    flat = np.concatenate(eyes)
    return flat.repeat(len(ways), axis=0), np.tile(np.array(ways), (len(flat), 1))


def _scores(ground: HeightMap, eyes: Floats, directions: Floats) -> Floats:
    """How good each picture is, from a few rays over the map of heights."""
    right = np.cross(directions, (0.0, 1.0, 0.0))
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    up = np.cross(right, directions)
    slope = math.tan(math.radians(FOV_Y / 2))
    across, down = (np.linspace(-1 + 1 / n, 1 - 1 / n, n) for n in RAYS)
    u, v = (g.reshape(-1) * slope for g in np.meshgrid(across * 16 / 9, -down))
    rays = directions[:, None] + u[:, None] * right[:, None] + v[:, None] * up[:, None]
    points = eyes[:, None, None] + rays[:, :, None] * STEPS[:, None]  # (N, R, T, 3)
    filled, kind = ground.at(points[..., 0], points[..., 1], points[..., 2])
    first = filled.argmax(axis=2)
    hit: NDArray[np.bool_] = np.any(filled, axis=2)
    seen = np.where(hit, np.take_along_axis(kind, first[..., None], axis=2)[..., 0], 0)
    far = np.where(hit, STEPS[first], STEPS[-1])
    lost = ~hit & (rays[..., 1] < -0.02)  # looks past the end of the land
    variety = np.array([_entropy(row[row > 0]) for row in seen])
    depth = np.where(hit, np.log(far), np.nan)
    spread = np.nan_to_num(np.nanstd(np.where(hit.any(axis=1, keepdims=True), depth, 0.0), axis=1))
    sky = (~hit & ~lost).mean(axis=1)
    sun = np.asarray(SUN.direction) / np.linalg.norm(SUN.direction)
    return (
        variety
        + 0.8 * spread
        - 2.0 * np.abs(sky - SKY_SHARE)
        - 5.0 * lost.mean(axis=1)
        - 6.0 * (far < CLEAR).mean(axis=1)
        - 0.3 * directions @ sun
    )


def _entropy(kinds: NDArray[np.int64]) -> float:
    """Of what is seen, in nats: how much there is to tell apart."""
    share = np.unique(kinds, return_counts=True)[1] / max(len(kinds), 1)
    return float(-(share * np.log(share)).sum())


def _extent(ground: HeightMap) -> tuple[Point, tuple[float, float]]:
    """Middle of the land, at its mean height, and half its sides along x and z."""
    x, z = np.nonzero(np.isfinite(ground.top))
    middle = (ground.x0 + x.mean() + 0.5, float(ground.top[x, z].mean()), ground.z0 + z.mean() + 0.5)
    return middle, (float(np.ptp(x) + 1) / 2, float(np.ptp(z) + 1) / 2)


def _orbit(ground: HeightMap, widest: float) -> View:
    (x, y, z), sides = _extent(ground)
    half = min(max(sides), widest)
    over = 0.0 if half == max(sides) else float(ground.top.max()) + CLEAR - y  # the land, where it is over that
    eye = round_trip((x, y, z), 1.5 * half + 4.0, max(0.95 * half + 8.0, over), ROUND)
    return View(eye=eye, target=lambda _: (x, y, z), fov_y=50.0, description="round the land, 36 s")


def panorama(view: View) -> View:
    """Once round on the spot."""
    eye, target = (np.array(place(0.0)) for place in (view.eye, view.target))
    ahead = target - eye

    def around(time: float) -> Point:
        angle = 2 * math.pi * time / ROUND
        c, s = math.cos(angle), math.sin(angle)
        return _point(eye + np.array([c * ahead[0] - s * ahead[2], ahead[1], s * ahead[0] + c * ahead[2]]))

    return View(eye=view.eye, target=around, fov_y=view.fov_y, description="once round on the spot, 36 s")


def _flight(ground: HeightMap) -> View:
    """A round over the land, over the highest that is within reach of the curve between two of its points.

    It is as long and as wide as the land, so that it stays over it, and begins where most is to be seen.
    """
    (x, y, z), (across, along) = _extent(ground)
    turn = 2 * math.pi / KNOTS
    reach = round(0.62 * max(across, along) * turn) + 2

    def place(share: float, angle: float) -> tuple[float, float]:
        return x + share * across * math.cos(angle), z + share * along * math.sin(angle)

    eyes, targets = list[Point](), list[Point]()
    for n in range(KNOTS):
        (px, pz), (tx, tz) = place(0.62, n * turn), place(0.45, n * turn + 1.5)
        high = ground.highest(max(round(px) - ground.x0, 0), max(round(pz) - ground.z0, 0), reach)
        eyes.append((px, max(high, y) + 9.0 if math.isfinite(high) else y + 12.0, pz))
        targets.append((tx, y + 2.0, tz))
    ways = np.array(targets) - np.array(eyes)
    first = int(np.argmax(_scores(ground, np.array(eyes), ways / np.linalg.norm(ways, axis=1, keepdims=True))))
    eye, target = (loop(points[first:] + points[:first], FLIGHT) for points in (eyes, targets))
    return View(eye=eye, target=target, fov_y=60.0, description="a round over the land, 48 s")


def _point(v: Floats) -> Point:
    return float(v[0]), float(v[1]), float(v[2])
