"""Back-projection: finding each pixel's surface in the previous frame."""

from __future__ import annotations

import boxes
import pytest
import torch

from gbufrt import Frame
from post.history.reproject import correspondence_reference, find_taps, motion_of

SIZE = (60, 80)


def pair(dx: float, *, size: tuple[int, int] = SIZE, **options: bool) -> tuple[Frame, Frame]:
    before = boxes.camera(size, **options)
    now = boxes.camera(size, dx=dx, **options)
    return boxes.frame(before), boxes.frame(now, previous=before)


def position(frame: Frame) -> torch.Tensor:
    g = frame.gbuffer
    return g.camera.to_world(g.points_view())


def test_still_camera_fetches_each_pixel_from_itself():
    frame = boxes.frame(boxes.camera(SIZE))
    white = torch.rand((1, 2, *SIZE), generator=torch.Generator().manual_seed(0))
    taps = find_taps(*correspondence_reference(frame.gbuffer, frame.gbuffer))
    assert bool(taps.valid.all())
    assert torch.allclose(taps.fetch(white), white, atol=1e-3)


def test_jitter_does_not_move_history():
    """A still surface fetches its own pixel, even when jittered elsewhere in it."""
    before = boxes.frame(boxes.camera(SIZE).with_jitter((0.4, -0.3)))
    camera = boxes.camera(SIZE).with_jitter((-0.3, 0.4))
    now = boxes.frame(camera, previous=before.gbuffer.camera)
    white = torch.rand((1, 1, *SIZE), generator=torch.Generator().manual_seed(0))
    taps = find_taps(*correspondence_reference(now.gbuffer, before.gbuffer))
    same = now.gbuffer.object_id == before.gbuffer.object_id
    same &= (now.gbuffer.normal * before.gbuffer.normal).sum(1, keepdim=True) > 0.9
    same &= now.gbuffer.material_id == before.gbuffer.material_id
    off = (taps.fetch(white) - white).abs()[same & taps.valid]
    assert float(off.quantile(0.97)) < 2e-3
    assert float(taps.valid.float().mean()) > 0.99


@pytest.mark.parametrize("orthographic", [False, True])
def test_moving_camera_finds_the_same_world_point(orthographic):
    before, now = pair(0.35, orthographic=orthographic)
    taps = find_taps(*correspondence_reference(now.gbuffer, before.gbuffer), search=False)
    g = now.gbuffer
    found = taps.fetch(position(before))
    inner = taps.valid & g.hit & (taps.weight.amin(1, keepdim=True) > 0)  # all four taps
    footprint = 1 / g.camera.pixels_per_unit(g.depth)
    off = (found - position(now)).norm(dim=1, keepdim=True) / footprint
    assert float(inner.float().mean()) > 0.6
    assert float(off[inner].quantile(0.95)) < 1.0
    distance = ((found - position(now)) * g.normal).sum(1, keepdim=True).abs()
    assert float((distance / footprint)[taps.valid & g.hit].max()) < 2.01


def test_disoccluded_and_off_screen_pixels_have_no_history():
    before, now = pair(0.8)
    camera, g = before.gbuffer.camera, now.gbuffer
    taps = find_taps(*correspondence_reference(g, before.gbuffer))
    view = camera.to_view(position(now))
    px = camera.project(view)
    inside = (px[:, :1] > 1) & (px[:, :1] < SIZE[1] - 1) & (px[:, 1:] > 1) & (px[:, 1:] < SIZE[0] - 1)
    eye = camera.position[:, :, None, None]
    direction = (position(now) - eye).permute(0, 2, 3, 1)
    blocked = torch.zeros_like(g.hit)
    for box in boxes.ROOM:
        near, far = ((c - eye[0, :, 0, 0]) / direction for c in box)
        enter = torch.minimum(near, far).amax(-1)
        leave = torch.maximum(near, far).amin(-1)
        blocked |= ((enter < leave) & (enter > 0) & (enter < 0.97))[:, None]
    lost = g.hit & (blocked | ((px[:, :1] < -1) | (px[:, :1] > SIZE[1] + 1)))
    kept = g.hit & ~blocked & inside
    assert 0.02 < float(lost.float().mean()) < 0.5
    strict = find_taps(*correspondence_reference(g, before.gbuffer), search=False)
    assert float(strict.valid[lost].float().mean()) < 0.12
    assert float(taps.valid[lost].float().mean()) < 0.25, "the search widens the rim by a pixel"
    assert float(taps.valid[kept].float().mean()) > 0.97


def test_search_helps_where_all_four_taps_fail():
    before, now = pair(0.5)
    look = correspondence_reference(now.gbuffer, before.gbuffer)
    with_search, without = (find_taps(*look, search=s).valid for s in (True, False))
    assert bool((with_search | ~without).all())
    assert int(with_search.sum()) > int(without.sum())


def test_moving_object_brings_its_history():
    """A box that moves by half a unit is found by its motion, and its id keeps the floor out."""
    moved = boxes.ROOM.clone()
    moved[2] += torch.tensor([0.5, 0.0, 0.0])
    camera = boxes.camera(SIZE)
    before, now = boxes.frame(camera), boxes.frame(camera, boxes=moved)
    g = now.gbuffer
    mine = g.object_id == 1
    was = camera.to_view(position(now) - torch.tensor([0.5, 0.0, 0.0])[None, :, None, None])
    assert g.motion is not None
    assert g.motion_z is not None
    motion = torch.where(mine, camera.project(was) - camera.pixel_centers(), g.motion)
    g = g.replace(motion=motion, motion_z=torch.where(mine, was[:, 2:] - g.depth, g.motion_z))
    taps = find_taps(*correspondence_reference(g, before.gbuffer))
    assert before.gbuffer.object_id is not None
    ids = taps.fetch(before.gbuffer.object_id.float())
    assert float(taps.valid[mine].float().mean()) > 0.95
    assert bool((ids[mine & taps.valid] > 0.999).all())
    uncovered = ~mine & (before.gbuffer.object_id == 1)
    strict = find_taps(*correspondence_reference(g, before.gbuffer), search=False)
    assert float(strict.valid[uncovered].float().mean()) < 0.1


def test_sky_finds_sky():
    turned = boxes.camera((24, 32), dx=0.3)
    before = boxes.frame(boxes.camera((24, 32)), boxes=boxes.ROOM + 500)
    now = boxes.frame(turned, previous=before.gbuffer.camera, boxes=boxes.ROOM + 500)
    assert float(find_taps(*correspondence_reference(now.gbuffer, before.gbuffer)).valid.float().mean()) > 0.9
    ground = boxes.frame(turned, previous=before.gbuffer.camera, boxes=boxes.ROOM)
    taps = find_taps(*correspondence_reference(ground.gbuffer, before.gbuffer))
    assert not bool(taps.valid[ground.gbuffer.hit].any())


def test_history_of_length_zero_is_not_used():
    frame = boxes.frame(boxes.camera(SIZE))
    length = torch.ones_like(frame.gbuffer.depth)
    length[..., 40:] = 0
    taps = find_taps(*correspondence_reference(frame.gbuffer, frame.gbuffer, length))
    assert bool(taps.valid[..., :40].all())
    assert not bool(taps.valid[..., 42:].any())
    poisoned = torch.where(length > 0, 1.0, torch.nan)
    assert bool(torch.isfinite(taps.fetch(poisoned)).all())


def test_weights_sum_to_one_or_nothing():
    before, now = pair(0.35, size=(127, 73))
    total = find_taps(*correspondence_reference(now.gbuffer, before.gbuffer)).weight.sum(1)
    assert bool((((total - 1).abs() < 1e-5) | (total == 0)).all())


def test_motion_comes_from_the_cameras_where_it_is_missing():
    before, now = pair(0.35)
    bare = now.gbuffer.replace(motion=None, motion_z=None, object_id=None)
    motion, motion_z = motion_of(bare, before.gbuffer.camera)
    assert now.gbuffer.motion is not None
    assert now.gbuffer.motion_z is not None
    assert torch.allclose(motion, now.gbuffer.motion, atol=1e-3)
    assert torch.allclose(motion_z, now.gbuffer.motion_z, atol=1e-4)
    assert float(find_taps(*correspondence_reference(bare, before.gbuffer.geometry())).valid.float().mean()) > 0.85


def test_a_single_pixel_and_a_changed_size():
    one = boxes.frame(boxes.camera((1, 1)))
    assert bool(find_taps(*correspondence_reference(one.gbuffer, one.gbuffer)).valid.all())
    with pytest.raises(ValueError, match="start with state=None"):
        correspondence_reference(one.gbuffer, boxes.frame(boxes.camera((2, 2))).gbuffer)
