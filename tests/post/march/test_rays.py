"""Screen-space rays against rays traced through the same boxes, and the kernel against its torch reference."""

from __future__ import annotations

import boxes
import mirrors
import pytest
import torch
import torch.nn.functional as F

from gbufrt import Camera
from gbufrt.sampling import gather, sample
from post.march.rays import Hits, depth_hierarchy, march_rays, off_edge

CASES = ["perspective", "orthographic", "jittered"]


def view(case: str, size=(72, 96)) -> Camera:
    camera = boxes.camera(size, orthographic=case == "orthographic")
    return camera.with_jitter((0.3, -0.4)) if case == "jittered" else camera


def mirror(
    frame, *, assumed: float | None = None, compiled: bool | None = None, **options
) -> tuple[Hits, mirrors.Truth]:
    """Every surface a mirror: screen-space hits and the truth."""
    g = frame.gbuffer
    points, directions = mirrors.reflected(frame)
    solid = g.thickness if assumed is None else assumed
    hierarchy = depth_hierarchy(g.depth, g.normal, g.camera, hit=g.hit, thickness=solid)
    flying = g.camera.rotate_to_view(directions)
    hits = march_rays(hierarchy, g.points_view(), flying, g.camera, compiled=compiled, **options)
    return hits, mirrors.intersect(g.camera, points, directions)


@pytest.mark.parametrize("case", CASES)
def test_finds_the_exact_mirrored_place(case):
    hits, truth = mirror(boxes.frame(view(case, (135, 180))), steps=128)
    sure = truth.visible & hits.hit
    assert truth.visible.float().mean() > 0.08
    assert sure.sum() >= 0.985 * truth.visible.sum()
    assert (hits.hit & ~truth.visible).sum() <= 0.015 * truth.visible.sum()
    error = (hits.px - truth.px).norm(dim=1, keepdim=True)[sure]
    assert (error < 1.0).float().mean() > 0.99
    assert error.median() < 1e-2
    apart = ((hits.distance - truth.distance).abs() / truth.distance)[sure]
    assert apart.quantile(0.97) < 1e-4


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("assumed", [None, 0.4])
def test_kernel_equals_reference(case, assumed):
    frame = boxes.frame(view(case))
    fast, _ = mirror(frame, assumed=assumed, compiled=True)
    slow, _ = mirror(frame, assumed=assumed, compiled=False)
    same = (fast.hit == slow.hit) & (fast.blocked == slow.blocked) & (fast.spent == slow.spent)
    assert same.float().mean() > 0.999
    for name in ("px", "distance", "agreement"):
        apart = (getattr(fast, name) - getattr(slow, name)).abs()[same.expand_as(getattr(fast, name))]
        assert apart.quantile(0.999) < 1e-3, name


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize("half", [False, True])
def test_an_open_floor_never_meets_itself(compiled, half):
    frame = boxes.frame(boxes.camera((60, 80)), boxes=boxes.ROOM[:1])
    g = frame.gbuffer
    depth = g.depth.half().float() if half else g.depth
    hierarchy = depth_hierarchy(depth, g.normal, g.camera, hit=g.hit)
    points = g.camera.unproject(depth)
    generator = torch.Generator().manual_seed(1)
    wild = torch.randn(points.shape, generator=generator)
    wild[:, 1] = wild[:, 1].abs() * 0.05 + 0.02  # grazing, upward
    wild = torch.where(g.hit, wild / wild.norm(dim=1, keepdim=True), 0.0)
    hits = march_rays(hierarchy, points, g.camera.rotate_to_view(wild), g.camera, compiled=compiled)
    assert (hits.hit | hits.blocked).float().mean() <= (2e-3 if half else 0.0)


def pole_scene() -> tuple:
    """A wall behind a thin pole; a ray along the wall's face, a unit in front of it, passes behind the pole."""
    scene = torch.tensor([[[-20.0, -20.0, -12.0], [20.0, 20.0, -11.0]], [[-0.2, -20.0, -4.4], [0.2, 20.0, -4.0]]])
    camera = Camera.look_at((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), size=(48, 64), far=100.0)
    g = boxes.frame(camera, boxes=scene).gbuffer
    start = torch.tensor([-3.0, 0.01, -10.0])
    way = torch.tensor([1.0, 0.0, -0.25])
    return g, camera.to_view(start[None, :, None, None]), camera.rotate_to_view((way / way.norm())[None, :, None, None])


@pytest.mark.parametrize("compiled", [True, False])
def test_rays_pass_behind_what_is_thin(compiled):
    g, start, way = pole_scene()
    assert g.thickness is not None
    measured = depth_hierarchy(g.depth, g.normal, g.camera, hit=g.hit, thickness=g.thickness)
    hits = march_rays(measured, start, way, g.camera, compiled=compiled)
    assert hits.hit.all()
    assert abs(float(hits.distance) - (1 + 0.25**2) ** 0.5 * 4) < 1e-3, "it hits the wall at x = 1"
    thick = depth_hierarchy(g.depth, g.normal, g.camera, hit=g.hit, thickness=20.0)
    hits = march_rays(thick, start, way, g.camera, compiled=compiled)
    assert hits.blocked.all(), "a pole taken for a slab stops the ray, at a side that nobody sees"
    assert not hits.hit.any()


def behind_a_pole(compiled: bool) -> tuple:
    """A ray to the wall at x = 0, where the pole hides it: G-buffer, start, hierarchy, hits."""
    g, start, _ = pole_scene()
    way = g.camera.rotate_to_view(torch.tensor([3.0, 0.0, -1.0])[None, :, None, None] / 10**0.5)
    hierarchy = depth_hierarchy(g.depth, g.normal, g.camera, hit=g.hit, thickness=g.thickness)
    hits = march_rays(hierarchy, start, way, g.camera, compiled=compiled)
    return g, start, hierarchy, hits


@pytest.mark.parametrize("compiled", [True, False])
def test_what_goes_on_behind_a_pole_ends_rays(compiled):
    g, _, _, hits = behind_a_pole(compiled)
    assert hits.blocked.all(), "it hits the wall at x = 0, where the pole hides it"
    assert abs(float(hits.distance) - 10**0.5) < 1e-3
    assert abs(float(sample(g.depth, hits.px)) - 15.0) < 1e-3, "and reads the wall beside the pole"


def test_reads_at_hits_do_not_mix_surfaces():
    frame = boxes.frame(boxes.camera((135, 180)))
    hits, _ = mirror(frame)
    box = frame.gbuffer.material_id
    assert box is not None
    one_hot = torch.cat([(box == k).float() for k in (1, 2, 3, 4)], dim=1)
    read = sample(one_hot, hits.px).amax(1, keepdim=True)[hits.hit]
    assert (read > 0.999).float().mean() > 0.995
    assert (sample(one_hot, hits.px).sum(1, keepdim=True)[hits.hit] > 0.999).all(), "nor the sky"


def test_steps_and_distance_end_rays():
    frame = boxes.frame(boxes.camera((72, 96)))
    full, truth = mirror(frame, steps=256, distance=100.0)
    short, _ = mirror(frame, steps=256, distance=5.0)
    assert (short.hit & (short.distance > 5.0 + 1e-3)).sum() == 0
    near = truth.visible & (truth.distance < 4.9)
    assert torch.equal(short.hit[near], full.hit[near])
    assert short.spent.sum() > full.spent.sum()
    few, _ = mirror(frame, steps=2)
    assert few.hit.sum() < full.hit.sum()


def test_sky_stops_no_ray_and_nothing_flies_from_nowhere():
    frame = boxes.frame(boxes.camera((20, 30)), boxes=boxes.ROOM + 500)
    g = frame.gbuffer
    hierarchy = depth_hierarchy(g.depth, g.normal, g.camera, hit=g.hit)
    origins = g.camera.unproject(torch.full_like(g.depth, 5.0))
    for directions in (torch.zeros_like(origins), torch.nn.functional.normalize(torch.ones_like(origins), dim=1)):
        hits = march_rays(hierarchy, origins, directions, g.camera)
        assert not hits.hit.any()
        assert not hits.blocked.any()
        assert all(torch.isfinite(t).all() for t in hits if t.is_floating_point())


def test_batch_equals_loop_and_any_size():
    for size in ((1, 1), (1, 9), (9, 1), (127, 73)):
        cams = [boxes.camera(size, dx=0.3 * k) for k in range(2)]
        both = Camera(
            intrinsics=torch.cat([c.intrinsics for c in cams]),
            world_from_view=torch.cat([c.world_from_view for c in cams]),
            size=size,
            far=100.0,
        )
        together, _ = mirror(boxes.frame(both))
        for k, camera in enumerate(cams):
            alone, _ = mirror(boxes.frame(camera))
            same = alone.hit[0] == together.hit[k]
            assert same.float().mean() > 0.999
            assert ((alone.px[0] - together.px[k]).abs() * same).median() < 1e-3


def test_wrong_arguments():
    g = boxes.frame(boxes.camera((8, 8))).gbuffer
    with pytest.raises(ValueError, match=r"depth must be \(1,1,8,8\)"):
        depth_hierarchy(g.depth[..., :4], g.normal, g.camera, hit=g.hit)
    hierarchy = depth_hierarchy(g.depth, g.normal, g.camera, hit=g.hit)
    with pytest.raises(ValueError, match="steps"):
        march_rays(hierarchy, g.points_view(), g.normal, g.camera, steps=0)


def test_operator_is_registered_properly():
    from post.march.op import march_rays_cpu

    g = boxes.frame(boxes.camera((6, 8))).gbuffer
    hierarchy = depth_hierarchy(g.depth, g.normal, g.camera, hit=g.hit)
    lens = torch.ones(1, 4, dtype=torch.float64)
    arguments = (*hierarchy, lens, g.points_view(), g.normal, 0.05, False, 10.0, 8)
    torch.library.opcheck(march_rays_cpu, arguments, test_utils=("test_schema", "test_faketensor"))


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize("radius", [1.0, 0.2])
def test_a_mirror_ball_does_not_shadow_itself(compiled, radius):
    """No ray that a ball reflects meets the ball again; its rim is the steepest that surfaces are."""
    camera, centre = Camera.look_at((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), size=(72, 96)), (0.1, -0.05, 4.0)
    ray = F.normalize(camera.unproject(torch.ones(1, 1, 72, 96)), dim=1)
    middle = torch.tensor(centre)[None, :, None, None].expand_as(ray)
    along = (ray * middle).sum(1, keepdim=True)
    half = radius**2 - (middle - along * ray).square().sum(1, keepdim=True)
    ball = half > 0
    wall = ray * (9.0 / ray[:, 2:])
    points = torch.where(ball, ray * (along - half.clamp_min(0.0).sqrt()), wall)
    facing = torch.where(ball, (points - middle) / radius, torch.tensor([0.0, 0.0, -1.0])[None, :, None, None])
    way = torch.where(ball, ray - 2 * (ray * facing).sum(1, keepdim=True) * facing, 0.0)
    solid = torch.where(ball, 2 * half.clamp_min(0.0).sqrt(), 1.0)
    hierarchy = depth_hierarchy(points[:, 2:], camera.rotate_to_world(facing), camera, thickness=solid)
    hits = march_rays(hierarchy, points, way, camera, distance=50.0, compiled=compiled)
    assert ball.sum() > 20
    assert not hits.blocked.any()
    found = gather(ball, hits.px[:, 0].floor(), hits.px[:, 1].floor())
    assert not (hits.hit & found).any(), "nor hit"
    assert (hits.hit & ~found).sum() > 0.05 * ball.sum(), "the rim shows the wall"


@pytest.mark.parametrize("compiled", [True, False])
def test_hidden_geometry_is_read_off_the_edge(compiled):
    """A wall that goes on behind a pole has the light of its second pixel beside the pole."""
    g, start, hierarchy, hits = behind_a_pole(compiled)
    begun = g.camera.project(start, jittered=True).floor() + 0.5
    away = off_edge(hits, hierarchy, g.camera, begun)
    assert torch.equal(away.px - hits.px, torch.tensor([-1.0, 0.0])[None, :, None, None])
    column, row = (int(x) for x in hits.px.flatten())
    depth = g.depth.clone()
    depth[..., row, column - 1] += 0.5
    other = depth_hierarchy(depth, g.normal, g.camera, hit=g.hit, thickness=g.thickness)
    assert torch.equal(off_edge(hits, other, g.camera, begun).px, hits.px), "another surface is not read"
    assert torch.equal(off_edge(hits._replace(blocked=~hits.blocked), hierarchy, g.camera, begun).px, hits.px)
