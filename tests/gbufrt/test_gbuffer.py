"""The channel table, and what `validate` catches."""

from __future__ import annotations

from dataclasses import replace

import boxes
import pytest
import torch

from gbufrt import CHANNELS, SIGNALS, Camera, Frame, GBuffer


@pytest.fixture
def moving() -> GBuffer:
    return boxes.frame(boxes.camera(dx=0.3), previous=boxes.camera()).gbuffer


def test_good_buffers_pass(moving):
    parallel, sky = boxes.frame(boxes.camera(orthographic=True)), boxes.frame(boxes=boxes.ROOM + 500.0)
    for good in (moving, parallel.gbuffer, sky.gbuffer):
        assert good.validate() is None  # what it finds, it raises


def test_absent_channels_are_none():
    g = boxes.frame().gbuffer
    bare = GBuffer(camera=g.camera, depth=g.depth, hit=g.hit, normal=g.normal)
    assert bare.present == ("depth", "hit", "normal")
    assert bare.albedo is None
    bare.validate()


@pytest.mark.parametrize(
    ("name", "change", "error", "message"),
    [
        ("depth", lambda t: t[0], ValueError, "add the batch dimension"),
        ("depth", lambda t: t[0, 0], ValueError, "add batch and channel"),
        ("normal", lambda t: t.permute(0, 2, 3, 1), ValueError, "channels-last"),
        ("motion", lambda t: t[:, :1], ValueError, r"motion must be \(1,2,72,96\).*got \(1,1,72,96\)"),
        ("depth", lambda t: t.half(), TypeError, "float32"),
        ("hit", lambda t: t.float(), TypeError, "hit must be bool"),
        ("object_id", lambda t: t.float(), TypeError, "int32"),
        ("albedo", lambda t: t.to("meta"), ValueError, "albedo is on meta"),
        ("depth", lambda t: t.numpy(), TypeError, "torch.Tensor"),
    ],
)
def test_form_is_checked_when_built(moving, name, change, error, message):
    with pytest.raises(error, match=message):
        moving.replace(**{name: change(getattr(moving, name))})


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


def put(tensor: torch.Tensor, *places: tuple[int, int], value: float) -> torch.Tensor:
    changed = tensor.clone()
    for y, x in places:
        changed[:, :, y, x] = value
    return changed


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("depth", torch.nan, r"depth must be finite, but 2 pixels are not, such as nan at \(b, c, y, x\) = \(0, 0, 40"),
        ("normal", torch.inf, r"normal must be finite, but 2 pixels are not, such as inf at .* = \(0, 0, 40, 50\)"),
        ("depth", -1.0, r"depth must be positive .* but 2 pixels are not positive, such as -1 at .*40, 50\)"),
        ("depth", 150.0, r"pass the camera's far \(100\) where hit, but 2 pixels are beyond it, such as 150 at"),
        ("albedo", 1.5, r"albedo must lie in \[0, 1\], but 2 pixels are outside \(0.* to 1.5\), such as 1.5 at"),
        ("emission", -0.5, r"emission must not be negative, but 2 pixels are so \(down to -0.5\)"),
        ("thickness", -0.5, r"thickness must not be negative, but 2 pixels are so"),
    ],
)
def test_wrong_pixels_are_counted(moving, name, value, message):
    with pytest.raises(ValueError, match=message):
        moving.replace(**{name: put(getattr(moving, name), (40, 50), (41, 3), value=value)}).validate()


def test_one_wrong_pixel_is_one(moving):
    with pytest.raises(ValueError, match="1 pixel is not, such as nan"):
        moving.replace(depth=put(moving.depth, (40, 50), value=torch.nan)).validate()


def test_many_wrong_normals_are_counted(moving):
    count = int(moving.hit.sum())
    with pytest.raises(ValueError, match=f"{count} pixels are of another length, such as 3 at"):
        moving.replace(normal=moving.normal * 3).validate()
    with pytest.raises(ValueError, match=rf"{count} pixels face away \(100% of those hit\), such as at \(b, c, y, x\)"):
        moving.replace(normal=-moving.normal).validate()
    with pytest.raises(ValueError, match=r"and \d+ pixels are off by more than"):
        moving.replace(motion=-moving.motion).validate()


def test_a_miss_with_another_depth_is_told(moving):
    hit = moving.hit.clone()
    hit[..., 40:42, 50] = False
    with pytest.raises(ValueError, match=r"the camera's far \(100\) where hit is False, but 2 pixels are another"):
        moving.replace(hit=hit).validate()
    moving.replace(hit=hit, depth=torch.where(hit, moving.depth, 100.0)).validate()


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("radiance", torch.nan, r"radiance must be finite, but 2 pixels are not, such as nan at .*mended"),
        ("ambient", torch.inf, "ambient must be finite"),
        ("radiance", -0.1, r"radiance must not be negative, but 2 pixels are so \(down to -0.1\)"),
        ("ao", 1.5, r"ao must lie in \[0, 1\], but 2 pixels are outside"),
        ("glow", torch.inf, "glow must be finite, but 2 pixels are not"),
    ],
)
def test_light_and_signals_are_validated(name, value, message):
    frame = boxes.frame()
    frame = frame.replace(ao=torch.ones_like(frame.gbuffer.depth)).write("glow", frame.gbuffer.depth)
    frame.validate()
    bad = frame.write(name, put(frame.read(name), (40, 50), (41, 3), value=value))
    with pytest.raises(ValueError, match=message):
        bad.validate()
    with pytest.raises(ValueError, match=f"^behind.{message}"):
        frame.replace(behind=bad).validate()


def test_environments_and_bent_normals_are_validated():
    frame = boxes.frame()
    with pytest.raises(ValueError, match="environment must be finite, but 1 pixel is not"):
        frame.replace(environment=put(frame.read("environment"), (3, 7), value=torch.nan)).validate()
    with pytest.raises(ValueError, match="bent_normal must have unit length where hit"):
        frame.replace(bent_normal=frame.gbuffer.normal * 2).validate()
    behind = frame.replace(gbuffer=frame.gbuffer.replace(depth=frame.gbuffer.depth * torch.nan))
    with pytest.raises(ValueError, match=r"^behind\.depth must be finite"):
        frame.replace(behind=behind).validate()


def test_view_space_normals_are_caught(moving):
    view = moving.camera.rotate_to_view(moving.normal)
    with pytest.raises(ValueError, match="world space"):
        moving.replace(normal=view).validate()


def test_moves_between_types_and_keeps_ids(moving):
    double = moving.to(torch.float64)
    assert double.depth.dtype == torch.float64
    assert double.camera.intrinsics.dtype == torch.float64
    assert double.hit.dtype == torch.bool
    assert double.object_id.dtype == torch.int32
    assert moving.depth.dtype == torch.float32


def test_frame_reads_and_writes_by_name():
    f = boxes.frame()
    ao = torch.ones_like(f.gbuffer.depth)
    assert f.write("ao", ao).read("ao") is ao
    assert f.write("glow", ao).read("glow") is ao
    assert f.write("glow", ao).extra["glow"] is ao
    assert f.read("depth") is f.gbuffer.depth
    with pytest.raises(ValueError, match="no 'gi'"):
        f.read("gi")
    with pytest.raises(ValueError, match="G-buffer channel"):
        f.write("depth", ao)
    with pytest.raises(ValueError, match="name of a known channel"):
        f.replace(extra={"ao": ao})
    with pytest.raises(ValueError, match="cut must be"):
        f.replace(cut=torch.zeros(2, dtype=torch.bool))


def test_as_previous_keeps_no_chain():
    f = boxes.frame()
    f = f.replace(previous=f, color=f.radiance, composite=f.radiance)
    assert f.as_previous().previous is None
    assert f.as_previous().color is None
    assert f.as_previous().composite is not None


def test_tables_describe_every_field():
    assert set(CHANNELS).isdisjoint(SIGNALS)
    assert all(row.meaning for row in (*CHANNELS.values(), *SIGNALS.values()))
    assert {"depth", "hit", "normal"} == {name for name, row in CHANNELS.items() if row.required}
    assert isinstance(boxes.frame(), Frame)
