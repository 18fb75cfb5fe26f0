"""The open sea: land that water surrounds goes on as water, so that its end is not in sight."""

from __future__ import annotations

from dataclasses import replace

import torch
from torch import Tensor

from tracer.scene.grids import BRICK
from tracer.scene.world import World

REACH = 128  # bricks: seen from 18 blocks over it, the sea then ends half a degree below the horizon
DEEP = 32  # blocks below its surface that go on with it, the sea floor among them; lower ones nobody sees


def in_open_sea(world: World, shore: Tensor, level: float) -> World:
    """A world where what stands at its border goes on: each empty column of bricks becomes a copy of the nearest.

    Args:
        world: land, with water up to one height wherever it ends.
        shore: ``(N, 2)`` the columns of bricks at its border, as indices x and z.
        level: the water's height, world y.
    """
    nx, _, nz = world.index.shape
    x, z = torch.meshgrid(torch.arange(-REACH, nx + REACH), torch.arange(-REACH, nz + REACH), indexing="ij")
    places = torch.stack([x, z], dim=-1).view(-1, 2).float()
    nearest = shore[torch.cdist(places, shore.float()).argmin(dim=1)].to(world.device)
    index = world.index[nearest[:, 0], :, nearest[:, 1]].view(*x.shape, -1).transpose(1, 2).contiguous()
    index[:, : max(int(level - DEEP) - world.origin[1], 0) // BRICK] = 0
    own = world.index.any(dim=1)[:, None]
    inside = index[REACH : REACH + nx, :, REACH : REACH + nz]
    inside.copy_(torch.where(own, world.index, inside))
    ox, oy, oz = world.origin
    return replace(world, index=index, origin=(ox - REACH * BRICK, oy, oz - REACH * BRICK))
