"""A floor beside a wall: the corner whose light has closed forms."""

from __future__ import annotations

import torch
from voxels import STONE, world

from gbufrt import Camera, GBuffer
from tracer.scene.material import Material, MaterialTable
from tracer.scene.scene import Scene

WHITE = MaterialTable.of([Material(name="white", albedo=(1.0, 1.0, 1.0), variation=0.0)])
WALL = 32  # x of the face of the wall beside the floor of `corner`


def above(x: float, z: float, *, size: tuple[int, int] = (9, 11), span: float = 3.0, height: float = 30.0) -> Camera:
    """Looks straight down; picture right is +x."""
    return Camera.look_at((x, height, z), (x, 0.0, z), size=size, up=(0.0, 0.0, -1.0), orthographic_height=span)


def corner(*, height: int = 24, **kw) -> Scene:
    """A floor whose top is at y = 1, and a wall on its +x side."""
    floor, wall = (STONE, (0, 0, 0), (WALL, 1, 96)), (STONE, (WALL, 0, 0), (WALL + 1, 1 + height, 96))
    return Scene(world=world((WALL + 1, 1 + height, 96), floor, wall), sun=None, **kw)


def albedo_of(g: GBuffer) -> torch.Tensor:
    assert g.albedo is not None
    return g.albedo
