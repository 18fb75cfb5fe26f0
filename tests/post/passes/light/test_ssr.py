"""Reflections: exact mirrors, Fresnel, roughness, sky, what is not on screen, gradients."""

from __future__ import annotations

import boxes
import mirrors
import pytest
import torch
from mirrors import SkyAlone
from torch import Tensor

import tracer
from gbufrt import Camera, Frame, Pass
from gbufrt.environment import lookup_environment
from gbufrt.tree import map_tensors
from post.passes.light.march_gi import MarchGI
from post.passes.light.ssr import SSR, ssr
from post.shading.ggx import grazing
from post.shading.lobes import Surface, ggx_ray, reuse_neighbors
from post.shading.sent_light import outgoing_light
from tracer.scene.placement import place


def shiny(camera: Camera | None = None, *, rough: float = 0.0, metal: float = 1.0, scene: Tensor = boxes.ROOM) -> Frame:
    """Boxes of one radiance each, without shading, so that a mirror's picture follows from the box that is hit."""
    frame = boxes.frame(camera or boxes.camera((90, 120)), boxes=scene)
    g = frame.gbuffer
    g = g.replace(
        roughness=torch.full_like(g.depth, rough),
        metallic=torch.full_like(g.depth, metal),
        albedo=torch.ones_like(g.depth).expand(-1, 3, -1, -1),
    )
    assert g.material_id is not None
    palette = torch.cat([torch.tensor([[0.5, 0.5, 0.5]]), boxes.ALBEDO])
    light = palette[g.material_id[:, 0].long()].permute(0, 3, 1, 2)
    return frame.replace(gbuffer=g, radiance=light, ambient=None)


def truth_of(frame: Frame) -> tuple[Tensor, mirrors.Truth]:
    truth = mirrors.intersect(frame.gbuffer.camera, *mirrors.reflected(frame))
    return boxes.ALBEDO[truth.box[:, 0]].permute(0, 3, 1, 2), truth


def of_sky_alone(frame: Frame) -> Tensor:
    return SkyAlone(samples=1)(frame).read("reflection")


def mean_of(frame: Frame, stage: SSR, frames: int) -> Tensor:
    return torch.stack([stage(frame.replace(index=i)).read("reflection") for i in range(frames)]).mean(0)


@pytest.mark.parametrize(("reflects", "signal"), [(SSR(), "reflection"), (MarchGI(distance=1e6), "gi")])
def test_without_thickness_units_do_not_matter(reflects: Pass, signal: str) -> None:
    frame = boxes.frame(boxes.camera((45, 60)))
    g, pose = frame.gbuffer.replace(thickness=None), frame.gbuffer.camera.world_from_view.clone()
    pose[:, :3, 3] *= 128
    near, far = 128 * g.camera.near, 128 * g.camera.far
    camera = Camera.from_intrinsics(g.camera.intrinsics, pose, size=g.camera.size, near=near, far=far)
    small = g.replace(camera=camera, previous_camera=None, motion=None, motion_z=None, depth=128 * g.depth)
    found, other = (reflects(frame.replace(gbuffer=one)).read(signal) for one in (g, small))
    assert float(found.mean()) > 0.01
    torch.testing.assert_close(other, found)


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("method", ["ggx", "cone"])
def test_a_mirror_shows_the_truth(orthographic, method):
    frame = shiny(boxes.camera((108, 144), orthographic=orthographic))
    result = SSR(samples=1, method=method, bounces=1)(frame)
    light, truth = truth_of(frame)
    shown, mean = truth.visible.expand_as(light), light[truth.visible.expand_as(light)].mean()
    error = (result.read("reflection") - light)[shown]
    assert error.square().mean().sqrt() < 0.1 * mean
    assert (error.abs() < 1e-3).float().mean() > 0.965
    assert (result.read("reflection_confidence")[truth.visible] > 0.99).float().mean() > 0.97
    apart = (result.read("reflection_distance") - truth.distance)[truth.visible] / truth.distance[truth.visible]
    assert apart.abs().quantile(0.95) < 1e-3


@pytest.mark.parametrize("polished", [False, True])
def test_a_mirror_in_a_mirror_shows_the_truth(polished: bool):
    """The wall shines before a uniform sky, all else are mirrors: rays by way of two of them bring either.

    Where the wall is polished, it mirrors the sky besides.
    """
    frame = shiny(boxes.camera((108, 144)))
    g, wall = frame.gbuffer, frame.read("material_id") == 2
    frame = frame.replace(radiance=torch.where(wall, frame.read("radiance"), 0.0))
    rough = torch.where(wall, 0.0 if polished else 1.0, 0.0)
    frame = frame.replace(gbuffer=g.replace(metallic=torch.where(wall, 0.0, 1.0), roughness=rough))
    points, directions = mirrors.reflected(frame)
    first = mirrors.intersect(g.camera, points, directions)
    ends, away = points + directions * first.distance, 2 * (directions * first.normal).sum(1, keepdim=True)
    turned = torch.where(first.hit, directions - away * first.normal, 0.0)
    second = mirrors.intersect(g.camera, ends, turned)
    gloss = 0.5 * (0.04 + 0.96 * grazing((turned * second.normal).sum(1).abs())) if polished else g.depth[:, 0] * 0
    once, twice = (SkyAlone(samples=1, bounces=k)(frame).read("reflection") for k in (1, 2))
    shown = first.visible & (first.box != 1) & g.hit & ~wall
    shines, misses = shown & second.visible & (second.box == 1), shown & ~second.hit
    for seen, light in ((shines, boxes.ALBEDO[1][:, None] + gloss[shines[:, 0]]), (misses, 0.5)):
        found = twice.movedim(1, 0)[:, seen[:, 0]]
        assert int(seen.sum()) > 20
        assert ((found - light).abs() < 1e-3).float().mean() > 0.9
        assert once.movedim(1, 0)[:, seen[:, 0]].median() == 0, "metals have no light of their own"


def test_no_metal_is_black_under_an_open_sky():
    """A ball of voxels: rays end in corners of its steps, and at sides that the camera does not see."""
    x, y, z = torch.meshgrid(*(torch.arange(13) - 6,) * 3, indexing="ij")
    gold = tracer.MaterialTable.of([tracer.Material(name="gold", albedo=(1.0, 0.7, 0.3), metallic=1.0, roughness=0.15)])
    scene = place(tracer.World.from_dense((x**2 + y**2 + z**2 < 36).short(), gold))
    frame = tracer.render(scene, scene.views["front"].camera(time=0.0, size=(60, 80)))
    metal = (frame.read("metallic") > 0.5)[:, 0]
    black = [SSR(samples=1, bounces=k)(frame).read("reflection")[:, 0][metal] < 0.02 for k in (1, 2)]
    assert black[0].float().mean() > 0.3
    assert black[1].float().mean() < 0.01


def test_sky_fills_what_leaves_the_screen():
    frame = shiny(scene=boxes.ROOM[:1])
    result = SkyAlone(samples=1)(frame)
    g = frame.gbuffer
    assert torch.allclose(result.read("reflection")[g.hit.expand(-1, 3, -1, -1)], torch.tensor(0.5), atol=1e-5)
    assert (result.read("reflection_confidence") == 0).all()
    assert (result.read("reflection_distance")[g.hit] == g.camera.far).all()
    assert (result.read("reflection")[~g.hit.expand(-1, 3, -1, -1)] == 0).all()
    dark = SkyAlone(samples=1)(frame.replace(environment=None))
    assert (dark.read("reflection") == 0).all()


def test_sky_in_the_mirror_is_the_sky_in_that_direction():
    frame = shiny(scene=boxes.ROOM[:1])
    sky = torch.rand(1, 3, 16, 32, generator=torch.Generator().manual_seed(1))
    result = of_sky_alone(frame.replace(environment=sky))
    _, direction = mirrors.reflected(frame)
    expected = lookup_environment(sky, direction) * frame.gbuffer.hit
    assert torch.allclose(result, expected, atol=1e-4)


def test_interiors_do_not_fill_with_sky():
    above = Camera.look_at((0.0, 6.0, 4.0), (0.0, 0.0, 0.0), size=(40, 50), fov_y=40.0, far=100.0)
    frame = shiny(above, scene=boxes.ROOM[:1])
    g = frame.gbuffer
    assert g.hit.all(), "every mirrored ray leaves the picture"
    whole = of_sky_alone(frame)
    closed = frame.replace(sky_visibility=torch.zeros_like(g.depth))
    assert of_sky_alone(closed).abs().max() == 0
    assert of_sky_alone(closed.replace(bent_normal=g.normal)).abs().max() == 0
    half = frame.replace(ao=torch.full_like(g.depth, 0.5))
    assert torch.allclose(of_sky_alone(half), 0.5 * whole)
    ajar = frame.replace(sky_visibility=torch.full_like(g.depth, 0.3))
    _, direction = mirrors.reflected(frame)
    facing = ajar.replace(bent_normal=direction)
    assert torch.allclose(of_sky_alone(facing), whole), "the mirror looks into the opening"
    beside = torch.tensor([0.0, 0.0, 1.0])[None, :, None, None].expand_as(direction)
    assert of_sky_alone(ajar.replace(bent_normal=beside)).max() == 0, "and here past it"
    assert of_sky_alone(boundless(frame)).max() > 0.4, "but a ray known to end in the sky finds it"


def test_the_sky_is_as_open_as_where_a_ray_was_last_seen():
    above = Camera.look_at((0.0, 6.0, 4.0), (0.0, 0.0, 0.0), size=(40, 50), fov_y=40.0, far=100.0)
    frame = shiny(above, scene=boxes.ROOM[:1])
    whole, inner = of_sky_alone(frame), (..., slice(1, -1), slice(1, -1))

    def with_border(visibility: float) -> Tensor:
        edge = torch.full_like(frame.gbuffer.depth, visibility)
        edge[inner] = 0.3
        return of_sky_alone(frame.replace(sky_visibility=edge))[inner]

    assert torch.allclose(with_border(0.8), 0.8 * whole[inner]), "out there it is more open"
    assert torch.allclose(with_border(0.1), 0.3 * whole[inner]), "a ray that leaves over a wall may still see past it"


def boundless(frame: Frame) -> Frame:
    """The floor viewed from its edge, with sky on screen and a sky visibility of zero."""
    level = shiny(boxes.camera((90, 120)), scene=boxes.ROOM[:1])
    return level.replace(sky_visibility=torch.zeros_like(level.gbuffer.depth), environment=frame.environment)


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


def test_reuse_weighs_rays_by_their_density():
    """Light only from off the lobe's middle: rays not weighted by their density would find too little of it."""
    ones = torch.ones(1, 1, 96, 96)
    up = torch.cat([0 * ones, 0 * ones, -ones], dim=1)
    eye = torch.nn.functional.normalize(up + torch.tensor([0.6, 0.0, 0.0])[None, :, None, None], dim=1)
    surface = Surface(0.1 * up, up, up, eye, 0.5 * ones, ones > 0)
    lobe = ggx_ray(surface, torch.rand(1, 2, 96, 96, generator=torch.Generator().manual_seed(2)), ones)
    mirrored = 2 * (eye * up).sum(1, keepdim=True) * up - eye
    light = ((lobe.direction * mirrored).sum(1, keepdim=True) < 0.6).float().expand(-1, 3, -1, -1)
    shared, reflected = reuse_neighbors(surface, lobe, torch.cat([lobe.direction, 0 * ones], dim=1), light, 8)
    found = (shared * (reflected[:, :1] + reflected[:, 1:2])).mean()
    expected = (light * lobe.weight).mean()
    assert expected > 0.1
    assert abs(float(found / expected) - 1) < 0.05


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


@pytest.mark.parametrize("compiled", [False, True])
@pytest.mark.parametrize("rough", [0.0, 0.5])
def test_metal_alone_under_a_sky_shows_it(rough: float, compiled: bool):
    """It sends no light but what it mirrors, and so no other by which to limit its samples."""
    lit = shiny(boxes.camera((36, 48)), rough=rough, scene=boxes.ROOM[:1])
    dark = lit.replace(radiance=torch.zeros_like(lit.read("radiance")))
    stage = SkyAlone(samples=1, reuse=0 if compiled else 1)  # reuse has no kernel
    shown, same = (stage(frame).read("reflection") for frame in (dark, lit))
    assert float(same.mean()) > 0.1
    torch.testing.assert_close(shown, same)


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
    frame = shiny()
    glow = torch.where(frame.gbuffer.material_id == 2, 5.0, 0.0).expand(-1, 3, -1, -1)
    lit = frame.replace(gbuffer=frame.gbuffer.replace(emission=glow), radiance=frame.read("radiance") + glow)
    plain, both = (SSR(samples=1)(one).read("reflection") for one in (frame, lit))
    assert float((both - plain).max()) > 1
    torch.testing.assert_close(SSR(samples=1)(lit.replace(emitters_mirrored=True)).read("reflection"), plain)


def test_light_adds_up():
    frame = boxes.frame()
    assert outgoing_light(frame.replace(ambient=None)) is frame.radiance
    half = torch.full_like(frame.gbuffer.depth, 0.5)
    gi = torch.ones_like(frame.read("radiance"))
    full = outgoing_light(frame.replace(ao=half, gi=gi))
    assert torch.allclose(full, frame.read("radiance") + 0.5 * frame.read("ambient") + 1)
    assert torch.equal(outgoing_light(frame.replace(ao=0 * half, sky_visibility=half, gi=gi)), full)


def test_module_equals_function():
    frame = shiny(rough=0.3).replace(ambient=None)
    g = frame.gbuffer
    assert g.roughness is not None
    result = SSR(samples=2, steps=32, reuse=2, seed=3)(frame)
    light = outgoing_light(frame)
    by_hand = ssr(
        g.depth, g.normal, g.camera, light, g.roughness, hit=g.hit, f0=torch.ones_like(light), metallic=g.metallic,
        normal_geo=g.normal_geo, thickness=g.thickness, environment=frame.environment, samples=2, steps=32, reuse=2,
        seed=3,
    )  # fmt: skip
    for name, tensor in zip(("reflection", "reflection_confidence", "reflection_distance"), by_hand, strict=True):
        assert torch.equal(result.read(name), tensor)


def test_batch_equals_loop_and_frames_differ():
    both = shiny(boxes.cameras(2, (40, 56)), rough=0.3)
    together = SSR(samples=2, reuse=3)(both).read("reflection")
    for k in range(2):
        one = map_tensors(lambda t, k=k: t[k : k + 1] if t.shape[0] == 2 else t, both)
        assert ((SSR(samples=2, reuse=3)(one).read("reflection")[0] - together[k]).abs() < 1e-3).float().mean() > 0.999
    later = SSR(samples=2)(both.replace(index=1)).read("reflection")
    assert not torch.allclose(SSR(samples=2)(both).read("reflection"), later)
    assert not torch.allclose(SSR(samples=2, seed=1)(both.replace(index=1)).read("reflection"), later)


@pytest.mark.parametrize("case", ["sky", "odd", "one row", "one column", "jittered", "orthographic"])
def test_awkward_frames(case):
    size = {"odd": (127, 73), "one row": (1, 9), "one column": (9, 1)}.get(case, (24, 32))
    camera = boxes.camera(size, orthographic=case == "orthographic")
    camera = camera.with_jitter((0.3, -0.4)) if case == "jittered" else camera
    frame = shiny(camera, rough=0.5, scene=boxes.ROOM + 500 if case == "sky" else boxes.ROOM)
    for method in ("ggx", "cone"):
        result = SSR(samples=2, reuse=1, method=method)(frame)
        for name in SSR.writes:
            assert torch.isfinite(result.read(name)).all()
        assert (result.read("reflection")[~frame.gbuffer.hit.expand(-1, 3, -1, -1)] == 0).all()


def test_gradients_reach_light_sky_and_reflectance():
    frame = shiny(boxes.camera((6, 8)), rough=0.3).to(torch.float64)
    g, light = frame.gbuffer, frame.read("radiance").double().requires_grad_()
    f0 = torch.full_like(light, 0.5).detach().requires_grad_()
    environment = torch.full((1, 3, 4, 8), 0.5, dtype=torch.float64, requires_grad=True)

    def run(light: Tensor, f0: Tensor, environment: Tensor) -> Tensor:
        assert g.roughness is not None
        return ssr(
            g.depth, g.normal, g.camera, light, g.roughness, hit=g.hit, f0=f0, thickness=g.thickness,
            environment=environment, samples=2, reuse=2,
        )[0]  # fmt: skip

    assert torch.autograd.gradcheck(run, (light, f0, environment), fast_mode=True)
    run(light, f0, environment).sum().backward()
    for tensor in (light, f0, environment):
        assert tensor.grad is not None
        assert tensor.grad.abs().sum() > 0.1


def test_wrong_arguments():
    frame = shiny(boxes.camera((8, 8)))
    with pytest.raises(ValueError, match="method"):
        SSR(method="box")(frame)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="samples"):
        SSR(samples=0)(frame)
    with pytest.raises(ValueError, match="bounces"):
        SSR(bounces=0)(frame)
