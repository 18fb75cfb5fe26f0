"""Whole frames."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
import torch
import voxels
from voxels import GLASS, LAMP, STONE

from gbufrt import Camera
from tracer.frames import render
from tracer.scene.scene import Instance, Scene
from tracer.scene.view import View
from tracer.scene.world import World
from tracer.truth.path_tracer import path_trace

SIZE = (9, 12)


def scene() -> Scene:
    boxes = ((STONE, (0, 0, 0), (16, 2, 16)), (GLASS, (4, 2, 9), (12, 7, 10)), (LAMP, (7, 2, 3), (9, 4, 5)))
    mover = Instance(
        model=voxels.world((2, 2, 2), (STONE, (0, 0, 0), (2, 2, 2))), pose=lambda t: voxels.pose((2.0 + t, 4.0, 6.0))
    )
    return Scene(world=voxels.world((16, 12, 16), *boxes), instances=(mover,))


def cameras(*eyes: tuple[float, float, float]) -> Camera:
    return Camera.look_at(torch.tensor(eyes), (8.0, 3.0, 5.0), size=SIZE, far=100.0)


def test_a_frame_is_lit_and_has_its_layer_behind() -> None:
    frame = render(scene(), cameras((8.0, 6.0, 18.0)), time=0.5, previous_time=0.4, index=3, light_samples=2)
    frame.gbuffer.validate()
    assert (frame.index, frame.time, frame.emitters_sampled) == (3, 0.5, True)
    assert frame.radiance is not None
    assert frame.ambient is not None
    assert frame.environment is not None
    assert frame.environment.shape[:2] == (1, 3)
    assert frame.behind is not None
    assert frame.behind.radiance is not None
    assert frame.behind.behind is None
    assert torch.isfinite(frame.radiance).all()
    glass = frame.gbuffer.material_id == GLASS
    assert glass.any()
    assert (frame.behind.gbuffer.hit & ~glass).sum() == 0
    assert (frame.behind.gbuffer.material_id == LAMP).any()


def test_without_light_emission_and_sky_are_left() -> None:
    given = {"time": 0.5, "previous_time": 0.4, "index": 3}
    lit, dark = (render(scene(), cameras((8.0, 6.0, 18.0)), light_samples=n, **given) for n in (2, 0))
    assert (lit.emitters_sampled, dark.emitters_sampled) == (True, False)
    assert lit.behind is not None
    assert dark.behind is not None
    for want, got in ((lit, dark), (lit.behind, dark.behind)):
        assert torch.equal(
            got.read("radiance"), torch.where(want.gbuffer.hit, want.read("emission"), want.read("radiance"))
        )
        assert not torch.equal(got.read("radiance"), want.read("radiance"))
        for name in (*want.gbuffer.present, "ambient", "environment"):
            assert torch.equal(got.read(name), want.read(name))


def test_batch_equals_loop() -> None:
    eyes = ((8.0, 6.0, 18.0), (3.0, 5.0, 17.0))
    together = render(scene(), cameras(*eyes), time=[0.0, 1.0], light_samples=2)
    for b, eye in enumerate(eyes):
        alone = render(scene(), cameras(eye), time=float(b), light_samples=2)
        for name in ("radiance", "ambient", "environment", "depth", "motion"):
            torch.testing.assert_close(together.read(name)[b : b + 1], alone.read(name))


def test_an_empty_world_is_refused_in_one_line() -> None:
    nothing = Scene(world=World.from_dense(torch.zeros(2, 2, 2, dtype=torch.int16), voxels.TABLE))
    with pytest.raises(ValueError, match="the world has no voxels") as caught:
        render(nothing, cameras((8.0, 6.0, 18.0)))
    assert "\n" not in str(caught.value)


def test_what_is_no_camera_is_told_how_to_become_one() -> None:
    view: Any = View(eye=lambda t: (8.0, 6.0, 18.0 + t), target=lambda _: (8.0, 3.0, 5.0))
    there, seen = replace(scene(), views={"front": view, "side": view}), cameras((8.0, 6.0, 18.0))
    gives = r"\.camera\(time=0\.0, size=\(540, 960\)\) gives one"
    for call in (render, path_trace):
        with pytest.raises(
            TypeError, match=rf"^camera must be a gbufrt\.Camera, got str; scene\.views\['side'\]{gives}"
        ):
            call(there, "side")  # pyright: ignore
        with pytest.raises(TypeError, match=rf"got str; scene\.views\['front'\]{gives}"):
            call(there, "back")  # pyright: ignore
        with pytest.raises(TypeError, match=rf"got View; view{gives}"):
            call(there, view)
        with pytest.raises(TypeError, match=r"scene must be a tracer\.Scene, got str"):
            call("valley", seen)  # pyright: ignore
    with pytest.raises(TypeError, match=rf"previous_camera must be a gbufrt\.Camera, got View; view{gives}"):
        render(there, seen, previous_camera=view)
    with pytest.raises(ValueError, match=r"size must be \(H, W\).*got 540"):
        view.camera(size=540)
    assert view.camera(size=SIZE).position.tolist() == seen.position.tolist()
