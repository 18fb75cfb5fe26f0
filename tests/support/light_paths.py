"""Light paths and direct light of a small picture, for tests that compare their forms. Run as a script, it answers in
the CUDA form by numba's simulator and saves what it finds, with the names of the bodies that ran:
``NUMBA_ENABLE_CUDASIM=1 python light_paths.py FILE``."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace
from typing import Any
from unittest.mock import patch

import torch
import traversals
import voxels
from simulated import save
from torch import Tensor

from gbufrt import Camera
from gbufrt.compute import resident
from gbufrt.compute.dispatch import simulated
from tracer.direct import drivers
from tracer.direct.fog import segments_of
from tracer.direct.lighting import light
from tracer.fog import drivers as fog_drivers
from tracer.fog.scattered import scattered
from tracer.gbuffers import gbuffer, layers
from tracer.lights.samples import Lights
from tracer.paths import integrators, op, receivers
from tracer.paths import radiance as path_radiance
from tracer.paths.on_screen import Picture
from tracer.paths.one_sample import sample_light
from tracer.paths.receivers import receivers_of
from tracer.sampling.sequence import Sequence
from tracer.scene.fog import Fog

SIZE, BOUNCES = (7, 9), 2


def answers(device: str | torch.device = "cpu") -> dict[str, Tensor]:
    """The radiance along a few rays, a row for each; `from_surfaces`, `under_water`, `sampled`, `direct`, `fog`."""
    scene = voxels.polished_scene(2).to(device)
    camera = Camera.look_at((14, 16, 19), (0, 2, 0), size=SIZE).to(device)
    g, poses = gbuffer(scene, camera, time=0.3), scene.poses([0.3]).to(device)
    origins, directions = (x.to(device) for x in voxels.random_rays(2, 40))
    u = numbers(1 + path_radiance.MORE * (BOUNCES + 1), 40).to(device)
    given: dict[str, Any] = {"bounces": BOUNCES, "poses": poses[0], "picture": Picture.of(g, 0), "spreads": True}
    found = op.radiance(scene, Lights.of(scene, poses[0]), origins, directions, u, **given)
    return {
        "radiance": found[0].cpu(),
        "radiance on screen": found[1].cpu(),
        **from_surfaces(device),
        **under_water(device),
        **sampled(device),
        **direct(device),
        **fog(device),
    }


def from_surfaces(device: str | torch.device = "cpu") -> dict[str, Tensor]:
    """Sums of what two paths from each surface of a picture find."""
    scene = voxels.polished_scene(3).to(device)
    camera = Camera.look_at((14, 16, 19), (0, 2, 0), size=SIZE).with_jitter((0.2, -0.3)).to(device)
    g = gbuffer(scene, camera, time=0.3)
    at, surfaces = receivers_of(scene, g, scene.poses([0.3]).to(device))[0], int(g.hit.sum())
    cases: dict[str, tuple[int, tuple[float, ...]]] = {
        "occlusion": (integrators.OCCLUSION_DIMS, (7.0,)),
        "indirect": (integrators.indirect_dims(BOUNCES), (BOUNCES,)),
        "lit": (integrators.DIRECT_DIMS, ()),
        "reflected": (integrators.REFLECTION_DIMS, (0.3,)),
        "lobes": (integrators.lobe_dims(1), (1,)),
    }
    found = dict[str, Tensor]()
    for name, (dims, setting) in cases.items():
        start = () if name == "occlusion" else (at.vertices,)
        sequence = Sequence.of(2, dims, SIZE, seed=1, device=at.pixels.device)
        sums = getattr(op, name)(scene, at, *start, sequence, *setting)
        # on a GPU, pixels that show no surface come after those that do
        found |= {f"{name} {key}": value.T[:surfaces].cpu() for key, value in sums.items()}
    return found


def under_water(device: str | torch.device) -> dict[str, Tensor]:
    """As `from_surfaces`, of a pool's floor: where a ray ends, it leaves the water."""
    scene = traversals.scene().to(device)
    _, floor = layers(scene, Camera.look_at((5, 9, -2), (5, 1, 5.5), size=(4, 5), fov_y=30).to(device), time=0.0)
    assert floor is not None
    at = receivers_of(scene, floor, scene.poses([0.0]).to(device))[0]
    sequence = Sequence.of(2, integrators.indirect_dims(BOUNCES), (4, 5), seed=2, device=at.pixels.device)
    sums = op.indirect(scene, at, at.vertices, sequence, BOUNCES)
    return {f"under water {name}": sums[name].T.cpu() for name in ("sky", "sky_visibility")}


def sampled(device: str | torch.device) -> dict[str, Tensor]:
    """Light of one sample a pixel in a picture with sky: from its surfaces on the CPU, else from all of its pixels."""
    scene = voxels.polished_scene(3).to(device)
    g = gbuffer(scene, Camera.look_at((14, 16, 19), (0, 9, 0), size=SIZE).to(device), time=0.3)
    given: dict[str, Any] = {"poses": scene.poses([0.3]).to(device), "poses_then": scene.poses([0.2]).to(device)}
    all_of_them = patch.object(receivers, "waits", lambda _: True), patch.object(resident, "waits", lambda _: True)
    with ExitStack() as patched:
        for one in all_of_them if simulated() else ():
            patched.enter_context(one)
        light = sample_light(scene, g, **given)
    signals = {name: getattr(light, name) for name in ("direct", "indirect", "specular")}
    return {f"sampled {name}": signal.flatten(2)[0].T.cpu() for name, signal in signals.items()}


def direct(device: str | torch.device = "cpu") -> dict[str, Tensor]:
    """Light of sun and lamps where all lamps are candidates; and, in bands, where each tile leaves some out, and pixels
    share lists."""
    scene, size = voxels.polished_scene(1).to(device), (10, 13)
    g = gbuffer(scene, Camera.look_at((14, 16, 19), (0, 2, 0), size=size).to(device), time=0.3)
    given: dict[str, Any] = {"poses": scene.poses([0.3]).to(device), "samples": 8}
    seen = torch.linspace(0.2, 1.0, size[1], device=device).expand_as(g.depth)
    found = {"direct light": light(scene, g, **given)[0]}
    with patch.multiple(drivers, FEW=0, MANY=0, BAND=1):
        found["direct light of tiles"] = light(scene, g, seen=seen, **given)[0]
    return {name: value.cpu() for name, value in found.items()}


def fog(device: str | torch.device = "cpu") -> dict[str, Tensor]:
    """Light of sun, sky and lamps in fog: all lamps are weighed, and a few candidates."""
    size = (5, 6)
    scene = replace(voxels.polished_scene(1).to(device), fog=Fog(extinction=0.05, falloff=0.1, anisotropy=0.4))
    g = gbuffer(scene, Camera.look_at((14, 16, 19), (0, 2, 0), size=size).to(device), time=0.3)
    given: dict[str, Any] = {"poses": scene.poses([0.3])[0].to(device), "index": 1}
    noise = numbers(10, size[0] * size[1]).view(10, *size).to(device)
    found = {"fog of few candidates": scattered(scene, segments_of(g, 0), noise, **given)}
    with patch.object(fog_drivers, "FEW", 1 << 11):
        found["fog"] = scattered(scene, segments_of(g, 0), noise, **given)
    return {name: value.cpu() for name, value in found.items()}


def numbers(dims: int, count: int) -> Tensor:
    """``(dims, count)`` in [0, 1)."""
    return torch.rand(dims, count, generator=torch.Generator().manual_seed(dims))


if __name__ == "__main__":
    save(answers)
