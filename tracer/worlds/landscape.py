"""Scenes of landscapes from files: views that look over the ground, found on a map of its heights."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import torch
from numpy.typing import NDArray

from tracer.scene.material import MaterialTable
from tracer.scene.placement import framing_views
from tracer.scene.scene import Haze, Instance, Plain, Scene, Sky, Sun, View
from tracer.scene.world import World
from tracer.worlds.height_map import HeightMap, caverns_of, heights_of, raise_to
from tracer.worlds.sea import ends_of, in_open_sea, shore_of
from tracer.worlds.views import loop, round_trip, still

Floats = NDArray[np.float64]
Point = tuple[float, float, float]

SUN = Sun(direction=(-0.62, 0.60, 0.50), irradiance=(4.2, 3.7, 3.0))
MEADOW = Plain((0.17, 0.21, 0.10))  # where the border is not known
SKY = Sky(zenith=(0.13, 0.32, 0.82), horizon=(0.62, 0.76, 0.96), ground=(0.52, 0.60, 0.68), plain=MEADOW)
EMBERS = Sky(zenith=(0.045, 0.009, 0.0055), horizon=(0.08, 0.015, 0.009), ground=(0.045, 0.009, 0.0055))
SMOKE = Haze(begin=40.0, end=192.0)
NIGHT, GLOW = (0.0018, 0.0011, 0.0025), (0.05, 0.044, 0.056)  # of the End: what is round it, and light from overhead
OVERHEAD = 0.4  # sine of the elevation at which that light begins, where few pictures show it
ENDLESS = 0.5  # of the land is end stone, where it floats in the End
ROOFED = 0.9  # of the land lies under a roof of bedrock, where all of it does
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


def landscape(world: World, instances: tuple[Instance, ...] = ()) -> Scene:
    """A scene of a piece of land under the sky.

    Args:
        world: the land. Where the file ends it goes on as the sea if it has a coast there, see
            `tracer.worlds.sea.shore_of`; else there is empty space, and below the horizon a plain of the border's mean
            colour. What lies under a roof of bedrock, as the
            Nether does, has smoke lit by embers in place of sun and sky. What is of end stone has a night lit from
            overhead.
        instances: what else there is.

    Returns:
        A scene with the views ``landscape`` (over the ground, from where most is to be seen), ``orbit`` (once round in
        36 s) and ``flight`` (a round over the land, 48 s); under a roof ``landscape`` and ``panorama`` (once round on
        the spot, 36 s).
    """
    ground = heights_of(world)
    if _topped(ground, world.materials, "bedrock") > ROOFED and np.isfinite((caverns := caverns_of(world)).top).any():
        view = _best(caverns)
        views = {"landscape": view, "panorama": _panorama(view)}
        return Scene(world=world, instances=instances, sun=None, sky=EMBERS, haze=SMOKE, views=views)
    for instance in instances:
        raise_to(ground, instance)
    if instances and not np.isfinite(ground.top).any():  # nothing but plants and the like
        ends = [np.array(instance.model.bounds()) * instance.scale for instance in instances]
        points = np.array([[end[i, 0], end[j, 1], end[k, 2]] for end in ends for i, j, k in np.ndindex(2, 2, 2)])
        return Scene(world=world, instances=instances, sun=SUN, sky=SKY, views=framing_views(points))
    shore = shore_of(ground.top, ground.kind, world.materials.water.cpu().numpy())
    if shore is not None:
        ground, world = replace(ground, beyond=(shore.level, shore.water)), in_open_sea(world, shore)
    views = {"landscape": _best(ground), "orbit": _orbit(ground), "flight": _flight(ground)}
    if _topped(ground, world.materials, "end_stone") > ENDLESS:
        return Scene(world=world, instances=instances, sun=None, sky=Sky(picture=_night()), views=views)
    sky = replace(SKY, plain=_plain(ground, world.materials))
    return Scene(world=world, instances=instances, sun=SUN, sky=sky, views=views)


def _topped(ground: HeightMap, materials: MaterialTable, name: str) -> float:
    """The share of the land that has a material on top."""
    of_it = np.array([material.startswith(name) for material in materials.names])
    on_top = of_it[ground.kind[np.isfinite(ground.top)]]
    return float(on_top.mean()) if on_top.size else 0.0


def _night() -> torch.Tensor:
    """``(1, 3, 64, 128)`` the sky of the End: dark all round, with light from overhead, as it has no sun."""
    up = torch.cos((torch.arange(64) + 0.5) / 64 * math.pi)
    share = ((up - OVERHEAD) / (1 - OVERHEAD)).clamp(0, 1).square()
    return torch.lerp(torch.tensor(NIGHT)[:, None], torch.tensor(GLOW)[:, None], share)[None, :, :, None].repeat(
        1, 1, 1, 128
    )


def _plain(ground: HeightMap, materials: MaterialTable) -> Plain:
    """What land goes on as: the sea, or the mean of its border."""
    if math.isfinite(ground.beyond[0]):
        return Plain(MEADOW.albedo, 1.0)
    kinds = torch.from_numpy(ground.kind[ends_of(np.isfinite(ground.top))])
    albedo, water = materials.albedo.cpu()[kinds], materials.water.cpu()[kinds]
    r, g, b = albedo[~water].mean(dim=0).tolist() if not water.all() else MEADOW.albedo
    return Plain((r, g, b), float(water.float().mean()))


def _best(ground: HeightMap) -> View:
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


def _extent(ground: HeightMap) -> tuple[Point, float]:
    """Middle of the land, at its mean height, and half its longer side."""
    x, z = np.nonzero(np.isfinite(ground.top))
    middle = (ground.x0 + x.mean() + 0.5, float(ground.top[x, z].mean()), ground.z0 + z.mean() + 0.5)
    return middle, float(max(np.ptp(x), np.ptp(z)) + 1) / 2


def _orbit(ground: HeightMap) -> View:
    (x, y, z), half = _extent(ground)
    eye = round_trip((x, y, z), 1.5 * half + 4.0, 0.95 * half + 8.0, ROUND)
    return View(eye=eye, target=lambda _: (x, y, z), fov_y=50.0, description="round the land, 36 s")


def _panorama(view: View) -> View:
    """Once round on the spot."""
    eye, target = (np.array(place(0.0)) for place in (view.eye, view.target))
    ahead = target - eye

    def around(time: float) -> Point:
        angle = 2 * math.pi * time / ROUND
        c, s = math.cos(angle), math.sin(angle)
        return _point(eye + np.array([c * ahead[0] - s * ahead[2], ahead[1], s * ahead[0] + c * ahead[2]]))

    return View(eye=view.eye, target=around, fov_y=view.fov_y, description="once round on the spot, 36 s")


def _flight(ground: HeightMap) -> View:
    """A round over the land, over the highest that is within reach of the curve between two of its points."""
    (x, y, z), half = _extent(ground)
    eyes, targets = list[Point](), list[Point]()
    count = 10
    for n in range(count):
        angle = 2 * math.pi * n / count
        px, pz = x + 0.62 * half * math.cos(angle), z + 0.62 * half * math.sin(angle)
        reach = round(0.62 * half * 2 * math.pi / count) + 2
        high = ground.highest(max(round(px) - ground.x0, 0), max(round(pz) - ground.z0, 0), reach) if half else y
        eyes.append((px, max(high, y) + 9.0 if math.isfinite(high) else y + 12.0, pz))
        ahead = angle + 1.5
        targets.append((x + 0.45 * half * math.cos(ahead), y + 2.0, z + 0.45 * half * math.sin(ahead)))
    return View(
        eye=loop(eyes, FLIGHT), target=loop(targets, FLIGHT), fov_y=60.0, description="a round over the land, 48 s"
    )


def _point(v: Floats) -> Point:
    return float(v[0]), float(v[1]), float(v[2])
