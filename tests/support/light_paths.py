"""Light paths of a small picture, for tests that compare their forms. Run as a script, it answers in the CUDA form by
numba's simulator and saves what it finds, with the names of the bodies that ran:
``NUMBA_ENABLE_CUDASIM=1 python light_paths.py FILE``."""

from __future__ import annotations

import sys
from typing import Any

import torch
import voxels
from torch import Tensor

from gbufrt import Camera
from tracer.gbuffers import gbuffer
from tracer.lights.samples import Lights
from tracer.paths import integrators, op
from tracer.paths import radiance as path_radiance
from tracer.paths.on_screen import Picture
from tracer.paths.receivers import receivers_of

SIZE, BOUNCES = (7, 9), 2
CASES = {
    "occlusion": (integrators.OCCLUSION_DIMS, (7.0,)),
    "indirect": (integrators.indirect_dims(BOUNCES), (BOUNCES,)),
    "lit": (integrators.DIRECT_DIMS, ()),
    "reflected": (integrators.REFLECTION_DIMS, (0.3,)),
}


def answers(device: str | torch.device = "cpu") -> dict[str, Tensor]:
    """What paths from surfaces find, and the radiance along a few rays; a row for each path."""
    scene = voxels.polished_scene(2).to(device)
    camera = Camera.look_at((14, 16, 19), (0, 2, 0), size=SIZE).to(device)
    g, poses = gbuffer(scene, camera, time=0.3), scene.poses([0.3]).to(device)
    at = receivers_of(scene, g, poses)[0]
    found = {}
    for name, (dims, settings) in CASES.items():
        values = getattr(op, name)(scene, at, at.vertices, numbers(dims, len(at.pixels)).to(device), *settings)
        found |= {f"{name} {key}": value for key, value in values.items()}
    origins, directions = (x.to(device) for x in voxels.random_rays(2, 40))
    u = numbers(1 + path_radiance.MORE * (BOUNCES + 1), 40).to(device)
    given: dict[str, Any] = {"bounces": BOUNCES, "poses": poses[0], "picture": Picture.of(g, 0), "spreads": True}
    light = op.radiance(scene, Lights.of(scene, poses[0]), origins, directions, u, **given)
    found |= {"radiance": light[0], "radiance on screen": light[1]}
    return {name: value.cpu() for name, value in found.items()}


def numbers(dims: int, count: int) -> Tensor:
    """``(dims, count)`` in [0, 1)."""
    return torch.rand(dims, count, generator=torch.Generator().manual_seed(dims))


if __name__ == "__main__":
    from gbufrt.compute import cuda

    launch, ran = cuda.launch, set()

    def watched(body: Any, *given: Any) -> None:
        ran.add(body.__name__)
        launch(body, *given)

    cuda.launch = watched
    found = answers()
    torch.save((found, ran), sys.argv[1])
