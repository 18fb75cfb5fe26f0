"""Put a model on ground under the sky, and find cameras that frame it."""

from __future__ import annotations

import math

import numpy as np
import torch
from numpy.typing import NDArray

from tracer.scene.cells import Cells, Ids, cells_of_world, world_of_cells
from tracer.scene.material import Material, MaterialTable
from tracer.scene.scene import Scene, Sky, Sun, View
from tracer.scene.world import World

Vector = NDArray[np.float64]

GROUND = (
    Material(name="ground", albedo=(0.50, 0.46, 0.39), roughness=0.85, variation=0.05),
    Material(name="ground, darker", albedo=(0.45, 0.415, 0.355), roughness=0.85, variation=0.05),
)
SUN = Sun(direction=(-0.42, 0.55, 0.72), irradiance=(4.4, 3.7, 2.9))  # from the side of what `front` shows
SKY = Sky(zenith=(0.10, 0.26, 0.70), horizon=(0.62, 0.74, 0.92), ground=(0.60, 0.62, 0.64))
FOV_Y = 38.0
ASPECT = 1.5  # the narrowest picture that shows all of the model
TILE = 8
MAX_REACH = 384
CLOSE = 0.55  # of the distance that frames the whole model


def place(model: World, *, margin: float = 2.0, thickness: int = 1) -> Scene:
    """A model on a plane of voxels under the sky.

    Args:
        model: what to place; it keeps its coordinates.
        margin: ground round the model, in units of its longest side along the ground.
        thickness: voxels of ground.

    Returns:
        A scene with the views ``front`` (from three quarters above), ``orbit`` (once round in 24 s) and ``detail``.

    Raises:
        ValueError: the model is empty, or margin or thickness are out of range.
    """
    if not margin >= 0 or thickness < 1:
        raise ValueError(f"margin must not be negative and thickness at least 1, got {margin} and {thickness}")
    cells, ids = cells_of_world(model)
    if len(cells) == 0:
        raise ValueError("model must hold at least one voxel, got an empty world")
    low, high = cells.min(axis=0), cells.max(axis=0) + 1
    side = int(max(high[0] - low[0], high[2] - low[2]))
    reach = min(max(round(margin * side), 8 * TILE), MAX_REACH)
    ground, tone = _ground(low, high, reach, thickness)
    materials = _joined(model.materials, MaterialTable.of(GROUND))
    both = np.concatenate([ground, cells])
    world = world_of_cells(both, np.concatenate([tone + len(model.materials), ids]).astype(np.int16), materials)
    return Scene(world=world, sun=SUN, sky=SKY, views=framing_views(low.astype(float), high.astype(float)))


def framing_views(low: Vector, high: Vector) -> dict[str, View]:
    """Views that frame a box.

    Args:
        low: ``(3,)`` low corner, world.
        high: ``(3,)`` high corner, world.
    """
    middle = (low + high) / 2
    around = _unit((0.62, 0.40, 1.0))
    far = max(_distance(_turned(around, a), low, high) for a in np.linspace(0, 2 * math.pi, 16, endpoint=False))

    def circle(time: float) -> tuple[float, float, float]:
        return _tuple(middle + far * _turned(around, 2 * math.pi * time / 24.0))

    front = _tuple(middle + _distance(around, low, high) * around)
    low_angle = _unit((0.75, 0.32, 1.0))
    outside = 1.1 * float(np.min((high - low) / 2 / np.abs(low_angle))) + 1.0
    near = _tuple(middle + max(CLOSE * _distance(low_angle, low, high), outside) * low_angle)
    target = _tuple(middle)
    return {
        "front": View(eye=lambda _: front, target=lambda _: target, fov_y=FOV_Y, description="three quarters, above"),
        "orbit": View(eye=circle, target=lambda _: target, fov_y=FOV_Y, description="round the model, 24 s"),
        "detail": View(eye=lambda _: near, target=lambda _: target, fov_y=46.0, description="close, from low"),
    }


def _distance(toward: Vector, low: Vector, high: Vector) -> float:
    """Distance from a box's middle at which a camera of `ASPECT` and `FOV_Y` shows all corners."""
    forward = -toward
    right = _unit(np.cross(forward, (0.0, 1.0, 0.0)))
    up = np.cross(right, forward)
    corners = np.array([[(low, high)[i][0], (low, high)[j][1], (low, high)[k][2]] for i, j, k in np.ndindex(2, 2, 2)])
    offset = corners - (low + high) / 2
    slope = math.tan(math.radians(FOV_Y) / 2)
    across = np.abs(offset @ right) / (slope * ASPECT)
    along = np.abs(offset @ up) / slope
    return float(np.max(np.maximum(across, along) - offset @ forward)) * 1.06 + 1.0


def _ground(low: Cells, high: Cells, reach: int, thickness: int) -> tuple[Cells, Ids]:
    """Coordinates and tone (0 or 1, in a chequer of tiles) of the ground under a box."""
    x = np.arange(low[0] - reach, high[0] + reach)
    z = np.arange(low[2] - reach, high[2] + reach)
    y = np.arange(low[1] - thickness, low[1])
    cells = np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1).reshape(-1, 3)
    return cells, ((cells[:, 0] // TILE + cells[:, 2] // TILE) % 2).astype(np.int16)


def _joined(first: MaterialTable, second: MaterialTable) -> MaterialTable:
    """Two tables in one: the second's rows follow without its air, and are renamed where a name is taken."""
    columns = {
        key: torch.cat([getattr(first, key).cpu(), getattr(second, key)[1:]])
        for key in ("albedo", "roughness", "metallic", "emission", "opacity", "tint", "variation")
    }
    names = [name if name not in first.names else f"{name} of placement" for name in second.names[1:]]
    return MaterialTable(names=(*first.names, *names), **columns)


def _turned(v: Vector, angle: float) -> Vector:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([c * v[0] + s * v[2], v[1], c * v[2] - s * v[0]])


def _unit(v: Vector | tuple[float, float, float]) -> Vector:
    v = np.asarray(v, np.float64)
    return v / np.linalg.norm(v)


def _tuple(v: Vector) -> tuple[float, float, float]:
    return float(v[0]), float(v[1]), float(v[2])
