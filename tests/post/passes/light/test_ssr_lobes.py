"""Reflections of rough surfaces: Fresnel, blur by roughness, rays shared by neighbours, fireflies."""

from __future__ import annotations

import boxes
import pytest
import torch
from mirrors import shiny
from torch import Tensor

from gbufrt import Camera, Frame
from post.passes.light.ssr import SSR


def mean_of(frame: Frame, stage: SSR, frames: int) -> Tensor:
    return torch.stack([stage(frame.replace(index=i)).read("reflection") for i in range(frames)]).mean(0)


def test_fresnel_is_included():
    camera = Camera.look_at((0.0, 8.0, 0.0), (0.0, 0.0, 0.0), size=(33, 33), fov_y=2.0, up=(0, 0, -1))
    frame = shiny(camera, metal=0.0, scene=boxes.ROOM[:1])
    assert torch.allclose(SSR(samples=1)(frame).read("reflection"), torch.tensor(0.04 * 0.5), rtol=1e-2)
    bare = frame.gbuffer.replace(albedo=None, metallic=None)
    assert torch.allclose(SSR(samples=1)(frame.replace(gbuffer=bare)).read("reflection"), torch.tensor(0.02), rtol=1e-2)


@pytest.mark.parametrize("method", ["ggx", "cone"])
def test_rough_is_blurrier(method):
    def contrast(rough: float) -> float:
        frame = shiny(boxes.camera((45, 60)), rough=rough)
        mean = mean_of(frame, SSR(samples=4, method=method), 4)
        smooth = torch.nn.functional.avg_pool2d(mean[:, 0:1] - mean[:, 2:3], 3, 1, 1)
        return float(smooth[frame.read("material_id") == 1].std())

    values = [contrast(r) for r in (0.0, 0.4, 0.8)]
    assert values[0] > 1.15 * values[1] > 1.15**2 * values[2]


def test_rough_converges_to_the_brdf_average():
    """Under a uniform sky all directions bring the same radiance: the mean is the directional albedo, 1 less loss."""
    frame = shiny(boxes.camera((30, 40)), rough=0.6, scene=boxes.ROOM[:1])
    mean = mean_of(frame, SSR(samples=8), 8)
    value = mean[frame.gbuffer.hit.expand_as(mean)] / 0.5
    assert 0.7 < value.mean() < 1.0  # roughness 0.6, mostly at grazing angles, without multiple scattering
    assert value.std() < 0.05


def test_reuse_keeps_the_mean_and_lowers_noise():
    frame = shiny(boxes.camera((45, 60)), rough=0.4)
    hit = frame.gbuffer.hit.expand(-1, 3, -1, -1)

    def runs(reuse: int) -> Tensor:
        images = [SSR(samples=1, reuse=reuse)(frame.replace(index=i)).read("reflection")[hit] for i in range(12)]
        return torch.stack(images)

    alone, shared = runs(0), runs(4)
    assert abs(float(shared.mean() / alone.mean()) - 1) < 0.02
    assert shared.std(0).mean() < 0.7 * alone.std(0).mean()


def test_mirrors_do_not_listen_to_neighbours():
    frame = shiny()
    alone, shared = (SSR(samples=1, reuse=reuse, bounces=1)(frame) for reuse in (0, 8))
    assert torch.allclose(alone.read("reflection"), shared.read("reflection"), atol=1e-5)


def test_roughness_cutoff_leaves_the_environment():
    frame = shiny(rough=0.8)
    result = SSR(samples=2, roughness_cutoff=0.5)(frame)
    assert (result.read("reflection_confidence") == 0).all()
    assert result.read("reflection").mean() > 0.1
    partly = SSR(samples=2, roughness_cutoff=0.75)(frame).read("reflection_confidence")
    whole = SSR(samples=2)(frame).read("reflection_confidence")
    assert torch.allclose(partly, 0.5 * whole, atol=1e-4)


def test_fireflies_are_held_on_rough_surfaces_alone():
    frame = shiny(boxes.camera((60, 80)), rough=0.5)
    light = frame.read("radiance").clone()
    light[:, :, 30, 40] = 1e6
    frame = frame.replace(radiance=light)
    mean = light.mean()
    assert SSR(samples=1)(frame).read("reflection").max() < 100 * mean
    mirror = frame.replace(gbuffer=frame.gbuffer.replace(roughness=torch.zeros_like(frame.gbuffer.depth)))
    light[:, :, 20:40, 30:50] = 50.0
    assert SSR(samples=1)(mirror.replace(radiance=light)).read("reflection").max() > 49


def test_lamps_that_mirrors_show_already_are_not_added():
    """As in direct light of path tracers, where rays of mirrors find lamps."""
    frame = shiny(rough=0.05)  # smooth metals with light of their own would show the sky
    glow = torch.where(frame.gbuffer.material_id == 2, 5.0, 0.0).expand(-1, 3, -1, -1)
    lit = frame.replace(gbuffer=frame.gbuffer.replace(emission=glow), radiance=frame.read("radiance") + glow)
    plain, both = (SSR(samples=1)(one).read("reflection") for one in (frame, lit))
    assert float((both - plain).max()) > 1
    torch.testing.assert_close(SSR(samples=1)(lit.replace(emitters_mirrored=True)).read("reflection"), plain)
