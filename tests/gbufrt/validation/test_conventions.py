"""What `validate` tells of conventions: spaces, signs and units of normals, depth, motion and cameras."""

from __future__ import annotations

from dataclasses import replace

import boxes
import pytest
import torch

from gbufrt import Camera, Frame, GBuffer


@pytest.mark.parametrize(
    ("name", "change", "message"),
    [
        ("depth", lambda t: torch.where(t > 50, torch.inf, t), "far and hit = False"),
        ("normal", lambda t: t * torch.nan, "normal must be finite"),
        ("depth", lambda t: -t, "negate it"),
        ("depth", lambda t: t * 1000, "raise far"),
        ("depth", lambda t: t / 1000, "lower near"),
        ("normal", lambda t: t * 0.5 + 0.5, r"2 \* n - 1"),
        ("normal", lambda t: t * 3, "normalize"),
        ("normal", lambda t: -t, "face away"),
        ("albedo", lambda t: t * 255, "albedo must lie in"),
        ("motion", lambda t: -t, "looks negated"),
        ("motion", lambda t: t / torch.tensor([96.0, 72.0])[None, :, None, None], "UV units"),
        ("motion", lambda t: t / torch.tensor([48.0, -36.0])[None, :, None, None], "NDC units"),
        ("motion", lambda t: t * 3 + 5, "check its sign"),
    ],
)
def test_broken_conventions_are_named(moving, name, change, message):
    with pytest.raises(ValueError, match=message):
        moving.replace(**{name: change(getattr(moving, name))}).validate()


@pytest.mark.filterwarnings("error")
def test_tensors_of_an_optimisation_are_checked_without_a_word_of_torch(moving: GBuffer) -> None:
    floats = [name for name in moving.present if getattr(moving, name).is_floating_point()]
    leaves = {name: getattr(moving, name).clone().requires_grad_() for name in floats}
    Frame(gbuffer=moving.replace(**leaves), radiance=leaves["albedo"]).validate()


def ogl(gbuffer):
    """The buffer with the matrix of a camera that looks along -z."""
    camera = gbuffer.camera
    signs = torch.tensor([1.0, -1.0, -1.0, 1.0])
    return gbuffer.replace(camera=replace(camera, world_from_view=camera.world_from_view * signs), motion=None)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (ogl, r"; world_from_view looks like that of OpenGL or Blender.*columns by \(1, -1, -1, 1\)$"),
        (lambda g: g.replace(normal=-g.normal), "; flip them$"),
        (
            lambda g: g.replace(normal=g.camera.rotate_to_view(g.normal)),
            "; they look like view space: rotate them with camera.rotate_to_world$",
        ),
        (
            lambda g: g.replace(depth=torch.where(g.hit, g.points_view().norm(dim=1, keepdim=True), g.depth)),
            "depth must be planar view-space z, but looks like the length of rays: .*; divide it by camera.unproject",
        ),
    ],
)
def test_spaces_are_told_by_their_names(moving, change, message):
    moving.validate()
    with pytest.raises(ValueError, match=message):
        change(moving).validate()


def test_lengths_of_rays_are_told_where_most_pixels_are_at_edges():
    """Walls of 4 x 4 pixels, near and far: of each only the inner four say which way it faces."""
    camera = Camera.look_at((0, 0, 5), (0, 0, 0), size=(48, 64), fov_y=70)
    place = torch.arange(64) // 4
    near = ((place[:48, None] + place[None]) % 2 == 0)[None, None]
    depth, hit = torch.where(near, 5.0, 8.0), torch.ones_like(near)
    normal = torch.tensor([0.0, 0.0, 1.0]).view(1, 3, 1, 1).expand(1, 3, 48, 64)
    true = GBuffer(camera=camera, depth=depth, hit=hit, normal=normal)
    true.validate()
    with pytest.raises(ValueError, match="looks like the length of rays"):
        true.replace(depth=true.points_view().norm(dim=1, keepdim=True)).validate()


@pytest.mark.parametrize("first", [0, 1], ids=["with a floor", "before a wall, where depth alone tells"])
@pytest.mark.parametrize(
    ("signs", "message"),
    [((-1.0, -1.0), "looks negated: motion"), ((-1.0, 1.0), "negated in x"), ((1.0, -1.0), "its y looks flipped")],
)
def test_the_sign_of_what_moves_is_told_under_a_camera_that_stands_still(signs, message, first):
    """The box in the middle slides and rises by a unit; nothing else moves."""
    camera, slide = boxes.camera(), torch.tensor([0.8, 0.6, 0.0])
    room = boxes.ROOM.clone()
    room[1, 0, 1] = -20.0  # the wall goes on below
    earlier = room.clone()
    earlier[2] -= slide
    now, before = (boxes.frame(camera, boxes=scene[first:3]).gbuffer for scene in (room, earlier))
    box = now.material_id == 3 - first
    points = camera.to_world(now.points_view()) - slide[None, :, None, None]
    there = camera.to_view(points)
    motion = torch.where(box, camera.project(there) - camera.pixel_centers(), 0.0)
    now = now.replace(motion=motion, motion_z=torch.where(box, there[:, 2:] - now.depth, 0.0))
    now.validate(before)
    Frame(gbuffer=now).validate(Frame(gbuffer=before))
    wrong = now.replace(motion=motion * torch.tensor(signs)[None, :, None, None])
    wrong.validate()
    with pytest.raises(ValueError, match=f"same surface in the frame before.*{message}"):
        wrong.validate(before)
    with pytest.raises(ValueError, match="same surface in the frame before"):
        Frame(gbuffer=wrong).validate(Frame(gbuffer=before))


def test_the_camera_before_must_be_that_of_the_frame_before():
    """Left out, it is taken to stand where the camera stands, and motion to be none."""
    here, there = boxes.camera(), boxes.camera(dx=0.5)
    before, still, moved = (boxes.frame(camera).gbuffer for camera in (there, here, here))
    still.replace(previous_camera=here, motion=torch.zeros_like(still.normal[:, :2])).validate()
    with pytest.raises(ValueError, match="previous_camera must be the camera of the frame before"):
        still.replace(previous_camera=here, motion=torch.zeros_like(still.normal[:, :2])).validate(before)
    motion, _ = here.static_motion(there, moved.depth, moved.hit)
    moved.replace(previous_camera=there, motion=motion).validate(before)


def test_view_space_normals_are_caught(moving):
    view = moving.camera.rotate_to_view(moving.normal)
    with pytest.raises(ValueError, match="world space"):
        moving.replace(normal=view).validate()
