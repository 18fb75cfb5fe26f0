"""Frames traced without light, which samples then bring."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch
import voxels
from torch import Tensor
from voxels import DARK, GLASS, LAMP, STONE

from gbufrt import Camera
from gbufrt.frame import Frame
from tracer.frames import render
from tracer.lights.samples import Lights
from tracer.paths.sampled import sampled
from tracer.scene.scene import Scene, Sun
from tracer.truth.one_path import one_path

SUN = Sun(direction=(0.3, 0.8, 0.4), irradiance=(1.0, 0.9, 0.8))


def scene() -> Scene:
    boxes = ((STONE, (0, 0, 0), (16, 2, 16)), (GLASS, (9, 2, 9), (14, 6, 10)), (LAMP, (7, 2, 3), (9, 4, 5)))
    return Scene(world=voxels.world((16, 12, 16), *boxes), sun=SUN, sky=replace(DARK, zenith=(0.1, 0.2, 0.4)))


def frame(samples: int, index: int = 0) -> Frame:
    camera = Camera.look_at((8.0, 7.0, 20.0), (8.0, 3.0, 6.0), size=(12, 16), far=100.0)
    return render(scene(), camera, index=index, light_samples=samples)


def layers(frame: Frame) -> list[Frame]:
    assert frame.behind is not None
    return [frame, frame.behind]


def test_samples_bring_all_light_to_a_frame_without():
    lit, dark = (layers(sampled(scene(), frame(count, index=5))) for count in (1, 0))
    for want, got in zip(lit, dark, strict=True):
        assert want.present == got.present
        assert got.emitters_sampled
        for name in want.present:
            assert torch.equal(got.read(name), want.read(name)), name


def test_layers_and_replayed_samples_share_one_table_of_lights(monkeypatch: pytest.MonkeyPatch):
    made, of = [], Lights.of
    monkeypatch.setattr(Lights, "of", lambda *given: made.append(given) or of(*given))
    before = sampled(scene(), frame(0))
    made.clear()
    assert sampled(scene(), frame(0, index=1), before=before).behind is not None
    assert len(made) == 1


def test_radiance_is_emission_and_the_light_of_sun_and_lamps():
    whole = [layers(sampled(scene(), frame(0, index=index))) for index in range(64)]
    for layer, want in enumerate(layers(frame(64))):
        want, found = want.read("radiance"), [layers[layer].read("radiance") for layers in whole]
        assert torch.equal(found[3][~hit(want, layer)], want[~hit(want, layer)]), "the sky as it was"
        assert float((torch.stack(found).mean(dim=0) - want).abs().mean() / want.mean()) < 0.03


def hit(like: Tensor, layer: int) -> Tensor:
    return layers(frame(0))[layer].gbuffer.hit.expand_as(like)


@pytest.mark.parametrize("layer", [0, 1])
def test_one_path_brings_all_light_to_a_frame_without(layer: int):
    want, got = (layers(one_path(scene(), frame(count, index=5)))[layer] for count in (1, 0))
    assert got.emitters_sampled
    assert torch.equal(got.read("radiance"), want.read("radiance"))
