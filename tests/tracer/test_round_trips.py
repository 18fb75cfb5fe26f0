"""How often the host waits for a GPU while a frame is traced, counted without one by a stand-in."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
import torch
import voxels
from gpu_stand_in import GPU, gpu
from voxels import polished_scene

from gbufrt import Camera, Frame
from gbufrt.compute import resident
from tracer import Fog, Waves, raining, sampled
from tracer.frames import render
from tracer.gbuffers import layers
from tracer.paths import receivers
from tracer.scene.material import Material, MaterialTable
from tracer.scene.scene import Haze, Instance, Scene, Sun
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


def sampled_frames(scene: Scene, eyes: list[Camera], *, each: Callable[[], object] = lambda: None) -> list[Frame]:
    """Frames with light of one sample a pixel, and samples replayed; before ``each``, something is called."""
    frames = list[Frame]()
    for n, eye in enumerate(eyes):
        before = max(n - 1, 0)
        moments: dict[str, Any] = {"time": 0.2 * n, "previous_time": 0.2 * before, "index": n, "light_samples": 0}
        frame = render(scene, eye, previous_camera=eyes[before], **moments)
        each()
        frames.append(sampled(scene, frame, before=frames[-1] if frames else None))
    return frames


def test_sampled_light(monkeypatch: pytest.MonkeyPatch) -> None:
    scene, eyes = everything(), [Camera.look_at((14 + 3 * n, 16, 19), (0, 2, 0), size=(12, 16)) for n in range(4)]
    waits, launches = list[int](), list[list[Any]]()
    with gpu(monkeypatch) as seen:
        there, eyes = scene.to(GPU), [eye.to(GPU) for eye in eyes]
        sampled_frames(there, eyes[:2])
        for many in (3, 4):
            sampled_frames(there, eyes[:many], each=seen.clear)
            waits.append(seen.waits.total())
            launches.append(list(seen.launches))
    assert waits == [0, 0]
    assert {"lit_paths", "lobes_paths"} <= {name for name, *_ in launches[0]}
    assert launches[0] == launches[1], "a frame launches the same whatever it shows"


def test_sampled_light_from_all_pixels_is_that_from_lists_of_pixels(monkeypatch: pytest.MonkeyPatch) -> None:
    """As a GPU takes them, by the kernels of the CPU."""
    scene, eyes = everything(), [Camera.look_at((14 + 3 * n, 16, 19), (0, 9, 0), size=(24, 32)) for n in range(2)]
    wanted = sampled_frames(scene, eyes)[1]
    for where in (resident, receivers):
        monkeypatch.setattr(where, "waits", lambda _: True)
    found = sampled_frames(scene, eyes)[1]
    assert 0.1 < wanted.gbuffer.hit.float().mean() < 0.9
    for one, other in zip((found, found.behind), (wanted, wanted.behind), strict=True):
        assert one is not None
        assert other is not None
        for name in ("diffuse", "specular", "shadow", "reflection_distance", "replayed_diffuse", "replayed_specular"):
            torch.testing.assert_close(one.read(name), other.read(name), rtol=1e-5, atol=1e-6, msg=name)


def pond() -> Scene:
    """Water of two biomes before a wall that its waves light, half under a roof, with glass and a block that moves."""
    swamp = Material(name="water of a swamp", opacity=0.5, tint=(0.4, 0.8, 0.9), roughness=0.1)
    table = MaterialTable.of(
        [
            Material(name="stone"),
            Material(name="glass", opacity=0.25, tint=(0.9, 0.7, 0.5)),
            Material(name="water", opacity=0.5, tint=(0.4, 0.8, 0.9)),
            Material(name="lamp", emission=(4.0, 3.0, 2.0)),
            swamp,
        ]
    )
    boxes = (
        (voxels.STONE, (0, 0, 0), (24, 3, 24)), (voxels.STONE, (0, 3, 0), (24, 10, 2)), (0, (2, 1, 4), (22, 3, 22)),
        (voxels.WATER, (2, 1, 4), (12, 3, 22)), (5, (12, 1, 4), (22, 3, 22)), (voxels.STONE, (3, 7, 2), (8, 8, 24)),
        (voxels.GLASS, (14, 2, 8), (18, 6, 9)), (voxels.LAMP, (20, 4, 2), (21, 6, 3)),
        (voxels.LAMP, (9, 5, 1), (10, 6, 2)),
    )  # fmt: skip
    block = voxels.world((2, 2, 2), (voxels.STONE, (0, 0, 0), (2, 2, 2)), table=table)
    moving = Instance(model=block, pose=lambda t: voxels.pose((16.0, 3.0 + t, 6.0), yaw=0.4))
    world = voxels.world((24, 12, 24), *boxes, table=table)
    return Scene(world=world, instances=(moving,), sun=Sun(direction=(0.25, 0.6, 0.75)))


WEATHER: dict[str, Callable[[Scene], Scene]] = {
    "waves": lambda scene: replace(scene, waves=Waves(amplitude=0.3, frequency=0.5)),
    "rain": lambda scene: raining(scene, 1.0),
    "fog": lambda scene: replace(scene, fog=Fog(extinction=0.1, falloff=0.2, base=3.0)),
    "rain on waves": lambda scene: replace(raining(scene, 0.5), waves=Waves(amplitude=0.2)),
}


def frame_of(scene: Scene, eyes: list[Camera], n: int) -> Frame:
    """The ``n``-th frame of the pond."""
    before = max(n - 1, 0)
    moments: dict[str, Any] = {"time": 0.2 * n, "previous_time": 0.2 * before, "index": n}
    return render(scene, eyes[n], previous_camera=eyes[before], light_samples=4, **moments)


def views(size: tuple[int, int]) -> list[Camera]:
    """Of the pond, from three places."""
    return [Camera.look_at((11.5 + 0.3 * n, 4.0, 11.0), (11.5, 3.2, 5.0), size=size, fov_y=70) for n in range(3)]


@pytest.mark.parametrize("kind", WEATHER)
def test_weather(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scene, launches = WEATHER[kind](pond()), []
    with gpu(monkeypatch) as seen:
        there, eyes = scene.to(GPU), [eye.to(GPU) for eye in views((12, 16))]
        for n in range(3):
            seen.clear()
            frame_of(there, eyes, n)
            assert n == 0 or not seen.waits
            launches.append(list(seen.launches))
    assert launches[1] == launches[2], "a frame launches the same whatever it shows"


@pytest.mark.parametrize("kind", WEATHER)
def test_all_pixels_give_what_lists_of_pixels_give(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """As a GPU does it, by the kernels of the CPU."""
    scene, eyes = WEATHER[kind](pond()), views((48, 64))
    clear, wanted = frame_of(pond(), eyes, 2), frame_of(scene, eyes, 2)
    monkeypatch.setattr(resident, "waits", lambda tensor: True)
    found = frame_of(scene, eyes, 2)
    if "fog" in kind:
        assert all(wanted.read(name).std() > 0.01 for name in ("fog_light", "fog_transmittance", "fog_mirrored"))
    else:
        assert (wanted.gbuffer.normal != clear.gbuffer.normal).any(1).float().mean() > 0.01
        assert (wanted.read("radiance") - clear.read("radiance")).abs().mean() > 0.01
    for one, other in zip((found, found.behind), (wanted, wanted.behind), strict=True):
        assert one is not None
        assert other is not None
        for name in one.present:
            atol = 1e-7 if name.startswith("fog") else 0  # rays are counted from the mean of all origins
            torch.testing.assert_close(one.read(name), other.read(name), rtol=0, atol=atol, msg=name)
