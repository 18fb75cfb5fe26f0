"""Denoising path-traced light: emission and albedo survive, noise does not, shadows keep their edges."""

# pyright: reportPossiblyUnboundVariable=false

from __future__ import annotations

import math
from typing import Any

import boxes
import pytest
import torch
from court import court

from gbufrt import Camera, Frame, GBuffer
from post import Denoise, denoise
from post.filters.around import alike
from post.filters.surfaces import surface
from post.history.catmull_rom import catmull_rom_weights
from post.history.reproject import correspondence_reference, find_taps
from post.mirrors.image import mirror_image
from post.passes.denoising.denoise import _despeckled, _lonely
from post.shading.composite_op import specular_albedo
from tracer.gbuffers import gbuffer

SIZE = (36, 48)


def lit(frame: Frame) -> torch.Tensor:
    """Noise-free light: a smooth irradiance on a checkered albedo."""
    g = frame.gbuffer
    return torch.where(g.hit, (0.3 + 0.5 * g.normal[:, 1:2].abs()) * frame.read("albedo"), 0.7)


def painted(frame: Frame) -> Frame:
    """The frame with a checkerboard of albedo fixed to the world and one glowing pixel."""
    g = frame.gbuffer
    world = g.camera.to_world(g.points_view())
    check = (torch.floor(world * 2 + 1e-3).sum(1, keepdim=True) % 2).to(g.depth)
    albedo = torch.where(g.hit, 0.2 + 0.6 * check, 0.0).expand(-1, 3, -1, -1)
    emission = torch.zeros_like(albedo)
    emission[:, :, 20, 24] = 50.0
    return frame.replace(gbuffer=g.replace(albedo=albedo, emission=torch.where(g.hit, emission, 0.0)))


def noisy(frame: Frame, generator: torch.Generator) -> Frame:
    noise = torch.empty(frame.gbuffer.depth.shape).exponential_(generator=generator)
    return frame.replace(gi=torch.where(frame.gbuffer.hit, lit(frame) * noise + frame.read("emission"), lit(frame)))


def test_noise_goes_and_albedo_and_lamps_stay():
    generator, state, stage, frame = (
        torch.Generator().manual_seed(0),
        None,
        Denoise(),
        painted(boxes.frame(boxes.camera(SIZE))),
    )
    truth, g, errors = lit(frame) + frame.read("emission"), frame.gbuffer, []
    for _ in range(16):
        out, state = stage(noisy(frame, generator), state)
        errors.append(float((out.read("gi") - truth)[g.hit.expand_as(truth)].square().mean().sqrt()))
    before = float((noisy(frame, generator).read("gi") - truth)[g.hit.expand_as(truth)].square().mean().sqrt())
    assert errors[0] < 0.6 * before
    assert errors[-1] < 0.12 * before
    assert torch.equal(out.read("gi")[~g.hit.expand_as(truth)], truth[~g.hit.expand_as(truth)])


def test_light_without_noise_is_left_alone():
    previous, state = None, None
    for k in range(6):
        frame = painted(boxes.frame(boxes.camera(SIZE, dx=0.03 * k), previous=previous))
        previous = frame.gbuffer.camera
        light = lit(frame) + frame.read("emission")
        out, state = Denoise()(frame.replace(gi=light), state)
    assert torch.allclose(out.read("gi"), light, rtol=1e-3, atol=1e-4)


def test_what_lies_behind_guides_where_a_surface_transmits():
    frame = painted(boxes.frame(boxes.camera(SIZE)))
    g = frame.gbuffer
    pane = g.replace(
        depth=torch.full_like(g.depth, 1.0), hit=torch.ones_like(g.hit),
        albedo=torch.full_like(frame.read("albedo"), 0.5),
        normal=g.camera.rotate_to_world(torch.tensor([0.0, 0.0, -1.0]).view(1, 3, 1, 1).expand(1, 3, *SIZE)),
        emission=torch.zeros_like(frame.read("albedo")), opacity=torch.zeros_like(g.depth),
        transmittance=torch.full_like(frame.read("albedo"), 0.9),
    )  # fmt: skip
    light = noisy(frame, torch.Generator().manual_seed(1)).read("gi") * 0.9
    truth = 0.9 * (lit(frame) + frame.read("emission"))
    given, _ = denoise(light, pane, behind=g)
    blind, _ = denoise(light, pane)
    error = [float((x - truth)[g.hit.expand_as(truth)].square().mean()) for x in (given, blind)]
    assert error[0] < 0.05 * error[1]


def test_mirrors_keep_what_they_show_while_the_camera_moves():
    scene, generator = court(), torch.Generator().manual_seed(7)
    states: dict[str, Any] = {"mirrors": None, "plain": None}
    errors, before = {}, None
    for k in range(8):
        camera = scene.views["turning"].camera(0.02 * k, size=(72, 96))
        g = gbuffer(scene, camera, previous_camera=before or camera)
        before, image = camera, mirror_image(g)
        assert image is not None
        assert g.albedo is not None
        light = 0.5 * torch.where(image.mask, image.albedo, g.albedo)
        noise = torch.empty(g.depth.shape).exponential_(generator=generator)
        for name, given in (("mirrors", g), ("plain", g.replace(metallic=None))):
            out, states[name] = denoise(light * noise, given, states[name])
            errors[name] = float((out - light)[image.mask.expand_as(light)].square().mean().sqrt())
    assert errors["mirrors"] < 0.75 * errors["plain"]


def test_polished_black_stone_keeps_what_it_shows(monkeypatch: pytest.MonkeyPatch):
    g = gbuffer(court(), court().views["turning"].camera(0.0, size=(72, 96)))
    assert g.metallic is not None
    assert g.albedo is not None
    metal = g.hit & (g.metallic > 0.5)
    g = g.replace(metallic=torch.zeros_like(g.depth), albedo=torch.where(metal, 0.004, g.albedo))
    image, share = mirror_image(g, None, metal), specular_albedo(g)
    assert g.albedo is not None
    assert image is not None
    light = torch.where(metal, image.albedo, share + (1 - share) * g.albedo)
    noise = torch.empty(g.depth.shape).exponential_(generator=torch.Generator().manual_seed(7))
    guided, _ = denoise(light * noise, g)
    monkeypatch.setattr("post.passes.denoising.shown.MOST", math.inf)
    plain, _ = denoise(light * noise, g)
    error = [float((x - light)[metal.expand_as(light)].square().mean().sqrt()) for x in (guided, plain)]
    assert error[0] < 0.75 * error[1]
    gi = [denoise(light * noise, g, specular=False)[0]]
    monkeypatch.undo()
    gi.append(denoise(light * noise, g, specular=False)[0])
    assert torch.equal(*gi)  # light that stone scatters tells nothing of what it mirrors


def test_polished_tiles_share_their_light_whatever_their_albedo():
    frame = painted(boxes.frame(boxes.camera(SIZE)))
    g, generator = frame.gbuffer, torch.Generator().manual_seed(11)
    tiles = torch.where(frame.read("albedo") > 0.5, 0.8, 0.02)
    g = g.replace(albedo=tiles, emission=None, roughness=torch.full_like(g.depth, 0.1))
    share = specular_albedo(g)
    light = torch.where(g.hit, share + (1 - share) * tiles, 0.7)
    noisy = light * torch.empty(g.depth.shape).exponential_(generator=generator)
    every, diffuse = (denoise(noisy, g, specular=specular)[0] for specular in (True, False))
    error = [float((x - light)[g.hit.expand_as(light)].square().mean().sqrt()) for x in (every, diffuse)]
    assert error[0] < 0.8 * error[1]


def test_a_pixel_left_alone_in_a_mirror_stays_within_the_light_around_it():
    frame = boxes.frame(boxes.camera(SIZE), boxes=boxes.ROOM[:1])
    g, light = frame.gbuffer, torch.ones_like(frame.gbuffer.normal)
    depth, mirrors = g.depth.clone(), torch.zeros_like(g.hit)
    for column, value in ((6, 1.25), (12, 0.0), (24, 0.0)):
        depth[..., 28, column] *= 0.5
        light[..., 28, column] = value
    light[..., 29, 7] = 1.5
    mirrors[..., :24] = True
    clean = _despeckled(light, alike(surface(depth, g.normal, g.hit, g.camera)), mirrors)
    assert torch.equal(clean[..., 28, 6], torch.full((1, 3), 1.25))  # no brighter than one around it
    assert torch.equal(clean[..., 28, 12], torch.ones(1, 3))
    assert torch.equal(clean[..., 28, 24], torch.zeros(1, 3))


@pytest.mark.parametrize("mirror", [False, True])
def test_what_shows_another_side_each_frame_keeps_a_short_history_unless_it_is_a_mirror(mirror):
    history = None
    for turned in (-0.7, 0.7, -0.7):
        camera = Camera.look_at((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), size=SIZE, far=100.0)
        depth, one = torch.full((1, 1, *SIZE), 10.0), torch.ones(1, 1, *SIZE)
        normal = torch.tensor([math.sin(turned), 0.0, math.cos(turned)])[None, :, None, None].expand(1, 3, *SIZE)
        matt, still = (not mirror) * one, torch.zeros(1, 2, *SIZE)
        g = GBuffer(
            camera=camera, depth=depth, hit=depth > 0, normal=normal, albedo=0.5 * one.expand(1, 3, *SIZE),
            roughness=matt, metallic=1 - matt, motion=still, motion_z=still[:, :1], previous_camera=camera,
        )  # fmt: skip
        _, history = denoise(one.expand(1, 3, *SIZE), g, history)
    assert bool((history.length == 1 if mirror else history.length > 2).all())


def test_a_body_one_pixel_wide_is_alone_and_metals_never_are():
    same = torch.zeros(1, 9, 1, 5, dtype=torch.bool)
    for column, count in enumerate((1, 3, 4, 5, 9)):
        same[:, :count, :, column] = True
    assert _lonely(same, None).flatten().tolist() == [1.0, 1.0, 0.5, 0.0, 0.0]
    assert _lonely(same, torch.ones(1, 1, 1, 5, dtype=torch.bool)).sum() == 0


def test_strong_noise_leaves_no_blotches_and_weak_noise_no_blur():
    frame = boxes.frame(boxes.camera(SIZE), boxes=boxes.ROOM[:1])
    g, generator = frame.gbuffer, torch.Generator().manual_seed(2)
    rare = torch.rand(g.depth.shape, generator=generator) < 0.15
    smooth, _ = denoise(torch.where(rare, 1 / 0.15, 0.0).expand_as(g.normal), g)
    inner = g.hit[:, 0, 8:-8, 8:-8]
    assert float(smooth[:, 0, 8:-8, 8:-8][inner].std()) < 0.25
    columns = torch.arange(SIZE[1]).expand_as(g.depth)
    edge = torch.where(columns < 24, 1.0, 1.25).expand_as(g.normal)
    faint = edge * (1 + 0.02 * torch.randn(g.depth.shape, generator=generator))
    kept, _ = denoise(faint, g)
    assert float((kept - edge).abs()[g.hit.expand_as(edge)].mean()) < 0.01


def test_a_sharp_history_keeps_detail_and_a_plain_one_does_not():
    f = torch.linspace(0, 0.999, 9)
    assert torch.allclose(torch.stack(catmull_rom_weights(f)).sum(0), torch.ones_like(f))
    before = boxes.frame(boxes.camera(SIZE), boxes=boxes.ROOM[:1])
    now = boxes.frame(boxes.camera(SIZE, dx=0.02), previous=before.gbuffer.camera, boxes=boxes.ROOM[:1])

    def wave(frame: Frame) -> torch.Tensor:
        world = frame.gbuffer.camera.to_world(frame.gbuffer.points_view())
        return torch.sin(world[:, :1] * 3) * frame.gbuffer.hit

    look = correspondence_reference(now.gbuffer, before.gbuffer)
    plain, sharp = (find_taps(*look, sharp=s) for s in (False, True))
    whole = (plain.support > 0.999) & now.gbuffer.hit
    assert torch.allclose(sharp.weight.sum(1, keepdim=True)[whole], torch.ones(()))
    error = [float((t.fetch(wave(before)) - wave(now))[whole].square().mean()) for t in (plain, sharp)]
    assert error[1] < 0.4 * error[0]


def test_module_equals_function():
    frame = noisy(painted(boxes.frame(boxes.camera(SIZE))), torch.Generator().manual_seed(3))
    state, history = None, None
    for _ in range(3):
        out, state = Denoise()(frame, state)
        light, history = denoise(frame.read("gi"), frame.gbuffer, history, specular=False)
    assert torch.equal(light, out.read("gi"))


def test_gradients():
    frame = painted(boxes.frame(boxes.camera(SIZE))).to(torch.float64)
    g = frame.gbuffer
    light = (
        torch.rand(frame.read("albedo").shape, dtype=torch.float64, generator=torch.Generator().manual_seed(5)) + 1
    ).requires_grad_()

    def run(light: torch.Tensor) -> torch.Tensor:
        return denoise(light, g)[0]

    assert torch.autograd.gradcheck(run, (light,), fast_mode=True)
    (run(light) ** 2).sum().backward()
    assert light.grad is not None
    assert float(light.grad.abs().max()) > 1e-3


def test_errors_help():
    frame = boxes.frame(boxes.camera((8, 9)))
    with pytest.raises(ValueError, match=r"light must be \(1,3,8,9\), .*linear radiance; got \(1,1,8,9\)"):
        denoise(frame.gbuffer.depth, frame.gbuffer)
