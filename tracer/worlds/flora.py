"""Trees, bushes, flowers, reeds and water lilies, and where they grow."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from tracer.worlds.canvas import Canvas

Rng = np.random.Generator


def _crown(canvas: Canvas, middle: Sequence[float], radii: Sequence[float], leaves: Sequence[str], rng: Rng) -> None:
    """A ragged ellipsoid of two leaf colours, the second toward the top."""
    low = [int(m - r - 1) for m, r in zip(middle, radii, strict=True)]
    high = [int(m + r + 2) for m, r in zip(middle, radii, strict=True)]
    part, (x, y, z) = canvas.grid(low, high)
    if part.size == 0:
        return
    dx, dy, dz = ((a - m) / r for a, m, r in zip((x, y, z), middle, radii, strict=True))
    ragged = rng.uniform(-0.22, 0.10, part.shape)
    inside = (dx * dx + dy * dy + dz * dz + ragged < 0.92) & (part == 0)
    light = dy + rng.uniform(-0.5, 0.5, part.shape) > 0.35
    part[inside] = np.where(light, canvas.id(leaves[1]), canvas.id(leaves[0]))[inside]


def round_tree(canvas: Canvas, x: int, y: int, z: int, rng: Rng, leaves: Sequence[str]) -> None:
    """A trunk two wide under a crown of several round clumps."""
    tall = int(rng.integers(5, 9))
    canvas.box((x, y, z), (x + 2, y + tall + 3, z + 2), "bark")
    r = rng.uniform(3.6, 4.8)
    _crown(canvas, (x + 1, y + tall + r * 0.9, z + 1), (r, r * 0.85, r), leaves, rng)
    for angle in rng.uniform(0, 6.28) + np.arange(3) * 2.1:
        at = (x + 1 + 2.6 * np.cos(angle), y + tall + rng.uniform(0.5, 3.0), z + 1 + 2.6 * np.sin(angle))
        _crown(canvas, at, (r * 0.66, r * 0.55, r * 0.66), leaves, rng)


def oak(canvas: Canvas, x: int, y: int, z: int, rng: Rng) -> None:
    """A green round tree."""
    round_tree(canvas, x, y, z, rng, ("leaf", "leaf_light"))


def maple(canvas: Canvas, x: int, y: int, z: int, rng: Rng) -> None:
    """A red or golden round tree."""
    round_tree(canvas, x, y, z, rng, ("leaf_red", "leaf_gold") if rng.random() < 0.6 else ("leaf_gold", "leaf_light"))


def cherry(canvas: Canvas, x: int, y: int, z: int, rng: Rng) -> None:
    """A leaning trunk under wide, flat clouds of blossom."""
    lean = rng.choice((-1, 1))
    for i in range(6):
        canvas.put(x + lean * (i // 3), y + i, z, "bark")
        canvas.put(x + lean * (i // 3), y + i, z + 1, "bark")
    top = (x + 2 * lean, y + 8, z + 1)
    _crown(canvas, top, (5.5, 2.6, 5.5), ("blossom", "blossom_light"), rng)
    _crown(canvas, (top[0] - 3 * lean, y + 6.5, z + 3), (3.8, 2.0, 3.4), ("blossom", "blossom_light"), rng)
    _crown(canvas, (top[0] + lean, y + 10, z), (3.4, 1.8, 3.4), ("blossom", "blossom_light"), rng)


def pine(canvas: Canvas, x: int, y: int, z: int, rng: Rng) -> None:
    """Stacked cones of needles."""
    tall = int(rng.integers(13, 21))
    canvas.box((x, y, z), (x + 1, y + tall - 1, z + 1), "bark")
    widest = tall * rng.uniform(0.21, 0.27)
    for i in range(3, tall + 2):
        share = 1.0 - (i - 3) / (tall - 1)
        r = max(widest * share * (0.72 + 0.38 * ((tall - i) % 4) / 3.0), 0.6)
        part, (px, _, pz) = canvas.grid((x - 6, y + i, z - 6), (x + 7, y + i + 1, z + 7))
        if part.size == 0:
            continue
        away = np.hypot(px - x - 0.5, pz - z - 0.5) + rng.uniform(-0.35, 0.35, part.shape)
        tips = away > r - 0.9
        mask = (away < r) & (part == 0)
        part[mask] = np.where(tips & (rng.random(part.shape) < 0.5), canvas.id("pine_light"), canvas.id("pine"))[mask]


def poplar(canvas: Canvas, x: int, y: int, z: int, rng: Rng) -> None:
    """A tall, slender crown."""
    tall = rng.uniform(8.0, 10.5)
    canvas.box((x, y, z), (x + 1, y + 5, z + 1), "bark")
    _crown(canvas, (x + 0.5, y + 2 + tall, z + 0.5), (2.3, tall, 2.3), ("leaf", "leaf_light"), rng)


def birch(canvas: Canvas, x: int, y: int, z: int, rng: Rng) -> None:
    """A thin pale trunk with small golden clumps."""
    tall = int(rng.integers(9, 13))
    for i in range(tall):
        canvas.put(x, y + i, z, "bark" if rng.random() < 0.16 else "birch_bark")
    for i in range(4):
        angle = rng.uniform(0, 6.28)
        at = (x + 0.5 + 1.8 * np.cos(angle), y + tall - 3 + 1.5 * i, z + 0.5 + 1.8 * np.sin(angle))
        _crown(canvas, at, (2.6 - 0.3 * i, 1.9, 2.6 - 0.3 * i), ("leaf_gold", "leaf_light"), rng)


def bush(canvas: Canvas, x: int, y: int, z: int, rng: Rng) -> None:
    """A low round clump."""
    r = rng.uniform(1.4, 2.4)
    leaves = (("leaf", "leaf_light"), ("pine", "leaf"), ("leaf_light", "flower_white"))[int(rng.integers(3))]
    _crown(canvas, (x + 0.5, y + 0.6, z + 0.5), (r, r * 0.8, r), leaves, rng)


Tree = Callable[[Canvas, int, int, int, Rng], None]


def forest(canvas: Canvas, top: NDArray[np.int64], free: NDArray[np.bool_], rng: Rng, *, cell: int = 8) -> None:
    """Plant a tree or bush in some cells of a jittered grid, each kind where it likes to grow.

    Args:
        canvas: where to plant.
        top: ``(X, Z)`` first layer of air above the ground.
        free: ``(X, Z)`` where trees may stand.
        rng: randomness.
        cell: voxels between trees.
    """
    for i in range(cell // 2, top.shape[0] - 4, cell):
        for k in range(cell // 2, top.shape[1] - 4, cell):
            x, z = i + int(rng.integers(-2, 3)), k + int(rng.integers(-2, 3))
            chance, kind = rng.random(), rng.random()
            y = int(top[x, z])
            if not free[x - 1 : x + 3, z - 1 : z + 3].all() or np.ptp(top[x - 1 : x + 3, z - 1 : z + 3]) > 1:
                continue
            wood = 0.5 + 0.5 * np.sin(x / 23.0 + 1.7) * np.sin(z / 19.0 + 0.6)
            high = y > 42
            if chance > (0.55 if high else 0.18 + 0.62 * wood):
                continue
            kinds: tuple[Tree, ...] = (pine, pine, pine, bush) if high else (oak, pine, maple, birch, poplar, bush, oak)
            kinds[int(kind * len(kinds))](canvas, x, y, z, rng)


def herbs(canvas: Canvas, top: NDArray[np.int64], free: NDArray[np.bool_], rng: Rng) -> None:
    """Scatter flowers and tufts on the turf, in drifts."""
    turf = np.isin(canvas.voxels[np.arange(top.shape[0])[:, None], top - 1, np.arange(top.shape[1])], _turf(canvas))
    x, z = np.indices(top.shape)
    drift = np.sin(x / 9.0 + 2 * np.sin(z / 21.0)) * np.sin(z / 11.0 + 1.3)
    grow = turf & free & (rng.random(top.shape) < 0.012 + 0.075 * (drift > 0.45))
    names = canvas.ids(("flower_white", "flower_yellow", "flower_violet", "leaf_light", "leaf_light"))
    colour = names[((x // 28 + z // 23) % 3 * (rng.random(top.shape) < 0.62) + 3 * (rng.random(top.shape) < 0.3)) % 5]
    for i, k in np.argwhere(grow):
        if canvas.voxels[i, top[i, k], k] == 0:
            canvas.voxels[i, top[i, k], k] = colour[i, k]


def reeds(canvas: Canvas, top: NDArray[np.int64], free: NDArray[np.bool_], water: int, rng: Rng) -> None:
    """Reeds in the shallows, lilies a little further out."""
    shallow = (top >= water - 2) & (top <= water) & free
    x, z = np.indices(top.shape)
    clump = np.sin(x / 6.0) + np.sin(z / 5.0 + 1.0) > 0.9
    for i, k in np.argwhere(shallow & clump & (rng.random(top.shape) < 0.20)):
        canvas.box((i, int(top[i, k]), k), (i + 1, water + int(rng.integers(1, 4)), k + 1), "reed")
    deeper = (top >= water - 5) & (top < water - 1) & free & (np.sin(x / 8.0 + 2.0) + np.sin(z / 7.0) > 1.2)
    for i, k in np.argwhere(deeper & (rng.random(top.shape) < 0.03)):
        canvas.put(i, water, k, "leaf_light")
        canvas.put(i + 1, water, k, "leaf")
        if rng.random() < 0.4:
            canvas.put(i, water + 1, k, "blossom_light")


def _turf(canvas: Canvas) -> NDArray[np.int16]:
    return canvas.ids(("grass", "meadow", "moss"))
