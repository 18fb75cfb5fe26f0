"""Compiled paths against the torch reference, number for number."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import pytest
import torch
import voxels
from torch import Tensor

from gbufrt import Camera
from tracer.cache.irradiance import IrradianceCache
from tracer.gbuffers import gbuffer
from tracer.lights.samples import Lights
from tracer.paths import integrators, on_screen_kernel
from tracer.paths import op as path_ops
from tracer.paths import radiance as path_radiance
from tracer.paths.memory import Memory
from tracer.paths.on_screen import Picture
from tracer.paths.receivers import Receivers, receivers_of, summed
from tracer.paths.tables import camera_of, picture_of
from tracer.sampling.sequence import Sequence
from tracer.scene.scene import Scene, Sky
from tracer.traversal.lane_kernel import BATCH
from tracer.traversal.rays import trace

BOUNCES = 3


def case(seed: int, count: int = 3000) -> tuple[Scene, Tensor, Lights, Tensor, Tensor, Tensor]:
    scene = voxels.polished_scene(seed)
    poses = scene.poses([0.3])[0]
    u = torch.rand(1 + path_radiance.MORE * (BOUNCES + 1), count, generator=torch.Generator().manual_seed(seed))
    return scene, poses, Lights.of(scene, poses), *voxels.random_rays(seed, count), u


def same(a: Tensor, b: Tensor, share: float = 0.004) -> None:
    """All but a ``share`` of paths, which graze an edge or a choice, find the same."""
    off = (a - b).abs() > 1e-3 + 1e-2 * b.abs()
    assert off.float().mean() <= share
    assert b[~off].abs().mean() > 0


def place(seed: int, dims: int, *, orthographic: bool = False) -> tuple[Scene, Receivers, Sequence]:
    """Some of what a picture shows, and points for more paths from each pixel than a batch holds of one."""
    scene = voxels.polished_scene(seed)
    camera = Camera.look_at((14, 16, 19), (0, 2, 0), size=(33, 41), orthographic_height=30.0 if orthographic else None)
    shown = gbuffer(scene, camera.with_jitter((0.2, -0.3)), time=0.3)
    at = receivers_of(scene, shown, scene.poses([0.3]))[0]
    u = torch.rand(len(at.pixels), generator=torch.Generator().manual_seed(seed))
    start = replace(at.vertices, inside=u < 0.3)
    return scene, replace(at, surfaces=lambda: start), Sequence.of(4, dims, (33, 41), seed=seed, device=u.device)


CASES: dict[str, tuple[int, dict[str, Any]]] = {
    "occlusion": (integrators.OCCLUSION_DIMS, {"radius": 7.0}),
    "indirect": (integrators.indirect_dims(2), {"bounces": 2}),
    "lit": (integrators.DIRECT_DIMS, {}),
    "reflected": (integrators.REFLECTION_DIMS, {"sharp": 0.3}),
    "lobes": (integrators.lobe_dims(2), {"bounces": 2}),
}


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("name", CASES)
def test_paths_from_surfaces_find_the_same(name: str, orthographic: bool) -> None:
    dims, settings = CASES[name]
    scene, at, sequence = place(len(name), dims, orthographic=orthographic)
    definition = partial(getattr(integrators, name), scene, at, **settings)
    start = () if name == "occlusion" else (at.vertices,)
    for number in range(4):
        one = sequence.part(range(number, number + 1))
        got = getattr(path_ops, name)(scene, at, *start, one, *settings.values())
        want = summed(definition, at, at.vertices, one)
        assert got.keys() == want.keys()
        for key, value in want.items():
            same(got[key], value)


def test_paths_that_read_a_cache_find_the_same() -> None:
    scene, at, sequence = place(5, integrators.lobe_dims(2))
    cache, read = IrradianceCache.empty(), []
    places, normals = at.places.T.split(3, dim=1)
    for number in range(4):
        one = sequence.part(range(number, number + 1))
        memory = Memory(cache=cache, follows=torch.arange(len(at.pixels)) % 9 == number)
        got = path_ops.lobes(scene, at, at.vertices, one, 2, memory)
        want = integrators.lobes(scene, at, at.vertices, one.draw(at.pixels), 2, memory)
        assert got.keys() == want.keys()
        for key, value in want.items():
            same(got[key], value.T)
        samples = got["met"][:9, got["met"][9] > 0].T
        read.append(len(samples))
        cache = cache.update(*samples.split(3, dim=1)).update(places, normals, got["indirect"].T)
    assert read[-1] < 0.8 * read[0], "paths end where the cache knows"


@pytest.mark.parametrize("name", ["occlusion", "indirect", "reflected"])
def test_sums_over_more_paths_than_a_batch_holds_are_those_of_their_parts(name: str) -> None:
    dims, settings = CASES[name]
    scene, at, _ = place(1, dims)
    few = replace(at, pixels=at.pixels[:3], places=at.places[:, :3], surfaces=lambda: at.vertices[:3])
    start = () if name == "occlusion" else (few.vertices,)
    sequence = Sequence.of(2 * BATCH + 7, dims, (33, 41), seed=1, device=at.pixels.device)
    sums = partial(getattr(path_ops, name), scene, few, *start)
    whole, parts = sums(sequence, *settings.values()), list[dict[str, Tensor]]()
    for k in range(0, 2 * BATCH + 7, 80):  # so few that no ray to a light waits for others to go
        parts.append(sums(sequence.part(range(k, min(k + 80, 2 * BATCH + 7))), *settings.values()))
    for key, value in whole.items():
        torch.testing.assert_close(value, sum(part[key] for part in parts), rtol=1e-5, atol=1e-5)  # other order


def test_sums_are_those_of_the_reference_in_its_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    scene, at, _ = place(1, integrators.OCCLUSION_DIMS)
    sequence = Sequence.of(3, integrators.OCCLUSION_DIMS, (33, 41), seed=1, device=at.pixels.device)
    monkeypatch.setattr("tracer.paths.receivers.WIDE", 5)
    want = summed(partial(integrators.occlusion, scene, at, radius=7.0), at, at.vertices, sequence)
    found = path_ops.occlusion(scene, at, sequence, 7.0)
    assert found.keys() == want.keys()
    for key, value in found.items():
        same(value, want[key])


@pytest.mark.parametrize("next_event", [True, False])
@pytest.mark.parametrize("spreads", [True, False])
@pytest.mark.parametrize("moved", [True, False])
def test_paths_bring_the_same_light(next_event: bool, spreads: bool, moved: bool) -> None:
    scene, poses, lights, origins, directions, u = case(3)
    given: dict[str, Any] = {"bounces": BOUNCES, "poses": poses, "t_min": 0.05, "t_max": 100.0}
    given |= {"detail": 200.0 if spreads else 20.0, "spreads": spreads, "next_event": next_event}
    camera = Camera.look_at((14, 16, 19), (0, 2, 0), size=(33, 41))
    when = 0.9 if moved else 0.3
    picture = Picture.of(gbuffer(scene, camera, time=when), 0).moved(scene.poses([when])[0], poses)
    given |= {"picture": picture, "known": u[1] < 0.9 if moved else None}
    found = [f.radiance(scene, lights, origins, directions, u, **given) for f in (path_ops, path_radiance)]
    for got, want in zip(*found, strict=True):
        same(got, want)
        assert (got.mean(0) / want.mean(0) - 1).abs().max() < 0.01
    light, onscreen = found[0]
    assert ((onscreen > 0) & (onscreen < 0.99 * light)).float().mean() > (0.01 if moved else 0.02)
    assert (onscreen <= light).all()
    if moved:
        assert (onscreen[u[1] >= 0.9] == 0).all()
        given["picture"] = None
        for form in (path_ops, path_radiance):
            assert form.radiance(scene, lights, origins, directions, u, **given)[1].abs().max() == 0


@pytest.mark.parametrize("orthographic", [False, True])
def test_what_has_moved_is_looked_for_where_it_was(orthographic: bool) -> None:
    scene, (poses, then) = voxels.polished_scene(3), voxels.polished_scene(3).poses([0.3, 2.3])
    camera = Camera.look_at((14, 16, 19), (0, 2, 0), size=(99, 123), orthographic_height=30.0 if orthographic else None)
    g = gbuffer(scene, camera.with_jitter((0.2, -0.3)), time=2.3)
    picture = Picture.of(g, 0).moved(then, poses)
    _, directions = voxels.random_rays(1, 4000)
    origins = torch.tensor([-2.7, 4.0, 2.0]) - 12 * directions  # round the first of the movers
    hits = trace(scene, origins, directions, poses=poses)
    on = (hits.instance > 0) & hits.hit
    points, normals = (origins + directions * hits.t[:, None])[on], hits.normal[on]
    want = picture.sees(*picture.back_project(points, normals, hits.instance[on]))
    numbers, flat = (of(picture, torch.device("cpu")).numpy() for of in (camera_of, picture_of))
    got = [
        on_screen_kernel.sees(numbers, flat, *on_screen_kernel.back_project(numbers, tuple(p), tuple(n), i))
        for p, n, i in zip(points.tolist(), normals.tolist(), hits.instance[on].tolist(), strict=True)
    ]
    assert (torch.tensor(got) != want).float().mean() < 0.01
    assert (picture.sees(points, normals) != want).float().mean() > 0.05
    assert 0.02 < want.float().mean() < 0.9


@pytest.mark.parametrize("pictured", [False, True])
def test_a_scene_without_sun_and_lamps_is_lit_by_its_sky(pictured: bool) -> None:
    noise = torch.rand(1, 3, 12, 20, generator=torch.Generator().manual_seed(1))
    ground = voxels.world((9, 3, 9), (voxels.STONE, (0, 0, 0), (9, 1, 9)))
    scene = Scene(world=ground, sun=None, sky=Sky(picture=noise) if pictured else Sky())
    poses = scene.poses([0.0])[0]
    origins = torch.rand(500, 3, generator=torch.Generator().manual_seed(0)) * 9 + torch.tensor([0.0, 2.0, 0.0])
    directions = torch.tensor([0.0, -1.0, 0.0]).expand(500, 3)
    u = torch.rand(1 + 2 * path_radiance.MORE, 500, generator=torch.Generator().manual_seed(1))
    lights = Lights.of(scene, poses)
    got, want = (
        f.radiance(scene, lights, origins, directions, u, bounces=1, poses=poses)[0] for f in (path_ops, path_radiance)
    )
    same(got, want)
    assert got.mean() > 0.1
