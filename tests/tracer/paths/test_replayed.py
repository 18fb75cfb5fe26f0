"""Samples that are taken again where lamps move."""

from __future__ import annotations

from dataclasses import replace

import torch
import voxels
from voxels import DARK, LAMP, STONE

from gbufrt import Camera
from gbufrt.frame import Frame
from tracer.frames import render
from tracer.paths.sampled import sampled
from tracer.scene.material import Material, MaterialTable
from tracer.scene.scene import Instance, Scene


def room() -> Scene:
    """A lamp on a floor beside a wall, in the dark, and a greater one that moves below the floor."""
    table = MaterialTable.of(
        [
            Material(name="stone", albedo=(0.7, 0.6, 0.5), roughness=0.4),
            *(Material(name=name) for name in ("glass", "water")),
            Material(name="lamp", emission=(4.0, 3.0, 2.0)),
        ]
    )
    boxes = ((STONE, (0, 0, 0), (16, 2, 16)), (STONE, (0, 2, 0), (16, 9, 1)), (LAMP, (7, 5, 3), (9, 7, 5)))
    block = replace(voxels.world((3, 3, 3), (LAMP, (0, 0, 0), (3, 3, 3))), materials=table)
    below = Instance(model=block, pose=lambda t: voxels.pose((2.0 + t, -6.0, 6.0), yaw=0.0))
    world = replace(voxels.world((16, 12, 16), *boxes), materials=table)
    return Scene(world=world, instances=(below,), sun=None, sky=DARK)


def frame(index: int, time: float) -> Frame:
    camera = Camera.look_at((8.0, 9.0, 24.0), (8.0, 2.0, 6.0), size=(10, 13), far=100.0)
    return render(room(), camera, time=time, index=index, light_samples=0)


def test_a_lamp_that_moves_out_of_sight_hardly_changes_samples():
    """Which lamp a sample goes to, and by what chance, depends on where all lamps are: here on where they were."""
    before = sampled(room(), frame(4, 0.0))
    result = sampled(room(), frame(5, 0.9), before=before)
    for name in ("diffuse", "specular"):
        want = torch.where(result.read("replayed") > 0, before.read(name), 0.0)
        changed = (result.read(f"replayed_{name}") - want).abs().sum() / want.sum()
        assert float(changed) < 0.01, name
