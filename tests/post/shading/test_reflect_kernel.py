"""The compiled form of reflections against its torch reference."""

from __future__ import annotations

from typing import Any

import boxes
import pytest
import torch
from torch import Tensor

from gbufrt import Camera
from post.march.rays import depth_hierarchy, lens_of
from post.shading import lobes
from post.shading.incoming import Picture
from post.shading.op import reflect, reflect_cpu

SHIFTS = torch.stack([torch.tensor([(0.25, 0.625), (0.7, 0.1), (0.45, 0.9), (0.95, 0.3)]) + n / 9 for n in range(4)])
OPTIONS = {"bounces": 2, "steps": 64, "distance": 60.0}


def noise(channels: int, size: tuple[int, int], seed: int, batch: int = 1) -> Tensor:
    return torch.rand((batch, channels, *size), generator=torch.Generator().manual_seed(seed))


def smooth(picture: Tensor) -> Tensor:
    return torch.nn.functional.avg_pool2d(picture, 9, 1, 4, count_include_pad=False)


def scene(camera: Camera, *, world: Tensor = boxes.ROOM) -> tuple[Any, ...]:
    """Boxes of every roughness, mirrors among them, whose normals are a little bent, lit by smooth random colours."""
    g = boxes.frame(camera, boxes=world).gbuffer
    size, batch = camera.size, camera.batch
    bent = torch.nn.functional.normalize(g.normal + 0.2 * (noise(3, size, 1, batch) - 0.5), dim=1)
    visibility = (2 * smooth(noise(1, size, 2, batch)) - 0.5).clamp(0, 1)
    picture = Picture(
        g.depth,
        g.hit,
        torch.where(g.hit, bent, 0.0),
        g.normal,
        (1.5 * smooth(noise(1, size, 3, batch)) - 0.5).clamp(0, 1),
        smooth(noise(3, size, 4, batch)),
        torch.where(g.hit, 4 * smooth(noise(3, size, 5, batch)), 0.0),
        4 * noise(3, (8, 16), 6),
        visibility,
        torch.nn.functional.normalize(bent + 0.3, dim=1),
        (3 * smooth(noise(1, size, 9, batch)) - 1).clamp(0, 1),
        noise(4, (6, 12), 10, batch),
    )
    hierarchy = depth_hierarchy(g.depth, g.normal, camera, hit=g.hit, thickness=0.4)
    return picture, hierarchy, camera, noise(2, size, 7)[0]


CAMERAS = {
    "perspective": boxes.camera((72, 96)),
    "orthographic": boxes.camera((72, 96), orthographic=True),
    "jittered": boxes.camera((72, 96)).with_jitter((0.3, -0.4)),
    "odd": boxes.camera((127, 73)),
    "two": boxes.cameras(2, (60, 80)),
    "one row": boxes.camera((1, 9)),
    "one column": boxes.camera((9, 1)),
}


def both_forms(*arguments, **changes) -> tuple[Tensor, Tensor]:
    got, want = (reflect(*arguments, shifts=SHIFTS, **(OPTIONS | changes), compiled=form) for form in (True, False))
    return got, want


def assert_alike(got: Tensor, want: Tensor) -> None:
    """Rays that end at another pixel, by rounding, are few; the rest agree to rounding of positions."""
    apart = (got - want).abs() / want.abs().clamp_min(0.02)
    assert torch.isfinite(got).all()
    assert float((apart < 1e-3).all(dim=1).float().mean()) > 0.998
    assert float(apart.median()) < 1e-5
    torch.testing.assert_close(got.mean((2, 3)), want.mean((2, 3)), rtol=1e-3, atol=1e-5)


@pytest.mark.parametrize("case", CAMERAS)
def test_kernel_equals_reference(case: str) -> None:
    arguments = scene(CAMERAS[case])
    got, want = both_forms(*arguments)
    assert_alike(got, want)
    if min(CAMERAS[case].size) > 9:
        confidence, hit = want[:, 3:4], arguments[0].hit
        assert float((confidence > 0).float().mean()) > 0.1, "some rays find a surface"
        assert float(((confidence < 1) & hit).float().mean()) > 0.1, "and some do not"


@pytest.mark.parametrize("absent", ["normal_geo", "environment", "visibility", "bent_normal", "metallic"])
def test_kernel_equals_reference_without_a_channel(absent: str) -> None:
    picture, *rest = scene(CAMERAS["perspective"])
    whole, _ = both_forms(picture, *rest)
    got, want = both_forms(picture._replace(**{absent: None}), *rest)
    assert_alike(got, want)
    assert not torch.allclose(got, whole), "the channel counts where it is there"


@pytest.mark.parametrize("changes", [{"roughness_cutoff": 0.3}, {"steps": 3}, {"distance": 2.0}, {"bounces": 1}])
def test_kernel_equals_reference_with_other_options(changes: dict[str, float]) -> None:
    arguments = scene(CAMERAS["perspective"])
    got, want = both_forms(*arguments, **changes)
    assert_alike(got, want)
    assert not torch.allclose(got, both_forms(*arguments)[0])


@pytest.mark.parametrize("compiled", [True, False])
def test_rays_that_are_not_marched_know_only_their_own_pixel(compiled: bool) -> None:
    picture, hierarchy, camera, rays = scene(CAMERAS["perspective"])
    visibility = torch.full_like(picture.depth, 0.3)
    lone = picture._replace(visibility=visibility, hit=torch.ones_like(picture.hit), metallic=None)
    other = visibility.clone()
    other[..., 0, 0] = 1.0

    def result(picture: Any) -> Tensor:
        return reflect(picture, hierarchy, camera, rays, SHIFTS, **OPTIONS, roughness_cutoff=-1.0, compiled=compiled)

    closed, opened = result(lone), result(lone._replace(visibility=other))
    assert torch.equal(closed[..., 1:, 1:], opened[..., 1:, 1:])


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize(("f0", "limit", "off"), [(0.04, "FULL_SHARE", 1e-6), (0.5, "FILTERED", 1.0)])
def test_fewer_rays_where_little_is_reflected_or_lobes_are_broad_keep_the_mean(
    f0: float, limit: str, off: float, compiled: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    picture, hierarchy, camera, _ = scene(boxes.camera((40, 56)))
    picture = picture._replace(f0=0 * picture.f0 + f0, roughness=0 * picture.roughness + 0.6)

    def runs(form: bool) -> Tensor:
        found = [reflect(picture, hierarchy, camera, noise(2, camera.size, i)[0], SHIFTS, **OPTIONS, compiled=form)
                 for i in range(40)]  # fmt: skip
        return torch.stack(found)[:, :, :3]

    few = runs(compiled)
    monkeypatch.setattr(lobes, limit, off)
    every = runs(False)
    assert float(few.mean() / every.mean()) == pytest.approx(1, abs=0.01)
    assert float(few.std(0).mean() / every.std(0).mean()) > 1.2


def test_limits_hold_fireflies() -> None:
    picture, *rest = scene(CAMERAS["perspective"])
    light = picture.light.clone()
    light[..., 30:40, 40:60] *= 1e4
    got, want = both_forms(picture._replace(light=light), *rest)
    assert_alike(got, want)


def test_sky_alone_and_its_seam_and_poles() -> None:
    picture, *rest = scene(CAMERAS["perspective"], world=boxes.ROOM + 500)
    assert not picture.hit.any()
    assert both_forms(picture, *rest)[0].abs().max() == 0
    camera = CAMERAS["perspective"]
    floor = boxes.frame(camera, boxes=boxes.ROOM[:1]).gbuffer
    up = torch.nn.functional.normalize(noise(3, camera.size, 8) - 0.5, dim=1)
    up = torch.where((up * floor.normal).sum(1, keepdim=True) > 0, up, -up)
    mirror = Picture(
        floor.depth, floor.hit, up, None, 0 * floor.depth, torch.ones_like(up), torch.zeros_like(up),
        4 * noise(3, (8, 16), 6), None, None,
    )  # fmt: skip
    assert_alike(*both_forms(mirror, depth_hierarchy(floor.depth, floor.normal, camera, hit=floor.hit), *rest[1:]))


def test_a_pixel_that_is_not_finite_stays_alone() -> None:
    picture, *rest = scene(CAMERAS["perspective"])
    whole, _ = both_forms(picture, *rest)
    roughness, bent = picture.roughness.clone(), picture.normal.clone()
    roughness[..., 50, 40], bent[..., 50, 60] = torch.nan, torch.nan
    got = reflect(picture._replace(roughness=roughness, normal=bent), *rest, shifts=SHIFTS, **OPTIONS, compiled=True)
    assert int((~got.isfinite().all(dim=1)).sum()) <= 2
    assert float((got == whole).all(dim=1).float().mean()) > 0.999  # rays that end there miss what it mirrors


def test_choice_of_form() -> None:
    picture, *rest = scene(boxes.camera((12, 16)))
    for changes in ({"reuse": 1}, {"method": "cone"}):
        with pytest.raises(ValueError, match="no kernel"):
            reflect(picture, *rest, shifts=SHIFTS, **OPTIONS, **changes, compiled=True)
    lit = picture.light.clone().requires_grad_()
    reflect(picture._replace(light=lit), *rest, shifts=SHIFTS, **OPTIONS).sum().backward()
    assert lit.grad is not None
    assert float(lit.grad.abs().sum()) > 0


def test_number_of_threads_changes_nothing() -> None:
    arguments, before = scene(CAMERAS["odd"]), torch.get_num_threads()
    try:
        found = []
        for count in (1, 2):
            torch.set_num_threads(count)
            found.append(reflect(*arguments, shifts=SHIFTS, **OPTIONS, compiled=True))
    finally:
        torch.set_num_threads(before)
    assert torch.equal(*found)


def test_operator_is_registered_properly() -> None:
    camera = boxes.camera((6, 8))
    p, hierarchy, _, offsets = scene(camera)
    view = (*hierarchy, lens_of(camera).float(), 0.05, False, camera.world_from_view[:, :3, :3].contiguous())
    lit = torch.cat([p.light, 1 + 0 * p.depth], dim=1).movedim(1, -1)
    assert p.environment is not None
    assert p.around is not None
    seen = (lit, p.environment.movedim(1, -1), p.around.movedim(1, -1), p.bent_normal, torch.ones(1))
    arguments = (*view, p.hit, p.depth, p.normal, p.normal_geo, p.roughness, p.f0, p.metallic, *seen, offsets)
    checks = ("test_schema", "test_faketensor")
    torch.library.opcheck(reflect_cpu, (*arguments, SHIFTS, 2, 8, 10.0, 100.0, 1.0, 1.0), test_utils=checks)
