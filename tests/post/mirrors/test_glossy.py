"""Histories of glossy metals are as short as their highlights wander."""

from __future__ import annotations

import math

import pytest
import torch

from gbufrt import Camera, Frame, GBuffer, Pipeline
from post import Denoise, denoise
from post.mirrors.curvature import TIGHT
from post.mirrors.glossy import FOLLOWED, LASTING, LEAST, SHARP, SMALL, TRUSTED, contrasting, frames_lasting
from post.mirrors.image import tight_metals

SIZE = (48, 64)
RADIUS, DISTANCE = 1.0, 3.0
TURN = math.radians(1.0)  # of the eye round the ball, a frame


def ball(frame: int, roughness: float = 0.2, metallic: float = 1.0) -> GBuffer:
    """A ball of metal at the origin, seen by an eye that circles it."""
    places = [(DISTANCE * math.sin(TURN * n), 0, DISTANCE * math.cos(TURN * n)) for n in (frame, frame - 1)]
    at = [Camera.look_at(place, (0, 0, 0), size=SIZE, fov_y=50) for place in places]
    origins, directions = (ray.permute(0, 3, 1, 2) for ray in at[0].rays())
    along = -(origins * directions).sum(1, keepdim=True)
    half = RADIUS**2 - (origins + along * directions).square().sum(1, keepdim=True)
    hit = half > 0
    points = origins + (along - half.clamp_min(0).sqrt()) * directions
    depth = torch.where(hit, at[0].to_view(points)[:, 2:], at[0].far)
    motion, motion_z = at[0].static_motion(at[1], depth, hit)
    one = torch.ones_like(depth)
    return GBuffer(
        camera=at[0], previous_camera=at[1], depth=depth, hit=hit, normal=torch.where(hit, points / RADIUS, 0.0),
        motion=motion, motion_z=motion_z, albedo=one.expand(-1, 3, -1, -1), roughness=roughness * one,
        metallic=metallic * one,
    )  # fmt: skip


@pytest.mark.parametrize("roughness", [0.2, 0.5])
def test_a_history_lasts_while_the_eye_turns_by_the_lobe(roughness: float, monkeypatch):
    monkeypatch.setattr("post.mirrors.curvature.TIGHT", math.inf)
    g = ball(1, roughness)
    assert g.previous_camera is not None
    frames = frames_lasting(g, g.previous_camera, tight_metals(g), g)
    assert frames is not None
    middle = frames[..., SIZE[0] // 2, SIZE[1] // 2]
    seen = DISTANCE / (DISTANCE - RADIUS) * TURN  # about the middle of the ball; its front is nearer
    assert float(middle) == pytest.approx(max(LASTING * roughness**2 / seen, LEAST), rel=0.05)
    assert bool(torch.isinf(frames[~g.hit]).all())
    still = frames_lasting(g, g.camera, tight_metals(g), g)
    assert still is not None
    assert float(still.min()) > 1e6


def test_what_is_matt_or_a_plane_mirror_or_curves_tightly_is_not_limited(monkeypatch: pytest.MonkeyPatch):
    """The last of them, a ball of 18 pixels, has histories that follow what it shows."""
    for roughness, metallic, tight in ((0.2, 0.0, TIGHT), (0.05, 1.0, math.inf), (0.2, 1.0, TIGHT)):
        monkeypatch.setattr("post.mirrors.curvature.TIGHT", tight)
        g = ball(1, roughness, metallic)
        assert g.previous_camera is not None
        assert frames_lasting(g, g.previous_camera, tight_metals(g), g) is None
    g = ball(1).replace(metallic=None)
    assert frames_lasting(g, g.camera, tight_metals(g), g) is None


def test_a_curved_mirror_forgets_once_its_image_has_moved_a_pixel():
    g = ball(1, roughness=0.05)
    assert g.previous_camera is not None
    assert g.motion is not None
    for pixels, expected in ((0.1, FOLLOWED / 0.1), (0.9, LEAST)):
        image = g.replace(motion=g.motion + torch.tensor([pixels, 0.0]).view(1, 2, 1, 1))
        frames = frames_lasting(g, g.previous_camera, tight_metals(g), image)
        assert frames is not None
        torch.testing.assert_close(frames[g.hit], torch.full_like(frames[g.hit], expected), rtol=1e-3, atol=0)


def highlight(g: GBuffer) -> torch.Tensor:
    """What a ball of metal shows of a lamp: bright where the reflected ray points to it."""
    eye = g.camera.rotate_to_world(g.camera.to_eye(g.points_view()))
    away = 2 * (eye * g.normal).sum(1, keepdim=True) * g.normal - eye
    toward = torch.tensor([0.35, 0.3, 0.9]).view(1, 3, 1, 1)
    lobe = torch.exp(40 * ((away * toward / toward.norm()).sum(1, keepdim=True) - 1))
    return torch.where(g.hit, 0.1 + 8 * lobe, 0.0).expand(-1, 3, -1, -1)


def test_a_highlight_does_not_lag_behind_the_eye():
    generator = torch.Generator().manual_seed(3)
    frames = []
    for n in range(16):
        g = ball(n)
        noise = 0.75 + 0.5 * torch.rand(g.depth.shape, generator=generator)
        frames.append(Frame(gbuffer=g, radiance=highlight(g) * noise, index=n))
    *_, last = Pipeline(denoise=Denoise(signal="radiance")).stream(frames)
    light, true = last.read("radiance"), highlight(last.gbuffer)
    error = float((light - true)[last.gbuffer.hit.expand_as(true)].square().mean().sqrt())
    assert float(light.min()) >= 0.0
    assert error < 0.2  # 0.34 with histories of the usual length


@pytest.mark.parametrize("roughness", [0.05, 0.2])
def test_small_balls_keep_what_they_show(roughness: float):
    """A history that follows the highlight over the ball is long, and filters see a ball, not an image in crumbs."""
    generator = torch.Generator().manual_seed(3)
    frames = []
    for n in range(16):
        g = ball(n, roughness)
        noise = torch.exp(torch.randn(g.depth.shape, generator=generator) - 0.5)
        frames.append(Frame(gbuffer=g, radiance=highlight(g) * noise, index=n))
    *_, last = Pipeline(denoise=Denoise(signal="radiance")).stream(frames)
    light, true = last.read("radiance"), highlight(last.gbuffer)
    seen = last.gbuffer.hit.expand_as(true)
    assert float((light - true)[seen].square().mean().sqrt()) < 0.12  # 0.14 and 0.41 where images had edges of theirs
    assert float(light[seen].mean() / true[seen].mean()) > 0.97  # 0.95 and 0.76


def test_dark_samples_of_a_lobe_are_no_shadow():
    """Side by side they would be one on what is matt, as dark as the darkest mean around."""
    lit = (torch.arange(SIZE[1]) / 12).expand(1, 3, *SIZE)
    dark = lit.clone()
    dark[..., 23:25, 31:33] = 0.05  # more would be a change of light, and followed
    left = {}
    for metallic in (0.0, 1.0):
        g, history, clean = ball(1, SMALL, metallic), None, lit  # sharper ones keep more of any contrast
        still = g.replace(previous_camera=g.camera, motion=torch.zeros_like(g.normal[:, :2]))
        for light in (*[lit] * 8, dark):
            clean, history = denoise(torch.where(g.hit, light, 0.0), still, history)
        left[metallic] = float(clean[..., 23:25, 31:33].mean())
    assert left[0.0] < left[1.0] - 0.015


@pytest.mark.parametrize("tight", [True, False])
def test_wavelets_are_told_less_noise_where_metals_show_sharp_images(tight: bool, monkeypatch):
    """The more so where these are small, as on a ball of 18 pixels."""
    if not tight:
        monkeypatch.setattr("post.mirrors.curvature.TIGHT", math.inf)
    for roughness in (0.02, 0.2, 0.4, 0.9):
        g = ball(1, roughness)
        share = contrasting(g, tight_metals(g))
        assert share is not None
        assert float(share[..., SIZE[0] // 2, SIZE[1] // 2]) == pytest.approx(
            min(max((roughness / (SMALL if tight else SHARP)) ** 2, TRUSTED), 1.0), rel=1e-5
        )
        assert bool((share[~g.hit] == 1).all())
    g = ball(1, 0.05, metallic=0.0)
    matt = contrasting(g, tight_metals(g))
    assert matt is not None
    assert bool((matt == 1).all())
    g = ball(1).replace(roughness=None)
    assert contrasting(g, tight_metals(g)) is None


def test_a_first_frame_keeps_the_contrast_that_a_smooth_ball_of_metal_shows(monkeypatch):
    """Two halves of a ball show unlike light, with the noise of one sample a pixel."""
    g = ball(0, 0.1)
    left = torch.arange(SIZE[1]) < SIZE[1] // 2
    truth = torch.where(left, 0.25, 1.0).expand_as(g.normal)
    noise = 2 * torch.rand(g.depth.shape, generator=torch.Generator().manual_seed(5))
    light = (truth * noise).contiguous()
    near = g.hit.clone()
    near[..., : SIZE[1] // 2 - 4] = near[..., SIZE[1] // 2 + 4 :] = False

    def error() -> float:
        return float((denoise(light, g)[0] - truth)[near.expand_as(truth)].square().mean())

    sharp = error()
    monkeypatch.setattr("post.passes.denoising.denoise.contrasting", lambda *g: None)
    assert sharp < 0.9 * error()


def test_images_of_a_world_that_stands_still_need_no_motion():
    generator, results = torch.Generator().manual_seed(3), []
    noise = [torch.exp(torch.randn((1, 1, *SIZE), generator=generator) - 0.5) for _ in range(4)]
    for told in (True, False):
        frames = []
        for n, each in enumerate(noise):
            g = ball(n)
            light = highlight(g) * each
            frames.append(Frame(gbuffer=g if told else g.replace(motion=None, motion_z=None), radiance=light, index=n))
        *_, last = Pipeline(denoise=Denoise(signal="radiance")).stream(frames)
        results.append(last.read("radiance"))
    torch.testing.assert_close(*results)
