"""A small court, nearly all of it on screen: what screen-space passes can get right, they must get right here."""

from __future__ import annotations

import torch

from tracer.scene.material import Material, MaterialTable
from tracer.scene.scene import Scene, Sun
from tracer.scene.view import View
from tracer.scene.world import World

TABLE = MaterialTable.of(
    [
        Material(name="plaster", albedo=(0.75, 0.75, 0.75), variation=0.0),
        Material(name="brick", albedo=(0.8, 0.25, 0.15), variation=0.0),
        Material(name="mirror", albedo=(0.9, 0.9, 0.9), roughness=0.02, metallic=1.0, variation=0.0),
        Material(name="moss", albedo=(0.2, 0.6, 0.25), variation=0.0),
    ]
)
PLASTER, BRICK, MIRROR, MOSS = 1, 2, 3, 4


def court(*, mirror: bool = True) -> Scene:
    """A floor, with or without a mirror, two walls, a low block and two pillars, under sun and sky."""
    voxels = torch.zeros(24, 12, 24, dtype=torch.int16)
    voxels[:, 0, :] = PLASTER
    voxels[6:18, 0, 8:16] = MIRROR if mirror else PLASTER
    voxels[:, 1:9, 0] = BRICK
    voxels[0, 1:7, :] = MOSS
    voxels[8:11, 1:4, 4:7] = PLASTER
    voxels[15, 1:8, 5] = BRICK
    voxels[19, 1:6, 10] = MOSS
    still = View(eye=lambda t: (20.0, 9.0, 30.0), target=lambda t: (10.0, 2.5, 6.0), fov_y=42.0)
    turning = View(eye=lambda t: (20.0 - 6.0 * t, 9.0, 30.0), target=lambda t: (10.0, 2.5, 6.0), fov_y=42.0)
    return Scene(
        world=World.from_dense(voxels, TABLE),
        sun=Sun(direction=(0.5, 0.7, 0.45)),
        views={"still": still, "turning": turning},
    )


def posts() -> Scene:
    """Thin posts, a voxel wide and long, three voxels before a wall."""
    voxels = torch.zeros(72, 48, 6, dtype=torch.int16)
    voxels[:, :, 0] = PLASTER
    voxels[12:61:24, :, 4] = BRICK
    view = View(eye=lambda t: (36.5, 24.0, 70.0), target=lambda t: (36.5, 24.0, 0.0), fov_y=20.0)
    return Scene(world=World.from_dense(voxels, TABLE), sun=Sun(direction=(0.3, 0.5, 0.8)), views={"still": view})
