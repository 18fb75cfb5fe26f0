"""The compiled filters against their torch reference."""

from __future__ import annotations

import boxes
import pytest
import torch
from torch import Tensor

from post.filters.constants import HIT
from post.filters.edges import Surface
from post.filters.op import (
    bilateral_cpu,
    bilateral_limits,
    joint_bilateral,
    limits_cpu,
    moments,
    moments_cpu,
    spatial_moments,
    wavelet,
    wavelet_cpu,
)
from post.filters.surfaces import surface, surface_cpu

SIZE = (37, 53)
PHI = {"phi_color": 1.0, "phi_depth": 1.0, "phi_normal": 128.0}
EDGE = {"depth_sensitivity": 1.0, "normal_power": 32.0}
CASES = {"perspective": {}, "orthographic": {"orthographic": True}, "roughness": {"rough": True}}


def scene(size: tuple[int, int] = SIZE, *, orthographic: bool = False, rough: bool = False) -> Surface:
    g = boxes.frame(boxes.camera(size, orthographic=orthographic)).gbuffer
    roughness = torch.linspace(0.0, 1.0, size[1]).expand_as(g.depth) if rough else None
    hit = g.hit & (noise(1, size)[:, :1] > 0.1)  # holes, so that rows begin and end anywhere
    hit[..., :3, :] = False
    return surface(g.depth, g.normal, hit, g.camera, roughness)


def noise(channels: int, size: tuple[int, int] = SIZE) -> Tensor:
    return torch.rand((1, channels, *size), generator=torch.Generator().manual_seed(channels))


def assert_close(got: Tensor, want: Tensor) -> None:
    torch.testing.assert_close(got, want, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("radius", [1, 2])
def test_moments(case: str, radius: int) -> None:
    geometry, light = scene(**CASES[case]), noise(1)
    got, want = (moments(light, geometry, radius=radius, compiled=form) for form in (True, False))
    assert_close(got[:, :, geometry.hit[0, 0]], want[:, :, geometry.hit[0, 0]])
    assert float(want[:, 1:][geometry.hit].std()) > 1e-3, "variances differ, so that the comparison says something"


@pytest.mark.parametrize("power", [128.0, 2048.0])
def test_rows_with_wide_gaps(power: float) -> None:
    size = (17, 300)
    whole = scene(size, rough=True)
    guide = whole.guide.clone()
    guide[:, HIT, 4:, 60:150], guide[:, HIT, 9:, 230:] = 0.0, 0.0
    geometry, values = Surface(guide, whole.plane, whole.perspective), noise(5, size)
    one = noise(1, size)
    for form in ("wavelet", "moments", "bilateral"):
        got, want = (_filtered(form, values, geometry, one, power, compiled) for compiled in (True, False))
        assert_close(got[:, :, geometry.hit[0, 0]], want[:, :, geometry.hit[0, 0]])


def _filtered(form: str, values: Tensor, geometry: Surface, one: Tensor, power: float, compiled: bool) -> Tensor:
    if form == "wavelet":
        return wavelet(values, geometry, one, step=8, **{**PHI, "phi_normal": power}, compiled=compiled)
    if form == "moments":
        return moments(one, geometry, radius=2, compiled=compiled)
    limits = 0.5 + one, 0.1 + one
    return joint_bilateral(values, geometry, *limits, radius=3, **{**EDGE, "normal_power": power}, compiled=compiled)


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("step", [1, 4, 32])
def test_wavelet(case: str, step: int) -> None:
    geometry, values = scene(**CASES[case]), noise(5)
    got, want = (wavelet(values, geometry, 0.05 * noise(1), step=step, **PHI, compiled=form) for form in (True, False))
    assert_close(got, want)
    assert torch.equal(got[:, :, ~geometry.hit[0, 0]], values[:, :, ~geometry.hit[0, 0]])
    assert step == 32 or float((got - values).abs().mean()) > 0.05


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("radius", [1, 4])
def test_joint_bilateral(case: str, radius: int) -> None:
    geometry, values = scene(**CASES[case]), noise(4)
    inputs = (values, geometry, 0.5 + 4 * noise(1), 0.1 + noise(2)[:, 1:])
    got, want = (joint_bilateral(*inputs, radius=radius, **EDGE, compiled=form) for form in (True, False))
    assert_close(got, want)
    assert float((got - values[:, :-1]).abs().mean()) > 0.03


@pytest.mark.parametrize("power", [2.0, 40.0, 200.0])
def test_powers_of_normals_that_squares_do_not_make(power: float) -> None:
    flat = scene()
    normal = torch.nn.functional.normalize(flat.guide[:, 1:4] + 0.4 * noise(3), dim=1)
    geometry = Surface(torch.cat([flat.guide[:, :1], normal, flat.guide[:, 4:]], dim=1), flat.plane, True)
    inputs = (noise(2), geometry, 4 + 0 * noise(1), 1 + noise(1))
    options = {"radius": 2, "depth_sensitivity": 1.0, "normal_power": power}
    got, want = (joint_bilateral(*inputs, **options, compiled=form) for form in (True, False))
    assert_close(got, want)


def test_limits() -> None:
    given, options = (noise(1) - 0.5, noise(2)[:, 1:] - 0.1), {"sigma": 3.0, "sensitivity": 0.7, "phi_color": 2.0}
    got, want = (bilateral_limits(*given, **options, compiled=form) for form in (True, False))
    for one, other in zip(got, want, strict=True):
        assert_close(one, other)
        assert float(other.std()) > 0.01


@pytest.mark.parametrize("size", [(1, 1), (1, 9), (9, 1), (2, 2), (5, 3)])
def test_pictures_smaller_than_the_kernel(size: tuple[int, int]) -> None:
    ones = torch.ones(1, 1, *size)
    geometry = Surface(torch.cat([ones, 0 * ones, 0 * ones, ones, ones], dim=1), torch.cat([ones] * 4, dim=1), True)
    for form in (wavelet, joint_bilateral, moments):
        values = noise(4, size)
        options = {
            wavelet: ((values, geometry, 0 * ones), {"step": 4, **PHI}),
            joint_bilateral: ((values, geometry, 2 * ones, ones), {"radius": 4, **EDGE}),
            moments: ((values[:, :1], geometry), {"radius": 2}),
        }[form]
        got, want = (form(*options[0], **options[1], compiled=compiled) for compiled in (True, False))
        assert_close(got, want)


@pytest.mark.parametrize("power", [0.0, 0.5])
def test_normals_that_face_away(power: float) -> None:
    """A power of 0 counts every normal; any other counts none that is more than a right angle away."""
    ones = torch.ones(1, 1, 3, 4)
    flip = torch.tensor([1.0, -1.0, 1.0, -1.0]).expand_as(ones)
    geometry = Surface(torch.cat([ones, 0 * ones, 0 * ones, flip, ones], dim=1), 0 * torch.cat([ones] * 4, dim=1), True)
    inputs = (noise(2, (3, 4)), geometry, 3 * ones, 10 * ones)
    options = {"radius": 2, "depth_sensitivity": 1.0, "normal_power": power}
    got, want = (joint_bilateral(*inputs, **options, compiled=form) for form in (True, False))
    assert_close(got, want)


def test_batches() -> None:
    one, other = scene(), scene(orthographic=False, rough=False)
    both = Surface(torch.cat([one.guide, other.guide.flip(-1)]), torch.cat([one.plane, other.plane]), True)
    values = torch.cat([noise(5), noise(5).flip(-2)])
    got = wavelet(values, both, torch.zeros(2, 1, *SIZE), step=2, **PHI, compiled=True)
    for b in range(2):
        alone = Surface(both.guide[b : b + 1], both.plane[b : b + 1], True)
        want = wavelet(values[b : b + 1], alone, torch.zeros(1, 1, *SIZE), step=2, **PHI, compiled=True)
        assert torch.equal(got[b : b + 1], want)


def test_a_tunable_that_wants_a_gradient_gets_the_reference() -> None:
    sensitivity = torch.tensor(1.0, requires_grad=True)
    mean, variance = spatial_moments(noise(3), scene(), depth_sensitivity=sensitivity)  # pyright: ignore[reportArgumentType]
    (mean + variance).sum().backward()
    assert sensitivity.grad is not None
    assert float(sensitivity.grad) != 0


def test_operators_are_registered_properly() -> None:
    geometry, checks = scene(), ("test_schema", "test_faketensor")
    planes = (geometry.guide, geometry.plane)
    for operator, given in (
        (moments_cpu, (noise(1), *planes, 1, True, 1.0)),
        (wavelet_cpu, (noise(5), *planes, noise(1), 2, True, 1.0, 1.0, 128.0)),
        (limits_cpu, (noise(1), noise(1), 1.0, 1.0, 1.0)),
        (bilateral_cpu, (noise(4), *planes, noise(1), noise(1), 2, True, 1.0, 32.0)),
    ):
        torch.library.opcheck(operator, given, test_utils=checks)


@pytest.mark.parametrize("case", ["perspective", "orthographic", "jittered", "one pixel"])
@pytest.mark.parametrize("rough", [False, True])
def test_surface(case: str, rough: bool) -> None:
    camera = boxes.camera((1, 1) if case == "one pixel" else (45, 61), orthographic=case == "orthographic")
    g = boxes.frame(camera.with_jitter((0.3, -0.4)) if case == "jittered" else camera).gbuffer
    given = (g.depth, g.normal, g.hit, g.camera, g.roughness if rough else None)
    got, want = (surface(*given, compiled=form) for form in (True, False))
    assert torch.equal(got.guide, want.guide)
    torch.testing.assert_close(got.plane, want.plane, rtol=1e-5, atol=1e-6)
    assert got.perspective == want.perspective == (case != "orthographic")
    channels = (g.depth, g.normal, g.hit, g.depth[:, :0], g.camera.lens, torch.eye(3)[None], False)
    torch.library.opcheck(surface_cpu, channels, test_utils=("test_schema", "test_faketensor"))
