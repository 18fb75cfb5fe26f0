"""Edge-avoiding wavelets."""

from __future__ import annotations

import boxes
import pytest
import torch
from torch import Tensor

from gbufrt import Camera, Frame
from post.passes.denoising.atrous import Atrous, atrous

PLAIN = {"signal": "light", "demodulate": False}


def lit(frame: Frame) -> Tensor:
    """A value a face, and a shadow with an edge across the floor."""
    g = frame.gbuffer
    x, _, z = g.camera.to_world(g.points_view()).unbind(1)
    shade = (0.4 + 0.5 * g.normal[:, 1].abs()) * (1 - 0.6 * ((x > -4) & (x < -0.5) & (z > -1)))
    return torch.where(g.hit, shade[:, None], 2.0).expand(-1, 3, -1, -1)


def noisy(frame: Frame, *, seed: int = 0, sigma: float = 0.3) -> Frame:
    truth = lit(frame)
    white = torch.randn(truth.shape, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)
    return frame.write("light", truth * (1 + sigma * white.to(truth) * frame.gbuffer.hit))


def error(frame: Frame, name: str = "light") -> float:
    return float(((frame.read(name) - lit(frame))[frame.gbuffer.hit.expand(-1, 3, -1, -1)] ** 2).mean())


def test_one_iteration_is_the_b_spline_where_nothing_stands_in_the_way():
    frame = boxes.frame(boxes.camera((40, 48)), boxes=boxes.ROOM[:1])
    g = frame.gbuffer
    dot = torch.zeros(1, 1, 40, 48)
    dot[..., 28, 24] = 1.0
    out, _ = atrous(dot, g.depth, g.normal, hit=g.hit, camera=g.camera, iterations=1, phi_color=1e9)
    spline = torch.tensor([1, 4, 6, 4, 1]) / 16
    assert torch.allclose(out[0, 0, 26:31, 22:27], spline[:, None] * spline[None], atol=1e-4)
    assert float(out.sum()) == pytest.approx(1.0, abs=1e-3)


def test_variance_left_is_what_is_left():
    frame = boxes.frame(boxes.camera((96, 128)), boxes=boxes.ROOM[:1])
    g = frame.gbuffer
    white = torch.randn((1, 1, 96, 128), generator=torch.Generator().manual_seed(1))
    known = torch.ones_like(white)
    out, left = atrous(
        white, g.depth, g.normal, hit=g.hit, camera=g.camera, iterations=1, phi_color=1e9, variance=known
    )
    assert float(out[g.hit].var()) == pytest.approx(float(left[g.hit].mean()), rel=0.1)


def test_noise_falls_far_and_the_shadow_keeps_its_edge():
    frame = noisy(boxes.frame(boxes.camera((96, 128))))
    assert error(Atrous(**PLAIN)(frame)) < 0.1 * error(frame)
    edge = boxes.frame(boxes.camera((64, 64)), boxes=boxes.ROOM[:1])
    truth = torch.where(torch.arange(64) < 32, 0.2, 0.8).expand(1, 1, 64, 64)
    white = torch.randn(truth.shape, generator=torch.Generator().manual_seed(2))
    out = Atrous(**PLAIN)(edge.write("light", truth + 0.05 * white)).read("light")
    beside = edge.gbuffer.hit & ((torch.arange(64) == 29) | (torch.arange(64) == 34))
    assert float((out - truth)[beside].abs().mean()) < 0.01


def test_known_variance_decides_what_noise_is():
    frame = noisy(boxes.frame(boxes.camera((48, 64))))
    tiny, large = (torch.full_like(frame.gbuffer.depth, v) for v in (1e-9, 1.0))
    kept = Atrous(**PLAIN)(frame.write("light_variance", tiny))
    blurred = Atrous(**PLAIN)(frame.write("light_variance", large))
    hit = frame.gbuffer.hit.expand(-1, 3, -1, -1)
    moved = [float((f.read("light") - frame.read("light"))[hit].abs().mean()) for f in (kept, blurred)]
    assert moved[0] < 0.35 * moved[1]
    assert float(blurred.read("light_variance").mean()) < 0.1


def test_tolerance_that_grows_with_the_noise_that_neighbours_share_leaves_less_of_it():
    frame = noisy(boxes.frame(boxes.camera((60, 80)), boxes=boxes.ROOM[:1]))
    g, light = frame.gbuffer, frame.read("light")
    given = {"hit": g.hit, "camera": g.camera, "phi_color": 0.5, "variance": (0.3 * lit(frame)[:, :1]) ** 2}
    plain, grown = (atrous(light, g.depth, g.normal, growth=growth, **given)[0] for growth in (1.0, 1.3))
    assert error(frame.write("light", grown)) < 0.8 * error(frame.write("light", plain))


def test_constant_and_sky_stay():
    frame = boxes.frame(boxes.camera((40, 50)), boxes=boxes.ROOM[2:])
    hit = frame.gbuffer.hit
    frame = frame.write("light", torch.where(hit, 0.25, 1e6).expand(-1, 3, -1, -1))
    out = Atrous(**PLAIN)(frame).read("light")
    assert torch.allclose(out, frame.read("light"), rtol=1e-5)


def test_surfaces_do_not_mix():
    frame = boxes.frame(boxes.camera((60, 80)))
    inside = frame.gbuffer.object_id == 1
    frame = frame.write("light", torch.where(inside, 0.2, 0.9))
    out = Atrous(**PLAIN, phi_color=1e6)(frame).read("light")
    assert float((out - frame.read("light")).abs().quantile(0.99)) < 0.002


def test_albedo_is_divided_out_of_gi():
    frame = boxes.frame()
    g = frame.gbuffer
    pattern = torch.rand((1, 3, *g.camera.size), generator=torch.Generator().manual_seed(5))
    frame = frame.replace(gbuffer=g.replace(albedo=pattern), gi=pattern.clamp_min(0.01) * 0.8 * g.hit)
    assert torch.allclose(Atrous()(frame).read("gi"), frame.read("gi"), atol=1e-5)


def test_mirrors_stay_sharp():
    frame = boxes.frame()
    g = frame.gbuffer
    white = torch.rand((1, 4, *g.camera.size), generator=torch.Generator().manual_seed(4))
    frame = frame.replace(reflection=white[:, :3], reflection_confidence=white[:, 3:])
    rough = {r: frame.replace(gbuffer=g.replace(roughness=torch.full_like(g.depth, r))) for r in (0.0, 0.6)}
    moved = {r: Atrous(signal="reflection")(f) for r, f in rough.items()}
    assert torch.allclose(moved[0.0].read("reflection"), white[:, :3], atol=1e-6)
    for name, before in (("reflection", white[:, :3]), ("reflection_confidence", white[:, 3:])):
        assert float((moved[0.6].read(name) - before).abs().mean()) > 0.1


@pytest.mark.parametrize("case", ["orthographic", "odd", "sky", "pixel", "double"])
def test_awkward_frames(case):
    size = {"odd": (127, 73), "pixel": (1, 1)}.get(case, (24, 32))
    camera = boxes.camera(size, orthographic=case == "orthographic")
    frame = noisy(boxes.frame(camera, boxes=boxes.ROOM + 500 if case == "sky" else boxes.ROOM))
    frame = frame.to(torch.float64) if case == "double" else frame
    out = Atrous(**PLAIN)(frame)
    assert out.read("light").dtype == frame.read("light").dtype
    assert bool(torch.isfinite(out.read("light")).all())
    if case in ("orthographic", "odd"):
        assert error(out) < 0.35 * error(frame)


def test_batch_equals_loop_and_module_equals_function():
    frames = [noisy(boxes.frame(boxes.camera((30, 40), dx=dx)), seed=3) for dx in (0.0, 0.7)]
    gs = [f.gbuffer for f in frames]
    camera = Camera(
        intrinsics=torch.cat([g.camera.intrinsics for g in gs]),
        world_from_view=torch.cat([g.camera.world_from_view for g in gs]),
        size=(30, 40),
        far=gs[0].camera.far,
    )
    together, left = atrous(
        torch.cat([f.read("light") for f in frames]),
        torch.cat([g.depth for g in gs]),
        torch.cat([g.normal for g in gs]),
        hit=torch.cat([g.hit for g in gs]),
        camera=camera,
    )
    for i, frame in enumerate(frames):
        out = Atrous(**PLAIN)(frame)
        assert torch.allclose(together[i], out.read("light")[0], atol=1e-6)
        assert torch.allclose(left[i], out.read("light_variance")[0], atol=1e-6)


def test_gradients():
    frame = noisy(boxes.frame(boxes.camera((4, 4)), boxes=boxes.ROOM[:1])).to(torch.float64)
    g = frame.gbuffer
    bumpy = g.depth * (1 + 0.002 * torch.rand(g.depth.shape, dtype=torch.float64, generator=torch.Generator()))
    inputs = (frame.read("light").requires_grad_(), bumpy.requires_grad_())

    def run(signal: Tensor, depth: Tensor) -> Tensor:
        return atrous(signal, depth, g.normal, hit=g.hit, camera=g.camera, iterations=1)[0]

    assert torch.autograd.gradcheck(run, inputs, fast_mode=True)
    (run(*inputs) ** 2).sum().backward()
    assert all(t.grad is not None and float(t.grad.abs().max()) > 1e-6 for t in inputs)


def test_error_helps():
    frame = noisy(boxes.frame(boxes.camera((12, 16))))
    g = frame.gbuffer
    with pytest.raises(ValueError, match="iterations must lie in 1 to 8, got 0"):
        atrous(frame.read("light"), g.depth, g.normal, hit=g.hit, camera=g.camera, iterations=0)
