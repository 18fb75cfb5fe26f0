"""The compiled sweeps against their torch references, number for number."""

from __future__ import annotations

from typing import Any

import boxes
import pytest
import torch
from torch import Tensor

from gbufrt import Camera, Frame
from post.margin.op import scene
from post.passes.light.ssgi import ssgi
from post.sweep.bitmask import bitmask_ao
from post.sweep.op import bodies_cpu
from post.sweep.thickness import planar_thickness
from post.sweep.turns import table

SIZE = (54, 72)


def view(case: str) -> Camera:
    if case == "batch":
        cameras = [boxes.camera(SIZE, dx=0.7 * k) for k in range(2)]
        return Camera(
            intrinsics=torch.cat([c.intrinsics for c in cameras]),
            world_from_view=torch.cat([c.world_from_view for c in cameras]),
            size=SIZE,
            far=100.0,
        )
    camera = boxes.camera(SIZE, orthographic=case == "orthographic")
    return camera.with_jitter((0.3, -0.4)) if case == "jittered" else camera


def occluded(frame: Frame, *, compiled: bool | None, **tunables: Any) -> tuple[Tensor, ...]:
    g = frame.gbuffer
    tunables = {"thickness": g.thickness, "directions": 3, "steps": 10, "index": 3, **tunables}
    return bitmask_ao(g.depth, g.normal, g.camera, hit=g.hit, compiled=compiled, **tunables)


def gathered(frame: Frame, *, compiled: bool | None, **tunables: Any) -> tuple[Tensor, ...]:
    g = frame.gbuffer
    tunables = {"thickness": g.thickness, "directions": 2, "steps": 16, "index": 3, **tunables}
    light = frame.read("radiance")
    return ssgi(g.depth, g.normal, g.camera, light, frame.read("albedo"), hit=g.hit, compiled=compiled, **tunables)


SWEEPS = {
    "one radius": (occluded, {"radius": 1.5}),
    "two radii": (occluded, {"radius": 1.0, "scales": 2}),
    "assumed thickness": (occluded, {"radius": 1.0, "scales": 3, "thickness": 0.4}),
    "sky": (occluded, {"radius": None}),
    "light": (gathered, {}),
    "light within a distance": (gathered, {"distance": 3.0}),
    "light at every second pixel": (gathered, {"resolution": 2, "thickness": None}),
}


@pytest.mark.parametrize("case", ["perspective", "orthographic", "jittered", "batch"])
@pytest.mark.parametrize("sweep", SWEEPS)
def test_kernel_equals_reference(sweep: str, case: str) -> None:
    run, tunables = SWEEPS[sweep]
    frame = boxes.frame(view(case))
    fast, slow = run(frame, compiled=True, **tunables), run(frame, compiled=False, **tunables)
    for got, want in zip(fast, slow, strict=True):
        apart = (got - want).abs()
        assert got.dtype == want.dtype
        assert (apart.amax(1) <= 1e-4).float().mean() > 0.999, "a sector may flip where rounding meets the dither"
        assert apart.mean() < 1e-5
        assert want.std() > 0.01


@pytest.mark.parametrize("size", [(1, 1), (1, 9), (9, 1), (17, 33)])
def test_any_size(size: tuple[int, int]) -> None:
    frame = boxes.frame(boxes.camera(size))
    for run, tunables in SWEEPS.values():
        for got, want in zip(*(run(frame, compiled=c, **tunables) for c in (True, False)), strict=True):
            torch.testing.assert_close(got, want, atol=1e-4, rtol=0)


def test_light_that_wants_a_gradient_gets_it() -> None:
    frame = boxes.frame(boxes.camera((9, 12)))
    light = frame.read("radiance").clone().requires_grad_()
    gathered(frame.replace(radiance=light), compiled=None)[0].sum().backward()
    assert light.grad is not None
    assert float(light.grad.abs().max()) > 0


def test_operator_is_registered_properly() -> None:
    from post.sweep import op as sweep_ops

    g = boxes.frame(boxes.camera((6, 8))).gbuffer
    around = scene(g.camera, g.depth, g.normal, g.hit, torch.ones_like(g.depth), light=g.normal)
    surfaces, noise = (g.depth[:, 0], g.normal, torch.ones(1, 6), torch.eye(3)[None], g.hit[:, 0]), torch.rand(3, 6, 8)
    picture, turns, sky = around.picture.movedim(1, -1), torch.from_numpy(table()), torch.ones(1, 5)
    for gathers in (True, False):
        pixels = picture if gathers else picture[..., :2]
        arrays = pixels, torch.ones(1, 5), *surfaces, turns, noise, torch.ones(1), sky, torch.ones(9, 12)
        given = (*arrays, around.margin, 1, [0, 0], 2, 4, False, gathers)
        torch.library.opcheck(sweep_ops.sweep_cpu, given, test_utils=("test_schema", "test_faketensor"))


@pytest.mark.parametrize("case", ["batch", "jittered", "orthographic"])
@pytest.mark.parametrize("size", [(24, 31), (3, 2), (1, 9)])
def test_bodies(size: tuple[int, int], case: str) -> None:
    camera = view(case).resized(size)
    depth, solid, chance = torch.rand((3, camera.batch, 1, *size), generator=torch.Generator().manual_seed(0))
    depth, hit, thickness = 4 + depth, chance > 0.2, torch.where(solid > 0.9, torch.inf, solid / 2)
    for hidden, reach in ((0.0, None), (torch.tensor(0.15), torch.tensor(0.2))):
        given = camera, depth, hit, thickness, hidden, reach
        got, want = (planar_thickness(*given, compiled=form) for form in (True, False))
        torch.testing.assert_close(got, want, rtol=1e-5, atol=3e-6)
        assert bool((got > (thickness + hidden) * camera.along_axis(depth.dtype) + 0.01).any()) or reach is not None


def test_bodies_is_an_operator() -> None:
    depth = 4 + torch.rand(2, 1, 5, 6, generator=torch.Generator().manual_seed(0))
    given = depth, depth > 4.2, depth / 9, torch.ones(2, 6), torch.zeros(2, 2), torch.zeros(1), False
    torch.library.opcheck(bodies_cpu, given, test_utils=("test_schema", "test_faketensor"))
