"""A scene as the flat arrays that compiled paths read."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from gbufrt.compute.kernel import array
from tracer.lights import sky
from tracer.lights.kernel import DISC, GLOW, TOWARD
from tracer.lights.lamp_table import LampTable
from tracer.lights.samples import Lights
from tracer.lights.sky_table import SkyTable
from tracer.paths.interaction import Vertices
from tracer.paths.on_screen import Picture
from tracer.scene.material import MaterialTable
from tracer.scene.scene import Scene
from tracer.scene.textures import Textures
from tracer.traversal.rays import grid_from_world

COLUMNS = {
    "points": 3,
    "normals": 3,
    "toward": 3,
    "albedo": 3,
    "roughness": 1,
    "metallic": 1,
    "opacity": 1,
    "emission": 3,
    "inside": 1,
    "instances": 1,
}
"""Of `Vertices`, side by side, as `tracer.paths.interaction_kernel.surface_of` reads them."""


def arrays_of(scene: Scene, poses: Tensor, lights: Lights | None = None) -> tuple[np.ndarray, ...]:
    """The arrays that `interaction_kernel.assembled` takes: the scene at ``poses``, with its lights where wanted."""
    materials, texels = _materials(scene.materials)
    return (
        array(grid_from_world(scene, poses, poses.device)[0]),
        *(array(grid) for grid in scene.grids.tensors),
        materials,
        texels,
        _picture(scene),
        _sky(scene),
        *_lamps(None if lights is None else lights.lamps),
        *_sky_table(None if lights is None else lights.sky),
    )


def _materials(table: MaterialTable) -> tuple[np.ndarray, np.ndarray]:
    """See `interaction_kernel.Tables`: a face without a texture shows the one texel that is its material."""
    textures, flat = table.textures or Textures.none(len(table), table.albedo), torch.zeros_like(table.tint[:, :2])
    first, side = textures.faces.float().unbind(dim=-1)
    columns = [table.opacity[:, None], table.tint, table.variation[:, None], first + len(table), side]
    own = [table.albedo, flat, table.roughness[:, None], table.metallic[:, None], table.emission]
    return array(torch.cat(columns, dim=1)), array(torch.cat([torch.cat(own, dim=1), textures.texels]))


def surfaces_of(vertices: Vertices) -> np.ndarray:
    """``(N, 20)`` float32."""
    columns = [getattr(vertices, name).reshape(-1, width).float() for name, width in COLUMNS.items()]
    return array(torch.cat(columns, dim=1))


def camera_of(picture: Picture | None) -> np.ndarray:
    """``(27,)`` float64 that `on_screen_kernel.sees` reads of a picture's camera, empty for none; and 12 more for each
    instance, if any has moved since, for `on_screen_kernel.back_project`."""
    if picture is None:
        return np.zeros(0)
    camera = picture.camera
    k, jitter = camera.intrinsics[0].double(), camera.jitter
    still = torch.zeros(2, dtype=torch.float64)
    numbers = [
        camera.view_from_world[0, :3].double().flatten(),
        k[[0, 1], [0, 1]],
        k[:2, 2],
        still if jitter is None else jitter[0].double(),
        camera.position[0].double(),
        camera.forward[0].double(),
        torch.tensor([camera.orthographic, *camera.size], dtype=torch.float64),
    ]
    if picture.back is not None:
        numbers.append(picture.back[1:, :3].double().flatten())
    return array(torch.cat(numbers))


def picture_of(picture: Picture | None) -> np.ndarray:
    """``(4, H * W)`` float32: depth and normal of each pixel; none for no picture."""
    if picture is None:
        return np.zeros((4, 0), np.float32)
    return array(torch.cat([picture.depth[None], picture.normal]))


def _picture(scene: Scene) -> np.ndarray:
    if scene.sky.picture is None:
        return np.zeros((0, 0, 3), np.float32)
    return array(scene.sky.picture[0].permute(1, 2, 0).float())


def _sky(scene: Scene) -> np.ndarray:
    colors, sun = scene.sky, scene.sun
    rows = np.zeros((GLOW + len(sky.GLOW), 3))
    rows[:3] = colors.zenith, colors.horizon, colors.ground
    if sun is not None:
        toward = np.array(sun.direction, np.float64)
        rows[TOWARD:DISC] = toward / np.linalg.norm(toward), sun.irradiance
        rows[DISC, :2] = np.sin(np.radians(sun.angular_radius)), 1.0
        rows[GLOW:, :2] = np.array(sky.GLOW).reshape(-1, 2)
    return rows


def _lamps(lamps: LampTable | None) -> tuple[np.ndarray, ...]:
    if lamps is None:
        none = torch.zeros(0, 1)
        return array(none), array(none[:, 0]), array(none.int()), array(none.short()), np.zeros(7)
    half = (lamps.edge_u + lamps.edge_v) / 2
    columns = [lamps.corner + half, lamps.facing, half.norm(dim=1, keepdim=True), lamps.power[:, None]]
    columns += [lamps.corner, lamps.edge_u, lamps.edge_v, lamps.area[:, None], lamps.radiance]
    cells = np.array([*lamps.low.tolist(), lamps.cell, *lamps.shape], np.float64)
    tables = torch.cat(columns, dim=1), lamps.power.cumsum(0), lamps.slots, lamps.counts
    return *(array(t) for t in tables), cells


def _sky_table(table: SkyTable | None) -> tuple[np.ndarray, np.ndarray]:
    none = torch.zeros(0)
    return (array(none), array(none)) if table is None else (array(table.upto), array(table.density))
