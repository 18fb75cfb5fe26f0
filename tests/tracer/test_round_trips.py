"""How often the host waits for a GPU while a frame is traced, counted without one by a stand-in."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
import torch
from gpu_stand_in import GPU, gpu
from voxels import polished_scene

from gbufrt import Camera
from tracer.frames import render
from tracer.gbuffers import layers
from tracer.scene.scene import Haze, Scene
from tracer.scene.textures import COLUMNS, TILT, Textures, with_mips


def everything() -> Scene:
    """Lamps that stand and that move, glass, textures, sun, haze and stars."""
    scene, g = polished_scene(1), torch.Generator().manual_seed(2)
    texels = torch.rand(4, 4, COLUMNS, generator=g)
    texels[..., TILT : TILT + 2] -= 0.5
    materials = scene.world.materials
    faces = torch.zeros(len(materials), 6, 2, dtype=torch.int32)
    faces[materials.id("diffuse")] = torch.tensor([0, 4])
    skinned = replace(materials, textures=Textures(faces=faces, texels=with_mips(texels)))
    sky, haze = replace(scene.sky, stars=torch.eye(3)), Haze(begin=20.0, end=90.0)
    return replace(scene, world=replace(scene.world, materials=skinned), sky=sky, haze=haze)


def test_a_traced_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    scene, eyes = everything(), [Camera.look_at((14 + 3 * n, 16, 19), (0, 2, 0), size=(12, 16)) for n in range(3)]
    moments: list[dict[str, Any]] = [{"time": 0.2 * n, "previous_time": 0.2 * max(n - 1, 0)} for n in range(3)]
    want = layers(scene, eyes[2], previous_camera=eyes[1], **moments[2])
    with gpu(monkeypatch) as seen:
        there, eyes, frames, launches = scene.to(GPU), [eye.to(GPU) for eye in eyes], [], []
        for n in range(3):
            seen.clear()
            given = {"previous_camera": eyes[max(n - 1, 0)], "light_samples": 4, **moments[n]}
            frames.append(render(there, eyes[n], index=n, **given))
            assert n == 0 or not seen.waits, "what does not change is made once"
            launches.append(list(seen.launches))
        found = [x.gbuffer.to("cpu") for x in (frames[2], frames[2].behind)]  # no light: here its kernels do nothing
    assert {"candidates_tile", "finish_pixel"} <= {name for name, *_ in launches[1]}
    assert launches[1] == launches[2], "a frame launches the same whatever it shows"
    for layer, wanted in zip(found, want, strict=True):
        assert wanted is not None
        assert wanted.hit.float().std() > 0.1
        for name in wanted.present:
            torch.testing.assert_close(getattr(layer, name), getattr(wanted, name), msg=name)
