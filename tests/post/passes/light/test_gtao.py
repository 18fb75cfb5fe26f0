"""Ambient occlusion by horizons, and what both methods of GTAO share."""

from __future__ import annotations

import math
from typing import Any

import boxes
import pytest
import torch
from torch import Tensor

from gbufrt import Camera
from gbufrt.frame import Frame
from post.passes.light.gtao import GTAO, gtao, horizon_ao

SIZE = (36, 48)
METHODS = ("bitmask", "horizon")


def plane(
    tilt: float, *, orthographic: bool = False, size: tuple[int, int] = SIZE
) -> tuple[Tensor, Tensor, Camera, Tensor]:
    """Depth, normal, camera and hit of an endless floor viewed ``tilt`` degrees off its normal."""
    turn = math.radians(tilt)
    eye = (0.0, 3 * math.cos(turn), 3 * math.sin(turn))
    height = 4.0 if orthographic else None
    camera = Camera.look_at(eye, (0, 0, 0), up=(0, 0, -1), size=size, far=500.0, orthographic_height=height)
    origin, ray = camera.rays()
    distance = -origin[..., 1] / ray[..., 1]
    hit = ((distance > 0) & (distance < 400))[:, None]
    depth = torch.where(hit, (distance * (ray * camera.forward[:, None, None]).sum(-1))[:, None], 500.0)
    normal = torch.where(hit, torch.tensor([0.0, 1.0, 0.0]).view(1, 3, 1, 1), 0.0)
    return depth, normal, camera, hit


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("tilt", [0, 70, 88])
def test_an_open_plane_is_unoccluded_at_every_angle(tilt: float, orthographic: bool, method: Any) -> None:
    depth, normal, camera, hit = plane(tilt, orthographic=orthographic)
    ao, bent = gtao(depth, normal, camera, hit=hit, radius=1.0, directions=2, method=method)
    assert float((1 - ao).abs().max()) < 1e-5
    torch.testing.assert_close(bent, normal, atol=1e-5, rtol=0)


@pytest.mark.parametrize("method", METHODS)
def test_ao_falls_as_the_radius_grows(method: Any) -> None:
    frame = boxes.frame(boxes.camera(SIZE))
    means = [float(GTAO(radius=radius, method=method)(frame).read("ao").mean()) for radius in (0.3, 1.0, 3.0)]
    assert 1 > means[0] > means[1] + 0.002
    assert means[1] > means[2] + 0.005


@pytest.mark.parametrize("method", METHODS)
def test_the_bent_normal_of_a_corner_leans_out_of_it(method: Any) -> None:
    frame = boxes.frame(boxes.camera((72, 96)))
    result = GTAO(radius=1.5, method=method)(frame)
    g = frame.gbuffer
    point = g.camera.to_world(g.points_view())
    near_box = (point[:, 1:2] < 0.01) & (point[:, 2:] > 1.05) & (point[:, 2:] < 1.5) & (point[:, :1].abs() < 0.8)
    assert int(near_box.sum()) > 20
    lean = result.read("bent_normal")[:, 2:][near_box]  # away from the box's front, which looks along +z
    assert float(lean.mean()) > 0.15
    assert float(result.read("ao")[near_box].mean()) < 0.9


def test_scales_average_their_radii() -> None:
    frame = boxes.frame(boxes.camera(SIZE))
    g = frame.gbuffer
    for method, tolerance in (("horizon", 1e-6), ("bitmask", 3e-3)):  # scales of the bitmask share their taps
        sweep: dict[str, Any] = {"hit": g.hit, "thickness": g.thickness, "method": method}
        both, _ = gtao(g.depth, g.normal, g.camera, radius=1.0, scales=2, **sweep)
        one, _ = gtao(g.depth, g.normal, g.camera, radius=1.0, seed=0, **sweep)
        two, _ = gtao(g.depth, g.normal, g.camera, radius=2.0, seed=1, **sweep)
        assert float((one - two).mean()) > 5 * tolerance
        assert abs(float((both - (one + two) / 2).mean())) < tolerance


@pytest.mark.parametrize("method", METHODS)
def test_batch_is_the_same_as_one_by_one(method: Any) -> None:
    cameras = [boxes.camera(SIZE), boxes.camera(SIZE, dx=1.0)]
    both = Camera(
        intrinsics=torch.cat([c.intrinsics for c in cameras]),
        world_from_view=torch.cat([c.world_from_view for c in cameras]),
        size=SIZE,
        far=cameras[0].far,
    )
    stage = GTAO(radius=1.0, method=method)
    together = stage(boxes.frame(both))
    for b, camera in enumerate(cameras):
        alone = stage(boxes.frame(camera))
        assert float((together.read("ao")[b : b + 1] - alone.read("ao")).abs().mean()) < 1e-4
        assert float((together.read("bent_normal")[b : b + 1] - alone.read("bent_normal")).abs().mean()) < 1e-4


@pytest.mark.parametrize("method", METHODS)
def test_module_is_the_function(method: Any) -> None:
    frame = boxes.frame(boxes.camera(SIZE), index=3)
    g = frame.gbuffer
    result = GTAO(radius=0.7, directions=2, steps=3, method=method, seed=5)(frame)
    tunables: dict[str, Any] = {"radius": 0.7, "directions": 2, "steps": 3, "method": method, "seed": 5}
    ao, bent = gtao(g.depth, g.normal, g.camera, hit=g.hit, thickness=g.thickness, index=3, **tunables)
    assert torch.equal(result.read("ao"), ao)
    assert torch.equal(result.read("bent_normal"), bent)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("size", [(127, 73), (1, 9), (1, 1)])
def test_any_size_and_projection_gives_numbers(size: tuple[int, int], method: Any) -> None:
    camera = boxes.camera(size, orthographic=True).with_jitter((0.3, -0.2))
    frame = GTAO(directions=2, steps=2, scales=2, method=method)(boxes.frame(camera))
    assert bool(((frame.read("ao") >= 0) & (frame.read("ao") <= 1)).all())
    assert bool(torch.isfinite(frame.read("bent_normal")).all())


@pytest.mark.parametrize("method", METHODS)
def test_the_sky_is_open_and_has_no_bent_normal(method: Any) -> None:
    camera = Camera.look_at((0, 5, 0), (0, 9, -1), size=SIZE)
    frame: Frame = boxes.frame(camera)
    assert not bool(frame.gbuffer.hit.any())
    result = GTAO(method=method)(frame)
    assert bool((result.read("ao") == 1).all())
    assert bool((result.read("bent_normal") == 0).all())


def test_gradients_match_finite_differences_and_are_not_zero() -> None:
    frame = boxes.frame(boxes.camera((6, 8))).to(torch.float64)
    g = frame.gbuffer
    depth = g.depth.clone().requires_grad_()
    radius = torch.tensor(3.0, dtype=torch.float64, requires_grad=True)

    def run(depth: Tensor, radius: Tensor) -> Tensor:
        return horizon_ao(depth, g.normal, g.camera, hit=g.hit, radius=radius, directions=2, steps=3)[0]

    assert torch.autograd.gradcheck(run, (depth, radius), eps=1e-7, atol=1e-4, fast_mode=True)
    run(depth, radius).sum().backward()
    assert depth.grad is not None
    assert radius.grad is not None
    assert float(depth.grad.abs().max()) > 1e-3
    assert abs(float(radius.grad)) > 1e-3


def test_wrong_arguments_are_named() -> None:
    frame = boxes.frame(boxes.camera(SIZE))
    g = frame.gbuffer
    with pytest.raises(ValueError, match=r"depth must be \(1,1,36,48\)"):
        gtao(g.depth[0], g.normal, g.camera)
    with pytest.raises(ValueError, match="directions must be at least 1, got 0"):
        gtao(g.depth, g.normal, g.camera, directions=0)
    with pytest.raises(ValueError, match="positive length"):
        gtao(g.depth, g.normal, g.camera, radius=-1.0)
    with pytest.raises(ValueError, match="method must be"):
        gtao(g.depth, g.normal, g.camera, method="none")  # type: ignore[arg-type]


def test_a_radius_that_is_a_tensor_takes_the_kernel_where_no_gradient_is_wanted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def reference(*_: object, **__: object) -> Tensor:
        raise AssertionError("torch code, which is slow")

    monkeypatch.setattr("post.sweep.op._by_reference", reference)
    frame = boxes.frame(boxes.camera((12, 16)))
    number = GTAO(radius=1.5)(frame).read("ao")
    tensor, wanted = torch.tensor(1.5), torch.tensor(1.5, requires_grad=True)
    stage: Any = GTAO
    assert torch.equal(stage(radius=tensor)(frame).read("ao"), number)
    with torch.no_grad():
        assert torch.equal(stage(radius=wanted)(frame).read("ao"), number)
    with pytest.raises(AssertionError, match="torch code"):
        stage(radius=wanted)(frame)


def test_scales_are_few() -> None:
    frame = boxes.frame(boxes.camera((12, 16)))
    with pytest.raises(ValueError, match="scales must be at most 16, as each doubles the radius, got 100"):
        GTAO(scales=100)(frame)
    assert bool(torch.isfinite(GTAO(scales=16, steps=2, directions=1)(frame).read("ao")).all())
