"""Thickness guessed from the picture, against boxes whose thickness is known."""

from __future__ import annotations

import math
from typing import Any

import boxes
import pytest
import torch
from torch import Tensor

from gbufrt import Camera, Frame
from post import GTAO, SSGI, EstimateMissing, gtao, ssgi, thickness_from_depth
from post.sweep.chords import FULLNESS

WALL = [[-40.0, -40.0, -21.0], [40.0, 40.0, -20.0]]


def guess(frame: Frame, **changes: Any) -> Tensor:
    g = frame.gbuffer
    return thickness_from_depth(g.depth, g.normal, g.camera, **{"hit": g.hit, "object_id": g.object_id, **changes})


def pillar(width: float, *, orthographic: bool = False) -> Frame:
    """A high pillar in front of a wide wall, from straight ahead, in an odd size."""
    camera = Camera.look_at(
        (0, 0, 10), (0, 0, 0), size=(73, 127), fov_y=40.0, orthographic_height=8.0 if orthographic else None
    )
    return boxes.frame(camera, boxes=torch.tensor([[[-width / 2, -30.0, -width], [width / 2, 30.0, 0.0]], WALL]))


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("width", [0.5, 1.0, 2.5])
def test_a_pillar_is_about_as_deep_as_it_is_wide(width: float, orthographic: bool) -> None:
    frame = pillar(width, orthographic=orthographic)
    on_pillar = frame.gbuffer.hit & (frame.gbuffer.depth < 15)
    found = guess(frame)[on_pillar]
    assert float(found.median()) == pytest.approx(FULLNESS * width, rel=0.15)
    assert float(found.max()) < 1.2 * FULLNESS * width
    around = guess(frame)[frame.gbuffer.hit & ~on_pillar]
    assert float(around.min()) > 3 * width  # the wall goes on behind it, to the border


def test_a_box_seen_at_a_corner_tells_its_depth() -> None:
    """Thick along some rays and thin along others: the guess follows the sides, except at the corners."""
    camera = Camera.look_at((6, 3, 9), (0, 0.5, -1), size=(96, 120), fov_y=35.0, far=100.0)
    g = boxes.frame(camera, boxes=torch.tensor([[[-1.0, -1.0, -4.0], [1.0, 1.5, 0.0]], WALL])).gbuffer
    assert g.thickness is not None
    chosen = g.hit & (g.depth < 18) & (g.thickness > 0.3)
    ratio = thickness_from_depth(g.depth, g.normal, camera, hit=g.hit)[chosen] / g.thickness[chosen]
    assert float(ratio.median()) == pytest.approx(FULLNESS, rel=0.25)
    assert float(ratio.quantile(0.1)) > 0.4
    assert float(ratio.quantile(0.9)) < 1.3


def test_a_thin_board_at_a_slant_is_as_thin_as_its_edge() -> None:
    camera = Camera.look_at((5, 0, 6), (0, 0, 0), size=(90, 130), fov_y=45.0, far=100.0)
    g = boxes.frame(camera, boxes=torch.tensor([[[-2.0, -1.5, -0.3], [2.0, 1.5, 0.0]], WALL])).gbuffer
    front = g.hit & (g.depth < 15) & (g.normal[:, 2:] > 0.9)
    found = thickness_from_depth(g.depth, g.normal, camera, hit=g.hit)[front]
    assert 0.2 < float(found.median()) < 0.4  # and it is 4 wide


def test_objects_that_touch_are_told_apart() -> None:
    frame = pillar(3.0)
    g = frame.gbuffer
    across = g.camera.to_world(g.points_view())[:, :1]
    three = torch.where(g.depth < 15, torch.where(across < -0.5, 1, torch.where(across < 0.5, 2, 3)), 0).int()
    middle = three == 2
    assert float(guess(frame)[middle].median()) == pytest.approx(FULLNESS * 3, rel=0.15)
    for one in (1, 2, 3):
        found = guess(frame, object_id=three)[three == one]
        assert float(found.median()) == pytest.approx(FULLNESS, rel=0.2)


@pytest.mark.parametrize("orthographic", [False, True])
def test_open_planes_do_not_darken_themselves(orthographic: bool) -> None:
    height = 8.0 if orthographic else None
    for eye in ((0, 3, 0), (0, 14, -10)):  # a floor, level; and from above, where it fills the picture
        camera = Camera.look_at(eye, (0, 0, -12), size=(40, 60), far=400.0, orthographic_height=height)
        g = boxes.frame(camera, boxes=torch.tensor([[[-300.0, -1.0, -300.0], [300.0, 0.0, 300.0]]])).gbuffer
        ao, _ = gtao(g.depth, g.normal, camera, hit=g.hit, radius=2.0)
        assert float(ao.min()) > 0.99
        assert float(thickness_from_depth(g.depth, g.normal, camera, hit=g.hit)[g.hit].median()) > 2.0


def test_a_wall_that_fills_the_picture_is_thick_throughout() -> None:
    camera = Camera.look_at((0, 0, 0), (0, 0, -20), size=(40, 60), fov_y=60.0)
    g = boxes.frame(camera, boxes=torch.tensor([WALL])).gbuffer
    found = thickness_from_depth(g.depth, g.normal, camera, hit=g.hit)
    high = 2 * 20 * math.tan(math.radians(30))
    torch.testing.assert_close(found, torch.full_like(found, 2 * high), rtol=1e-3, atol=0)


def test_a_pillar_is_split_from_its_floor() -> None:
    """Down to two pixels above its foot, where the floor beside it lies at nearly its own depth."""
    camera = Camera.look_at((0, 3, 9), (0, 1, 0), size=(96, 120), fov_y=35.0, far=100.0)
    floor = [[-40.0, -1.0, -20.0], [40.0, 0.0, 40.0]]
    g = boxes.frame(camera, boxes=torch.tensor([[[-0.5, 0.0, -1.0], [0.5, 9.0, 0.0]], floor])).gbuffer
    height = camera.to_world(g.points_view())[:, 1:2]
    foot = (g.normal[:, 2:] > 0.9) & (height > 2 / camera.pixels_per_unit(g.depth)) & (height < 0.5)
    found = thickness_from_depth(g.depth, g.normal, camera, hit=g.hit)[foot]
    assert int(foot.sum()) > 50
    assert float(found.max()) < 1.0


def test_a_low_wall_across_the_picture_is_about_as_deep_as_it_is_high() -> None:
    """From below its top: it ends there, and in the crease with the floor."""
    camera = Camera.look_at((0, 0.5, 6), (0, 0.4, 0), size=(96, 60), fov_y=35.0, far=100.0)
    floor = [[-40.0, -1.0, -40.0], [40.0, 0.0, 40.0]]
    g = boxes.frame(camera, boxes=torch.tensor([[[-40.0, 0.0, -1.0], [40.0, 0.8, 0.0]], floor])).gbuffer
    found = thickness_from_depth(g.depth, g.normal, camera, hit=g.hit)[g.normal[:, 2:] > 0.9]
    assert float(found.median()) == pytest.approx(FULLNESS * 0.8, rel=0.15)


def test_walls_do_not_end_in_the_corners_of_a_room() -> None:
    """A corner is farther away than its side walls, and must not end their thickness."""
    camera = Camera.look_at((0, 2, 6), (0, 2, 0), size=(48, 64), fov_y=50.0, far=100.0)
    sides = [[[-4.0, 0.0, -9.0], [-3.0, 5.0, 20.0]], [[3.0, 0.0, -9.0], [4.0, 5.0, 20.0]]]
    rest = [[[-4.0, -1.0, -9.0], [4.0, 0.0, 20.0]], [[-4.0, 0.0, -9.0], [4.0, 5.0, -8.0]]]
    g = boxes.frame(camera, boxes=torch.tensor([*sides, *rest])).gbuffer
    point = camera.to_world(g.points_view())
    beside = (g.normal[:, :1].abs() > 0.9) & (point[:, 2:] < -2) & (point[:, 1:2] < 3)  # open above 5
    assert int(beside.sum()) > 50
    assert float(thickness_from_depth(g.depth, g.normal, camera, hit=g.hit)[beside].min()) > 1.5


def test_sky_alone_has_none() -> None:
    frame = boxes.frame(boxes.camera((24, 32)), boxes=boxes.ROOM + 500)
    assert float(guess(frame).abs().max()) == 0.0
    g = frame.gbuffer
    assert float(gtao(g.depth, g.normal, g.camera, hit=g.hit)[0].min()) == 1.0


def test_batch_equals_loop_and_precisions_agree() -> None:
    one, other = boxes.camera((36, 47)), boxes.camera((36, 47), dx=0.4)
    fields: dict[str, Any] = {
        name: torch.cat([getattr(c, name) for c in (one, other)]) for name in ("intrinsics", "world_from_view")
    }
    both = guess(boxes.frame(Camera(**fields, size=one.size, near=one.near, far=one.far)))
    for b, camera in enumerate((one, other)):
        torch.testing.assert_close(both[b : b + 1], guess(boxes.frame(camera)))
    double = guess(boxes.frame(one).to(torch.float64))
    assert double.dtype == torch.float64
    assert float(((double - both[:1]).abs() > 1e-3 * double + 1e-4).double().mean()) < 0.01


def test_gradients_match_finite_differences_and_are_not_zero() -> None:
    g = boxes.frame(boxes.camera((9, 12))).to(torch.float64).gbuffer
    depth, normal = g.depth.clone().requires_grad_(), g.normal.clone().requires_grad_()

    def run(depth: Tensor, normal: Tensor) -> Tensor:
        return thickness_from_depth(depth, normal, g.camera, hit=g.hit)

    assert torch.autograd.gradcheck(run, (depth, normal), eps=1e-7, atol=1e-4)
    gradients = torch.autograd.grad(run(depth, normal).sum(), (depth, normal))
    assert all(bool(torch.isfinite(x).all()) and float(x.abs().max()) > 1e-3 for x in gradients)


def test_the_gradient_of_a_radius_survives_the_default() -> None:
    g = boxes.frame(boxes.camera((8, 10))).to(torch.float64).gbuffer
    radius = torch.tensor(3.0, dtype=torch.float64, requires_grad=True)

    def run(radius: Tensor) -> Tensor:
        return gtao(g.depth, g.normal, g.camera, hit=g.hit, radius=radius, directions=2, steps=3)[0]

    assert torch.autograd.gradcheck(run, (radius,), eps=1e-7, atol=1e-4)
    (gradient,) = torch.autograd.grad(run(radius).sum(), radius)
    assert float(gradient.abs()) > 1e-3


def test_sweeps_take_a_measurement_then_a_number_then_the_guess() -> None:
    frame = boxes.frame(boxes.camera((36, 48)))
    bare = frame.replace(gbuffer=frame.gbuffer.replace(thickness=None))
    guessed = guess(frame)
    filled = EstimateMissing(channels="thickness")(bare)
    assert filled.gbuffer.thickness is not None
    assert torch.equal(filled.gbuffer.thickness, guessed)
    assert set(filled.extra) == {"thickness_estimated"}
    for stage, name in ((GTAO(radius=2.0), "ao"), (SSGI(bounces=1), "gi")):
        assert torch.equal(stage(bare).read(name), stage(filled).read(name))
        assert not torch.equal(stage(bare).read(name), stage(frame).read(name))
        assert torch.equal(stage.tuned(thickness=0.3)(frame).read(name), stage(frame).read(name))
        assert not torch.equal(stage.tuned(thickness=0.3)(bare).read(name), stage(bare).read(name))


def test_functions_guess_as_they_do_with_the_guess_given() -> None:
    frame = boxes.frame(boxes.camera((36, 48)))
    g, light, albedo = frame.gbuffer, frame.read("radiance"), frame.read("albedo")
    whole = thickness_from_depth(g.depth, g.normal, g.camera, hit=g.hit)

    def swept(thickness: Tensor | None) -> tuple[Tensor, Tensor]:
        ao, _ = gtao(g.depth, g.normal, g.camera, hit=g.hit, thickness=thickness, radius=2.0)
        return ao, ssgi(g.depth, g.normal, g.camera, light, albedo, hit=g.hit, thickness=thickness)[0]

    assert all(torch.equal(*pair) for pair in zip(swept(None), swept(whole), strict=True))
