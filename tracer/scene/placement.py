"""Put a model on ground under the sky, and find cameras that frame it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tracer.scene.cells import Cells, Ids, blocks_of_world, cells_of_world, world_of_cells
from tracer.scene.material import Material, MaterialTable
from tracer.scene.scene import Instance, Plain, Scene, Sky, Sun
from tracer.scene.view import View
from tracer.scene.world import World

Vector = NDArray[np.float64]

GROUND = (
    Material(name="ground", albedo=(0.30, 0.275, 0.235), roughness=0.85, variation=0.05),
    Material(name="ground, darker", albedo=(0.265, 0.245, 0.21), roughness=0.85, variation=0.05),
)
SUN = Sun(direction=(-0.42, 0.62, 0.66), irradiance=(5.6, 4.7, 3.7))  # from the side of what `front` shows
PLAIN = Plain(GROUND[0].albedo)
SKY = Sky(zenith=(0.10, 0.24, 0.62), horizon=(0.42, 0.54, 0.74), ground=(0.37, 0.35, 0.33), plain=PLAIN)
FOV_Y = 38.0
ASPECT = 1.5  # the narrowest picture that shows all of the model
TILE = 8
MAX_REACH = 512
ABOVE = (0.62, 0.82, 1.0)  # toward the camera: so steep that the ground fills the picture to its top
CLOSE = 0.55  # of the distance that frames the whole model
WIDEST = 16 / 9  # the widest picture that shows no end of the ground
ROUNDS = 4  # of moving the middle of the picture to that of the model


def place(model: World, instances: tuple[Instance, ...] = (), *, margin: float = 2.0, thickness: int = 1) -> Scene:
    """A model on a plane of voxels under the sky.

    Args:
        model: what to place; it keeps its coordinates.
        instances: what stands in the same place, neither turned nor shifted, and is framed with it; a whole number of
            its voxels lies along one of the model's.
        margin: least ground round the model, in units of its longest side along the ground; there is as much more as
            the views from above show.
        thickness: voxels of ground.

    Returns:
        A scene with the views ``front`` (from three quarters above), ``orbit`` (once round in 24 s) and ``detail``.

    Raises:
        ValueError: the model is empty, or margin or thickness are out of range.
    """
    if not margin >= 0 or thickness < 1:
        raise ValueError(f"margin must not be negative and thickness at least 1, got {margin} and {thickness}")
    cells, ids = cells_of_world(model)
    filled = np.concatenate([cells, *(blocks_of_world(shapes.model, round(1 / shapes.scale)) for shapes in instances)])
    if len(filled) == 0:
        raise ValueError("model must hold at least one voxel, got an empty world")
    low, high = filled.min(axis=0), filled.max(axis=0) + 1
    side = int(max(high[0] - low[0], high[2] - low[2]))
    views = framing_views(_outline(filled))
    shown = max(_shown(views[name], float(low[1])) for name in ("front", "orbit"))
    reach = min(max(round(margin * side), math.ceil(shown), 8 * TILE), MAX_REACH)
    ground, tone = _ground(low, high, reach, thickness)
    materials = _joined(model.materials, MaterialTable.of(GROUND))
    both = np.concatenate([ground, cells])
    world = world_of_cells(both, np.concatenate([tone + len(model.materials), ids]).astype(np.int16), materials)
    return Scene(world=world, instances=instances, sun=SUN, sky=SKY, views=views)


def framing_views(points: Vector) -> dict[str, View]:
    """Views that frame points ``(N, 3)``, world."""
    low, high = points.min(axis=0), points.max(axis=0)
    middle, around = (low + high) / 2, _unit(ABOVE)
    far = max(_distance(_turned(around, a), points - middle) for a in np.linspace(0, 2 * math.pi, 16, endpoint=False))

    def circle(time: float) -> tuple[float, float, float]:
        return _tuple(middle + far * _turned(around, 2 * math.pi * time / 24.0))

    front, aim = map(_tuple, _framed(around, points, middle))
    low_angle, target = _unit((0.75, 0.32, 1.0)), _tuple(middle)
    outside = 1.1 * float(np.min((high - low) / 2 / np.abs(low_angle))) + 1.0
    near = _tuple(middle + max(CLOSE * _distance(low_angle, points - middle), outside) * low_angle)
    return {
        "front": View(eye=lambda _: front, target=lambda _: aim, fov_y=FOV_Y, description="three quarters, above"),
        "orbit": View(eye=circle, target=lambda _: target, fov_y=FOV_Y, description="round the model, 24 s"),
        "detail": View(eye=lambda _: near, target=lambda _: target, fov_y=46.0, description="close, from low"),
    }


def _shown(view: View, ground: float) -> float:
    """How far from the target the upper corners of a view's picture see the ground at this height."""
    eye, target = np.array(view.eye(0.0)), np.array(view.target(0.0))
    forward, slope = _unit(target - eye), math.tan(math.radians(view.fov_y) / 2)
    right, up = _across(-forward)
    ray = forward + slope * (up + WIDEST * right)
    return float(np.linalg.norm((eye + ray * (ground - eye[1]) / ray[1] - target)[[0, 2]]))


def _outline(cells: Cells) -> Vector:
    """``(N, 3)`` corners of the lowest and the highest voxel of every column: enough to frame all."""
    order = cells[np.lexsort(cells.T[[1, 2, 0]])]  # by x and z, then upward
    change = np.any(np.diff(order[:, [0, 2]], axis=0) != 0, axis=1)
    ends = order[np.append(True, change) | np.append(change, True)]
    corners = np.array(list(np.ndindex(2, 2, 2)))
    return (ends[:, None] + corners).reshape(-1, 3).astype(np.float64)


def _framed(toward: Vector, points: Vector, target: Vector) -> tuple[Vector, Vector]:
    """Eye and target that show all points, and as much of the picture beside them on either side."""
    right, up = _across(toward)
    for _ in range(ROUNDS):
        distance = _distance(toward, points - target)
        offset = points - target
        near = distance - offset @ toward
        for axis in (right, up):
            seen = offset @ axis / near
            target = target + axis * (distance * (seen.min() + seen.max()) / 2)
    return target + _distance(toward, points - target) * toward, target


def _distance(toward: Vector, offset: Vector) -> float:
    """Distance from a target at which a camera of `ASPECT` and `FOV_Y` shows all points at these offsets from it."""
    (right, up), slope = _across(toward), math.tan(math.radians(FOV_Y) / 2)
    across, along = np.abs(offset @ right) / (slope * ASPECT), np.abs(offset @ up) / slope
    return float(np.max(np.maximum(across, along) + offset @ toward)) * 1.06 + 1.0


def _across(toward: Vector) -> tuple[Vector, Vector]:
    """The picture's right and up."""
    right = _unit(np.cross(-toward, (0.0, 1.0, 0.0)))
    return right, np.cross(right, -toward)


def _ground(low: Cells, high: Cells, reach: int, thickness: int) -> tuple[Cells, Ids]:
    """Coordinates and tone (0 or 1, in a chequer of tiles) of the ground under a box."""
    x = np.arange(low[0] - reach, high[0] + reach)
    z = np.arange(low[2] - reach, high[2] + reach)
    y = np.arange(low[1] - thickness, low[1])
    cells = np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1).reshape(-1, 3)
    return cells, ((cells[:, 0] // TILE + cells[:, 2] // TILE) % 2).astype(np.int16)


def _joined(first: MaterialTable, second: MaterialTable) -> MaterialTable:
    """Two tables in one: the second's rows are renamed where a name is taken."""
    names = [name if name not in first.names else f"{name} of placement" for name in second.names[1:]]
    return MaterialTable.joined([first.to("cpu"), second], (*first.names, *names))


def _turned(v: Vector, angle: float) -> Vector:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([c * v[0] + s * v[2], v[1], c * v[2] - s * v[0]])


def _unit(v: Vector | tuple[float, float, float]) -> Vector:
    v = np.asarray(v, np.float64)
    return v / np.linalg.norm(v)


def _tuple(v: Vector) -> tuple[float, float, float]:
    return float(v[0]), float(v[1]), float(v[2])
