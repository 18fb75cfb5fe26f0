"""Light paths of a small picture, for tests that compare their forms. Run as a script, it answers in the CUDA form by
numba's simulator and saves what it finds, with the names of the bodies that ran:
``NUMBA_ENABLE_CUDASIM=1 python light_paths.py FILE``."""

from __future__ import annotations

from typing import Any

import torch
import voxels
from simulated import save
from torch import Tensor

from gbufrt import Camera
from tracer.gbuffers import gbuffer
from tracer.lights.samples import Lights
from tracer.paths import op
from tracer.paths import radiance as path_radiance
from tracer.paths.on_screen import Picture

SIZE, BOUNCES = (7, 9), 2


def answers(device: str | torch.device = "cpu") -> dict[str, Tensor]:
    """The radiance along a few rays, a row for each."""
    scene = voxels.polished_scene(2).to(device)
    camera = Camera.look_at((14, 16, 19), (0, 2, 0), size=SIZE).to(device)
    g, poses = gbuffer(scene, camera, time=0.3), scene.poses([0.3]).to(device)
    origins, directions = (x.to(device) for x in voxels.random_rays(2, 40))
    u = numbers(1 + path_radiance.MORE * (BOUNCES + 1), 40).to(device)
    given: dict[str, Any] = {"bounces": BOUNCES, "poses": poses[0], "picture": Picture.of(g, 0), "spreads": True}
    light = op.radiance(scene, Lights.of(scene, poses[0]), origins, directions, u, **given)
    return {"radiance": light[0].cpu(), "radiance on screen": light[1].cpu()}


def numbers(dims: int, count: int) -> Tensor:
    """``(dims, count)`` in [0, 1)."""
    return torch.rand(dims, count, generator=torch.Generator().manual_seed(dims))


if __name__ == "__main__":
    save(answers)
