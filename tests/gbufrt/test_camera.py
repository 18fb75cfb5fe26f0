"""Where pixels look: each row of the conventions table that concerns cameras."""

from __future__ import annotations

import math

import boxes
import pytest
import torch

from gbufrt import Camera

EYE = torch.eye(4)
K = torch.tensor([[100.0, 0.0, 32.0], [0.0, 100.0, 24.0], [0.0, 0.0, 1.0]])


SHARES = torch.tensor([[1.56, 0.0, 0.5], [0.0, 2.1, 0.5], [0.0, 0.0, 1.0]])  # of the picture's sides


def pose(**axes: tuple[float, float, float]) -> torch.Tensor:
    """The identity with some of its axes, by name, replaced."""
    matrix = EYE.clone()
    for name, axis in axes.items():
        matrix[:3, "xyz".index(name)] = torch.tensor(axis)
    return matrix


def make(**changes) -> Camera:
    return Camera.from_intrinsics(K, EYE, size=(48, 64), **changes)


def test_pixel_centres_are_at_half():
    centers = make().pixel_centers()
    assert centers.shape == (1, 2, 48, 64)
    assert centers[0, :, 0, 0].tolist() == [0.5, 0.5]
    assert centers[0, :, 2, 7].tolist() == [7.5, 2.5]


def test_jitter_moves_the_sample_and_nothing_else():
    camera = make().with_jitter((0.25, -0.5))
    assert camera.pixel_centers()[0, :, 0, 0].tolist() == [0.75, 0.0]
    assert camera.pixel_centers(jittered=False)[0, :, 0, 0].tolist() == [0.5, 0.5]
    points = camera.unproject(torch.full((1, 1, 48, 64), 5.0))
    torch.testing.assert_close(camera.project(points), camera.pixel_centers(), atol=1e-4, rtol=0)
    torch.testing.assert_close(
        camera.project(points, jittered=True), camera.pixel_centers(jittered=False), atol=1e-4, rtol=0
    )


def test_view_space_is_right_down_forward():
    x, y, z = make().unproject(torch.full((1, 1, 48, 64), 2.0))[0, :, 0, -1]
    assert x > 0
    assert y < 0, "the top of the picture has negative view y"
    assert z == 2


@pytest.mark.parametrize("orthographic", [False, True])
def test_project_inverts_unproject(orthographic):
    camera = boxes.camera((9, 13), orthographic=orthographic)
    depth = torch.rand(1, 1, 9, 13) * 20 + 1
    points = camera.unproject(depth)
    torch.testing.assert_close(camera.project(points), camera.pixel_centers(), atol=1e-4, rtol=0)
    torch.testing.assert_close(camera.to_view(camera.to_world(points)), points, atol=1e-4, rtol=1e-5)


@pytest.mark.parametrize("orthographic", [False, True])
def test_rays_pass_through_unprojected_points(orthographic):
    camera = boxes.camera((9, 13), orthographic=orthographic)
    origin, direction = camera.rays()
    torch.testing.assert_close(direction.norm(dim=-1), torch.ones(1, 9, 13))
    world = camera.to_world(camera.unproject(torch.full((1, 1, 9, 13), 7.0))).permute(0, 2, 3, 1)
    offset = world - origin
    assert torch.linalg.cross(offset, direction).norm(dim=-1).max() < 1e-4
    assert (offset * direction).sum(-1).min() > 0


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("jitter", [None, (0.3, -0.4)])
def test_depth_along_rays_is_that_of_their_directions(orthographic, jitter):
    camera = make(orthographic=orthographic).with_jitter(jitter)
    away = -camera.to_eye(camera.unproject(torch.ones(1, 1, 48, 64)))
    assert torch.equal(camera.along_axis(torch.float32), away[:, 2:])


def test_look_at_sees_up_as_up():
    camera = Camera.look_at((0, 0, 5), (0, 0, 0), size=(48, 64))
    point = camera.project(camera.to_view(torch.tensor([[0.5, 1.0, 0.0]]).reshape(1, 3, 1)))[0, :, 0]
    assert point[0] > 32, "world +x is on the right when looking along -z"
    assert point[1] < 24, "world +y is up, toward row 0"
    assert torch.det(camera.world_from_view[0, :3, :3]) == pytest.approx(1.0, abs=1e-6)


def test_static_motion_matches_projection_of_the_same_point():
    camera, previous = boxes.camera((24, 32), dx=0.4), boxes.camera((24, 32))
    f = boxes.frame(camera, previous=previous)
    g = f.gbuffer
    assert g.motion is not None
    world = camera.to_world(g.points_view())
    expected = previous.project(previous.to_view(world)) - camera.pixel_centers()
    torch.testing.assert_close(torch.where(g.hit, g.motion, 0), torch.where(g.hit, expected, 0), atol=1e-3, rtol=0)
    assert g.motion[0, 0][g.hit[0, 0]].mean() > 0, "the camera went right, so points came from further right"


def test_what_was_behind_the_camera_before_moves_off_its_picture():
    size = (48, 64)
    camera = Camera.look_at((0.0, 1.0, 9.0), (0.0, 1.0, 0.0), size=size)
    previous = Camera.look_at((0.1, 1.2, -3.0), (0.1, 1.2, -9.0), size=size)  # the box lies behind it
    g = boxes.frame(camera).gbuffer
    motion, motion_z = camera.static_motion(previous, g.depth, g.hit)
    behind = g.hit & (g.depth + motion_z < previous.near)
    assert 0.05 < float(behind.float().mean()) < 0.95
    there = camera.pixel_centers() + motion
    outside = ((there < 0) | (there > there.new_tensor([64.0, 48.0]).view(1, 2, 1, 1))).any(1, keepdim=True)
    assert bool(outside[behind].all())
    assert float(motion.abs().amax(1, keepdim=True)[behind].max()) <= 2 * 64
    exact = previous.project(previous.to_view(camera.to_world(g.points_view()))) - camera.pixel_centers()
    seen = g.hit & ~behind
    assert torch.equal(motion.where(seen, 0), exact.where(seen, 0))


def test_sky_moves_by_rotation_alone():
    depth, miss = torch.full((1, 1, 48, 64), 1000.0), torch.zeros(1, 1, 48, 64, dtype=torch.bool)
    moved = make().to(torch.float64)
    pose = EYE.clone()
    pose[0, 3] = 3.0
    previous = Camera.from_intrinsics(K, pose, size=(48, 64))
    motion, motion_z = moved.static_motion(previous, depth, miss)
    assert motion.abs().max() < 1e-4
    assert motion_z.abs().max() == 0
    angle = torch.tensor(0.05)
    turn = torch.tensor([[angle.cos(), 0, angle.sin()], [0, 1, 0], [-angle.sin(), 0, angle.cos()]])
    pose = EYE.clone()
    pose[:3, :3] = turn
    motion, _ = make().static_motion(Camera.from_intrinsics(K, pose, size=(48, 64)), depth, miss)
    assert motion[0, 0, 24, 32] == pytest.approx(-100 * float(torch.tan(angle)), abs=0.1)


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("jitter", [None, (0.3, -0.2)])
def test_normals_from_depth_face_the_camera(orthographic, jitter):
    camera = boxes.camera((60, 80), orthographic=orthographic).with_jitter(jitter)
    g = boxes.frame(camera, boxes=boxes.ROOM[:1]).gbuffer
    inner = g.hit[0, 0].clone()
    inner[:30] = False  # below the horizon, away from the border's one-sided differences
    inner[-2:], inner[:, :2], inner[:, -2:] = False, False, False
    inner &= g.normal[0, 1] > 0.5  # parallel rays that start below the floor see its underside
    inner[1:-1] &= inner[2:] & inner[:-2]
    cosine = (camera.normals_from_depth(g.depth) * g.normal).sum(1)[0]
    assert cosine[inner].min() > 0.999


def test_pixels_per_unit():
    depth = torch.full((1, 1, 48, 64), 4.0)
    assert make().pixels_per_unit(depth).mean() == pytest.approx(25.0)
    assert make(orthographic=True).pixels_per_unit(depth).mean() == pytest.approx(100.0)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"size": (0, 10)}, "size must be"),
        ({"near": 2.0, "far": 1.0}, "near < far"),
        ({"far": math.inf}, "finite"),
        ({"intrinsics": SHARES, "size": (90, 160)}, "multiply the first row by the width"),
        ({"world_from_view": torch.eye(3)}, "world_from_view"),
        ({"intrinsics": torch.eye(4)}, "intrinsics"),
        ({"jitter": torch.zeros(3)}, "jitter"),
        ({"jitter": torch.full((1, 2), torch.nan)}, "jitter must be finite"),
        ({"intrinsics": K * 2}, "divide by the last element"),
        ({"intrinsics": K + torch.tensor([[0, 0.5, 0], [0, 0, 0], [0, 0, 0]])}, "leave skew and flips out"),
        ({"intrinsics": K * torch.tensor([[1.0], [-1.0], [1.0]])}, "fx and fy above 0"),
        ({"intrinsics": K * torch.nan}, "intrinsics must be"),
        ({"world_from_view": EYE * 2}, r"end in the row \(0, 0, 0, 1\)"),
        ({"world_from_view": pose(x=(2.0, 0.0, 0.0))}, "lengths 2, 1, 1; divide"),
        ({"world_from_view": pose(x=(1.001, 0.0, 0.0))}, "lengths 1.001, 1, 1"),
        ({"world_from_view": pose(y=(0.6, 0.8, 0.0))}, "skewed, with a cosine of 0.6"),
        ({"world_from_view": pose(y=(0.0, -1.0, 0.0))}, "it mirrors; negate one"),
        ({"world_from_view": EYE * torch.nan}, "must be finite"),
        ({"world_from_view": torch.stack([EYE, pose(z=(0.0, 0.0, -1.0))])}, "it mirrors"),
    ],
)
def test_bad_cameras_name_the_argument(changes, message):
    arguments = {"intrinsics": K, "world_from_view": EYE, "size": (4, 4), **changes}
    with pytest.raises(ValueError, match=message):
        Camera.from_intrinsics(arguments.pop("intrinsics"), arguments.pop("world_from_view"), **arguments)


def test_look_at_refuses_degenerate_views():
    with pytest.raises(ValueError, match="one line"):
        Camera.look_at((0, 5, 0), (0, 0, 0), size=(4, 4))
    with pytest.raises(ValueError, match="fov_y"):
        Camera.look_at((0, 0, 5), (0, 0, 0), size=(4, 4), fov_y=180)


def test_taken_poses_survive_the_way_there_and_back():
    """What the tolerance lets through is inverted as well as its digits allow."""
    generator = torch.Generator().manual_seed(3)
    rotation = torch.linalg.qr(torch.randn(8, 3, 3, generator=generator, dtype=torch.float64))[0]
    rotation = rotation * torch.linalg.det(rotation)[:, None, None]
    for digits in (5, 12):
        matrix = torch.eye(4, dtype=torch.float64).repeat(8, 1, 1)
        matrix[:, :3, :3] = (rotation * 10**digits).round() / 10**digits
        matrix[:, :3, 3] = torch.randn(8, 3, generator=generator, dtype=torch.float64)
        camera = Camera.from_intrinsics(K, matrix, size=(4, 4))
        points = torch.randn(8, 3, 4, 4, generator=generator, dtype=torch.float64)
        back = camera.to_view(camera.to_world(points))
        torch.testing.assert_close(back, points, atol=10.0 ** (1 - digits), rtol=0)


def test_look_at_keeps_devices_and_float64():
    eye, target = torch.tensor([0.0, 1.0, 5.0]), (0.0, 0.0, 0.0)
    here = Camera.look_at(eye, target, size=(4, 6))
    assert (here.device.type, here.intrinsics.dtype, here.world_from_view.dtype) == ("cpu", *(torch.float32,) * 2)
    for tensors in ((eye.to("meta"), target), (target, eye.to("meta")), (eye.expand(3, 3).to("meta"), target)):
        there = Camera.look_at(*tensors, size=(4, 6))
        assert (there.intrinsics.device.type, there.world_from_view.device.type) == ("meta", "meta")
        assert there.world_from_view.shape == (there.batch, 4, 4)
    up = torch.tensor([0.0, 1.0, 0.0])
    assert Camera.look_at(eye.to("meta"), target, up=up.to("meta"), size=(4, 6)).device.type == "meta"
    double = Camera.look_at(eye.double() / 3, target, size=(4, 6), fov_y=37.0)
    assert (double.intrinsics.dtype, double.world_from_view.dtype) == (torch.float64, torch.float64)
    assert float(double.position[0, 2]) == 5.0 / 3.0
    assert Camera.look_at(eye, target, up=up.double(), size=(4, 6)).world_from_view.dtype == torch.float64


def test_look_at_has_a_gradient():
    eye = torch.tensor([0.0, 1.0, 5.0], requires_grad=True)
    Camera.look_at(eye, (0.0, 0.0, 0.0), size=(4, 6)).world_from_view.square().sum().backward()
    assert eye.grad is not None
    assert float(eye.grad.abs().sum()) > 0
