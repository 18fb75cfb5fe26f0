"""Joint bilateral denoise."""

from __future__ import annotations

import boxes
import kornia
import pytest
import torch
from torch import Tensor

from gbufrt import Frame, Pipeline
from gbufrt.tree import map_tensors
from post.passes.denoising.bilateral import Bilateral, bilateral


def shaded(frame: Frame) -> Tensor:
    """A value a face, darker toward the ground and in the shadow of something off-screen."""
    g = frame.gbuffer
    x, height, z = g.camera.to_world(g.points_view()).unbind(1)
    shadow = 1 - 0.4 * ((x > -4) & (x < -0.5) & (z > -1))
    value = 0.35 + 0.5 * g.normal[:, 1].abs() - 0.1 * torch.exp(-height.clamp_min(0))
    return torch.where(g.hit, (value * shadow)[:, None], 1.0)


def noisy(frame: Frame, sigma: float = 0.15, seed: int = 0) -> Frame:
    truth = shaded(frame)
    noise = torch.randn(truth.shape, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)
    return frame.replace(ao=truth + sigma * noise.to(truth) * frame.gbuffer.hit)


def psnr(frame: Frame, signal: Tensor) -> float:
    error = (signal - shaded(frame))[frame.gbuffer.hit]
    return float(-10 * torch.log10((error**2).mean()))


def test_noise_falls_on_a_plane_by_the_number_of_taps():
    """The variance left on a floor is the sum of squared normalized weights."""
    frame = boxes.frame(boxes.camera((192, 192)), boxes=boxes.ROOM[:1])
    g = frame.gbuffer
    white = torch.randn((1, 1, 192, 192), generator=torch.Generator().manual_seed(1))
    tunables = {"radius": 4, "sigma": 3.0, "variance_sensitivity": 1e6, "phi_color": 1e6}
    out = bilateral(white, g.depth, g.normal, hit=g.hit, camera=g.camera, **tunables)
    reach = torch.arange(-4, 5.0)
    squared = reach[:, None] ** 2 + reach[None] ** 2
    weight = torch.exp(-squared / 18)
    inner = torch.zeros_like(g.hit)
    inner[..., 4:-4, 4:-4] = True
    whole = inner & (torch.nn.functional.avg_pool2d(g.hit.float(), 9, 1, 4) > 0.999)
    expected = float((weight**2).sum() / weight.sum() ** 2)
    assert float(out[whole].var()) == pytest.approx(expected, rel=0.15)


def test_slanted_floor_is_not_cut():
    """Depth changes a lot along a grazing floor, plane distance does not."""
    frame = boxes.frame(boxes.camera((48, 64)), boxes=boxes.ROOM[:1])
    assert psnr(frame, Bilateral()(noisy(frame)).read("ao")) > psnr(frame, noisy(frame).read("ao")) + 12


def test_beats_kornias_joint_bilateral():
    frame = noisy(boxes.frame(boxes.camera((90, 120))))
    g = frame.gbuffer
    guide = torch.cat([g.depth / g.depth[g.hit].max(), g.normal], dim=1)
    theirs = max(
        psnr(frame, kornia.filters.joint_bilateral_blur(frame.read("ao"), guide, (9, 9), color, (3.0, 3.0)))
        for color in (0.02, 0.05, 0.1, 0.2)
    )
    assert psnr(frame, Bilateral()(frame).read("ao")) > theirs + 0.3


def test_constant_signal_stays():
    frame = boxes.frame()
    frame = frame.replace(ao=torch.full_like(frame.gbuffer.depth, 0.7))
    assert torch.allclose(Bilateral()(frame).read("ao"), frame.read("ao"), atol=1e-6)


def test_sky_keeps_its_value_and_gives_none_away():
    frame = boxes.frame(boxes.camera((40, 50)), boxes=boxes.ROOM[2:])
    hit = frame.gbuffer.hit
    frame = frame.replace(ao=torch.where(hit, 0.25, 1e6))
    out = Bilateral()(frame).read("ao")
    assert bool((out[~hit] == 1e6).all())
    assert torch.allclose(out[hit], torch.full_like(out[hit], 0.25))


def test_surfaces_do_not_mix():
    frame = boxes.frame(boxes.camera((60, 80)))
    inside = frame.gbuffer.object_id == 1
    frame = frame.replace(ao=torch.where(inside, 0.2, 0.9))
    out = Bilateral()(frame).read("ao")
    assert float((out - frame.read("ao")).abs().quantile(0.99)) < 0.02


def test_kernel_is_wider_where_noise_is():
    frame = boxes.frame(boxes.camera((48, 64)), boxes=boxes.ROOM[:1])
    g, generator = frame.gbuffer, torch.Generator().manual_seed(6)
    ao = 0.6 + 0.1 * torch.randn(g.depth.shape, generator=generator)

    def left(variance: float) -> float:
        known = torch.full_like(ao, variance)
        out = bilateral(ao, g.depth, g.normal, hit=g.hit, camera=g.camera, variance=known, phi_color=1e6)
        return float(out[g.hit].var())

    assert left(1.0) < 0.7 * left(1e-8)


def test_edge_of_light_is_kept_when_it_stands_out_of_the_noise():
    frame = boxes.frame(boxes.camera((48, 64)), boxes=boxes.ROOM[:1])
    x = torch.arange(64)[None, None, None]
    truth = torch.where(x < 32, 0.2, 0.8).expand(1, 1, 48, 64)
    white = torch.randn(truth.shape, generator=torch.Generator().manual_seed(2))
    out = Bilateral()(frame.replace(ao=truth + 0.05 * white)).read("ao")
    near = (x >= 28) & (x < 36) & frame.gbuffer.hit
    assert float((out - truth)[near].abs().mean()) < 0.05


def test_ao_and_bent_normal_share_weights():
    frame = noisy(boxes.frame())
    g = frame.gbuffer
    shaken = g.normal + 0.3 * torch.randn(g.normal.shape, generator=torch.Generator().manual_seed(3))
    frame = frame.replace(bent_normal=torch.where(g.hit, shaken / shaken.norm(dim=1, keepdim=True), 0.0))
    out = Bilateral(signal=("ao", "bent_normal"))(frame)
    bent = out.read("bent_normal")
    assert torch.allclose(bent.norm(dim=1, keepdim=True)[g.hit], torch.ones(()), atol=1e-4)
    before = (frame.read("bent_normal") * g.normal).sum(1, keepdim=True)[g.hit].mean()
    assert float((bent * g.normal).sum(1, keepdim=True)[g.hit].mean()) > float(before) + 0.5 * (1 - float(before))
    assert torch.allclose(out.read("ao"), Bilateral()(frame).read("ao"), atol=1e-6)


def test_mirrors_stay_sharp_and_confidence_is_filtered_along():
    frame = boxes.frame()
    g = frame.gbuffer
    white = torch.rand((1, 4, *g.camera.size), generator=torch.Generator().manual_seed(4))
    frame = frame.replace(reflection=white[:, :3], reflection_confidence=white[:, 3:])

    def moved(roughness: float) -> float:
        rough = frame.replace(gbuffer=g.replace(roughness=torch.full_like(g.depth, roughness)))
        out = Bilateral(signal="reflection", phi_color=100.0)(rough)
        both = torch.cat([out.read("reflection"), out.read("reflection_confidence")], dim=1)
        return float((both - white).abs().mean(dim=(0, 2, 3)).min())

    assert moved(0.0) < 1e-6
    assert moved(0.5) > 0.1


def test_reflections_are_sharp_near_what_they_show():
    """A lobe widens with distance: no blur at the foot of an object, and far away as much as the noise asks."""
    frame = noisy(boxes.frame(boxes.camera((48, 64)), boxes=boxes.ROOM[:1]))
    g, light = frame.gbuffer, frame.read("ao").expand(-1, 3, -1, -1)
    stage, glossy = Bilateral(signal="reflection"), g.replace(roughness=torch.full_like(g.depth, 0.2))
    frame = frame.replace(reflection=light, gbuffer=glossy)

    def left(distance: float) -> float:
        far = torch.full_like(g.depth, distance)
        out = stage(frame.replace(reflection_distance=far)).read("reflection")[:, :1]
        return float((out - shaded(frame))[g.hit].square().mean().sqrt())

    blurred = stage(frame).read("reflection")[:, :1]
    everywhere = float((blurred - shaded(frame))[g.hit].square().mean().sqrt())
    assert left(0.0) == pytest.approx(0.15, rel=0.05)  # as noisy as it was
    assert everywhere < left(5.0) < 0.9 * left(0.0)
    assert left(1000.0) == pytest.approx(everywhere, rel=0.02)


def test_albedo_is_divided_out():
    frame = boxes.frame()
    g = frame.gbuffer
    assert g.albedo is not None
    pattern = torch.rand(g.albedo.shape, generator=torch.Generator().manual_seed(5))
    frame = frame.replace(gbuffer=g.replace(albedo=pattern), gi=pattern.clamp_min(0.01) * 0.8)
    assert torch.allclose(Bilateral(signal="gi")(frame).read("gi"), frame.read("gi"), atol=1e-5)
    assert not torch.allclose(Bilateral(signal="gi", demodulate=False)(frame).read("gi"), frame.read("gi"), atol=1e-2)


@pytest.mark.parametrize("case", ["orthographic", "odd", "sky", "pixel", "double"])
def test_awkward_frames(case):
    size = {"odd": (127, 73), "pixel": (1, 1)}.get(case, (24, 32))
    camera = boxes.camera(size, orthographic=case == "orthographic")
    frame = noisy(boxes.frame(camera, boxes=boxes.ROOM + 500 if case == "sky" else boxes.ROOM))
    frame = frame.to(torch.float64) if case == "double" else frame
    out = Bilateral()(frame).read("ao")
    assert out.dtype == frame.read("ao").dtype
    assert bool(torch.isfinite(out).all())
    if case in ("orthographic", "odd"):
        assert psnr(frame, out) > psnr(frame, frame.read("ao")) + 6


def test_batch_equals_loop_and_module_equals_function():
    one, two = (noisy(boxes.frame(boxes.camera((30, 40), dx=dx)), seed=3) for dx in (0.0, 0.7))
    g, ao = one.gbuffer, one.read("ao")
    both = bilateral(
        torch.cat([ao, two.read("ao")]),
        torch.cat([g.depth, two.gbuffer.depth]),
        torch.cat([g.normal, two.gbuffer.normal]),
        hit=torch.cat([g.hit, two.gbuffer.hit]),
        camera=_pair(one, two),
    )
    for i, frame in enumerate((one, two)):
        assert torch.allclose(both[i : i + 1], Bilateral()(frame).read("ao"), atol=1e-6)


def _pair(one: Frame, two: Frame):
    a, b = one.gbuffer.camera, two.gbuffer.camera
    world = torch.cat([a.world_from_view, b.world_from_view])
    return type(a)(intrinsics=a.intrinsics.repeat(2, 1, 1), world_from_view=world, size=a.size, far=a.far)


def test_gradients():
    frame = noisy(boxes.frame(boxes.camera((5, 6)), boxes=boxes.ROOM[:1])).to(torch.float64)
    g = frame.gbuffer
    bumpy = g.depth * (1 + 0.002 * torch.rand(g.depth.shape, dtype=torch.float64, generator=torch.Generator()))
    inputs = (frame.read("ao").requires_grad_(), bumpy.requires_grad_())

    def run(signal: Tensor, depth: Tensor) -> Tensor:
        return bilateral(signal, depth, g.normal, hit=g.hit, camera=g.camera, radius=1)

    assert torch.autograd.gradcheck(run, inputs, fast_mode=True)
    (run(*inputs) ** 2).sum().backward()
    assert all(t.grad is not None and float(t.grad.abs().max()) > 1e-6 for t in inputs)


def test_input_is_left_alone_and_errors_help():
    frame = noisy(boxes.frame(boxes.camera((12, 16))))
    kept = map_tensors(torch.clone, frame)
    Pipeline(given={"ao"}, denoise=Bilateral())(frame)
    assert torch.equal(kept.read("ao"), frame.read("ao"))
    g = frame.gbuffer
    with pytest.raises(ValueError, match="radius must be at least 1"):
        bilateral(frame.read("ao"), g.depth, g.normal, hit=g.hit, camera=g.camera, radius=0)
    with pytest.raises(ValueError, match=r"depth must be \(1,C,12,16\)"):
        bilateral(frame.read("ao"), g.depth[..., 1:], g.normal, hit=g.hit, camera=g.camera)
    with pytest.raises(ValueError, match="signal must be a name"):
        Bilateral(signal=())
