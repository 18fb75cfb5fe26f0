"""What sweeps assume off-screen: past the border, behind a front, and where the sky is."""

from __future__ import annotations

from typing import Any

import boxes
import pytest
import torch
from torch import Tensor

from gbufrt import Camera
from post.margin import reference as margin
from post.sweep.bitmask import bitmask_ao
from post.sweep.open_sky import sky_beyond
from post.sweep.thickness import planar_thickness

WALL = torch.tensor([[[-40.0, -1.0, -40.0], [40.0, 0.0, 40.0]], [[-40.0, -1.0, -4.0], [40.0, 40.0, -3.0]]])
ROOM = torch.tensor([[[-8.0, 6.0, -30.0], [8.0, 8.0, 30.0]], [[-8.0, -2.0, -30.0], [8.0, 0.0, 30.0]]])
SIDES = torch.tensor([[[-8.0, -2.0, -30.0], [-6.0, 8.0, 30.0]], [[6.0, -2.0, -30.0], [8.0, 8.0, 30.0]]])
BACK = torch.tensor([[[-8.0, -2.0, -32.0], [8.0, 8.0, -10.0]]])


def cropped(camera: Camera, rows: int, columns: int) -> Camera:
    """The middle of a camera's picture."""
    k = camera.intrinsics.clone()
    top, left = (camera.height - rows) // 2, (camera.width - columns) // 2
    k[:, 0, 2] -= left
    k[:, 1, 2] -= top
    return Camera.from_intrinsics(k, camera.world_from_view, size=(rows, columns), far=camera.far)


def sky(camera: Camera, solids: Tensor) -> Tensor:
    g = boxes.frame(camera, boxes=solids).gbuffer
    sweep: dict[str, Any] = {"hit": g.hit, "thickness": g.thickness, "radius": None, "steps": 16}
    return bitmask_ao(g.depth, g.normal, g.camera, **sweep)[0][g.hit]


@pytest.mark.parametrize("orthographic", [False, True])
def test_planes_at_the_border_go_on_exactly(orthographic: bool) -> None:
    height = 3.0 if orthographic else None
    wide = Camera.look_at((0, 4, 4), (0, 0, 0), size=(60, 72), far=100.0, orthographic_height=height)
    k = wide.intrinsics.clone()
    m = margin.width(wide)
    k[:, :2, 2] += m
    bigger = Camera.from_intrinsics(
        k, wide.world_from_view, size=(60 + 2 * m, 72 + 2 * m), far=100.0, orthographic=orthographic
    )
    floor = WALL[:1]
    visible, more = boxes.frame(wide, boxes=floor).gbuffer, boxes.frame(bigger, boxes=floor).gbuffer
    depth, stands = margin.continued(wide, visible.depth, visible.hit, visible.normal, m)
    both = stands & more.hit
    assert float(both.float().mean()) > 0.9
    torch.testing.assert_close(depth[both], more.depth[both], rtol=1e-3, atol=1e-3)


def test_a_wall_cut_by_the_border_still_blocks() -> None:
    camera = Camera.look_at((0, 2, 2), (0, 0.6, -2), size=(60, 64), far=100.0)
    part = cropped(camera, 12, 64)
    whole, cut = boxes.frame(camera, boxes=WALL).gbuffer, boxes.frame(part, boxes=WALL).gbuffer
    results = []
    for g in (whole, cut):
        found = [
            bitmask_ao(g.depth, g.normal, g.camera, hit=g.hit, thickness=g.thickness, radius=2.0, steps=10, index=i)[0]
            for i in range(2)
        ]
        results.append(torch.stack(found).mean(0))
    wanted = results[0][..., 24:36, :]
    assert float(wanted.min()) < 0.8
    assert float((results[1] - wanted).abs().mean()) < 0.02


def test_a_body_is_as_deep_as_its_neighbours_show() -> None:
    camera = Camera.look_at((0, 0, 10), (0, 0, 0), size=(9, 9), orthographic_height=9.0)
    depth, hit = torch.full((1, 1, 9, 9), 10.0), torch.ones(1, 1, 9, 9, dtype=torch.bool)
    thickness = torch.full_like(depth, 0.5)
    thickness[..., 4, 4] = 3.0
    depth[..., :, 7:] = 5.0  # another body in front, not joined in depth
    solid = planar_thickness(camera, depth, hit, thickness, 0.25)
    assert float(solid[0, 0, 4, 2]) == pytest.approx(3.25)
    assert float(solid[0, 0, 4, 8]) == pytest.approx(0.75)
    torch.testing.assert_close(planar_thickness(camera, depth, hit, 0.5, 0.25), torch.full_like(depth, 0.5))
    near = planar_thickness(camera, depth, hit, thickness, 0.25, torch.tensor(4.5))  # pixels are 1 wide
    assert [float(near[0, 0, 4, x]) for x in (2, 1, 0)] == pytest.approx([3.25, 3.25, 0.75])


def test_a_closed_room_sees_no_sky_and_an_open_wall_does() -> None:
    inside = Camera.look_at((0, 3, 8), (0, 3, -10), size=(36, 48), far=100.0)
    assert float(sky(inside, torch.cat([ROOM, SIDES, BACK])).max()) < 0.05
    outside = Camera.look_at((0, 2, 9), (0, 2, 0), size=(36, 48), far=100.0)
    yard = torch.cat([WALL[:1], torch.tensor([[[-2.0, 0.0, -3.0], [2.0, 2.5, -2.0]]])])
    assert 0.4 < float(sky(outside, yard).mean()) <= 1.0


@pytest.mark.parametrize("target", [3.0, -1.0])
def test_lamps_light_a_closed_room_and_no_share_of_the_sky_does(target: float) -> None:
    """A twentieth of the sky was left, which outshone the lamps of a mine."""
    inside = Camera.look_at((0, 3, 8), (0, target, -10), size=(36, 48), far=100.0)
    assert float(sky(inside, torch.cat([ROOM, SIDES, BACK])).max()) < 0.006


def test_a_strip_of_wall_above_the_horizon_is_no_proof_of_a_roof() -> None:
    low = Camera.look_at((0, 4, 9), (0, -3, -4), size=(36, 48), far=100.0)
    g = boxes.frame(low, boxes=WALL).gbuffer
    assert 0 < float(sky_beyond(g.camera, g.hit, g.normal).trust) < 0.1


def test_a_picture_without_anything_above_the_horizon_tells_nothing() -> None:
    down = Camera.look_at((0, 5, 1), (0, 0, 0), size=(36, 48), far=100.0)
    g = boxes.frame(down, boxes=WALL[:1]).gbuffer
    told = sky_beyond(g.camera, g.hit, g.normal)
    assert float(told.trust) == 0
    assert float(sky(down, WALL[:1]).min()) == 1
