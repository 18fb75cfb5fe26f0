"""What mirrors show: virtual images against rays of the tracer."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TypeVar

import pytest
import torch
from court import court
from torch import Tensor

from gbufrt import Camera, GBuffer
from gbufrt.directions import length
from post.mirrors.image import mirror_image
from tracer.gbuffers import gbuffer
from tracer.scene.material import Material, MaterialTable
from tracer.scene.scene import MASK_SECONDARY, Instance, Scene
from tracer.scene.view import View
from tracer.scene.world import World
from tracer.traversal.rays import trace

SIZE = (72, 96)
TURN = 0.1  # radians: a side of the block faces both the mirror and the camera


T = TypeVar("T")


def given(value: T | None) -> T:
    assert value is not None
    return value


def mirrored(vectors: Tensor, normal: Tensor) -> Tensor:
    return vectors - 2 * (vectors * normal).sum(1, keepdim=True) * normal


def reflected(scene: Scene, g: GBuffer, poses: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """By the tracer: where the virtual image of what each pixel reflects lies, and the surface's object and normal."""
    points = g.camera.to_world(g.points_view())
    away = mirrored(-g.camera.rotate_to_world(g.camera.to_eye(g.points_view())), g.normal)
    origins = (points + 1e-3 * g.normal).permute(0, 2, 3, 1)
    hits = trace(scene, origins, away.permute(0, 2, 3, 1), poses=poses, mask=MASK_SECONDARY)
    ends = points + away * torch.where(hits.hit, hits.t, g.camera.far)[:, None]
    return points + mirrored(ends - points, g.normal), hits.instance[:, None], hits.normal.permute(0, 3, 1, 2)


def shown(view: str = "still") -> tuple[Scene, GBuffer]:
    scene = court()
    camera, before = (scene.views[view].camera(t, size=SIZE) for t in (0.1, 0.0))
    return scene, gbuffer(scene, camera, previous_camera=before)


def test_images_lie_where_the_tracer_finds_what_is_reflected():
    scene, g = shown()
    image = given(mirror_image(g))
    assert float(image.mask.float().mean()) > 0.05
    assert torch.equal(image.mask, given(g.metallic) > 0.5)
    truth, _, normal = reflected(scene, g, scene.poses([0.0]))
    found = g.camera.to_world(image.gbuffer.points_view())
    on_screen = image.mask & (length(mirrored(normal, g.normal) - image.gbuffer.normal) < 1e-3)
    assert float(on_screen.sum() / image.mask.sum()) > 0.4
    assert float(length(found - truth)[on_screen].median()) < 0.05


@pytest.mark.parametrize("units", [1 / 64, 1024])
def test_without_thickness_units_do_not_matter(units: float):
    _, g = shown()
    plain = g.replace(thickness=None, motion=None, motion_z=None, previous_camera=None)
    pose, lens = g.camera.world_from_view.clone(), g.camera.intrinsics
    pose[:, :3, 3] *= units
    near, far = g.camera.near * units, g.camera.far * units
    camera = Camera.from_intrinsics(lens, pose, size=g.camera.size, near=near, far=far)
    image = given(mirror_image(plain)).gbuffer.depth
    other = given(mirror_image(plain.replace(camera=camera, depth=g.depth * units))).gbuffer.depth
    assert float((image != g.depth).float().mean()) > 0.05
    assert not ((other / units - image).abs() > 1e-3 * image).any()


def test_unknown_images_share_a_plane_at_the_mean_depth_of_the_known():
    _, g = shown()
    image = given(mirror_image(g))
    points = g.camera.to_world(g.points_view())
    images = g.camera.to_world(image.gbuffer.points_view())
    depth = ((points - images) * g.normal).sum(1, keepdim=True)
    unknown = image.mask & (image.gbuffer.normal == g.normal).all(1, keepdim=True)
    assert 0.1 < float(unknown.sum() / image.mask.sum()) < 0.9
    on_plane = float(depth[unknown].median())
    assert float((depth[unknown] - on_plane).abs().max()) < 1e-5 * on_plane
    known = depth[image.mask & ~unknown]
    assert float(known.min()) < on_plane < float(known.max())
    assert abs(on_plane / float(known.mean()) - 1) < 0.02  # rays that end behind something count too


def test_a_mirror_of_the_sky_alone_shows_it_far_away():
    _, g = shown()
    image = given(mirror_image(g.replace(hit=g.hit & (given(g.metallic) > 0.5))))
    depth = (g.points_view() - image.gbuffer.points_view()) * g.camera.rotate_to_view(g.normal)
    assert torch.allclose(depth.sum(1)[image.mask[:, 0]], torch.tensor(g.camera.far), rtol=1e-3)


def test_albedo_is_that_of_what_is_reflected():
    _, g = shown()
    image = given(mirror_image(g))
    red = image.albedo[:, 0] / image.albedo[:, 2].clamp_min(1e-6)
    assert float((red[image.mask[:, 0]] > 3).float().mean()) > 0.1  # brick
    lit = given(mirror_image(g.replace(emission=torch.full_like(g.normal, 2.0))))
    assert 1.75 < float(lit.emission[lit.emission > 0].median()) < 1.95  # by the reflectance, 0.9
    assert not lit.emission[~(given(g.metallic) > 0.5).expand_as(lit.emission)].any()


def test_motion_follows_the_virtual_image():
    scene, g = shown("turning")
    image = given(mirror_image(g))
    before = scene.views["turning"].camera(0.0, size=SIZE)
    truth, _, normal = reflected(scene, g, scene.poses([0.0]))
    was = before.to_view(truth)
    right = image.mask & (length(mirrored(normal, g.normal) - image.gbuffer.normal) < 1e-3)
    error = length(given(image.gbuffer.motion) - (before.project(was) - g.camera.pixel_centers(dtype=was.dtype)))
    surface = length(given(g.motion) - (before.project(was) - g.camera.pixel_centers(dtype=was.dtype)))
    assert float(error[right].median()) < 0.05 < float(surface[right].median())


def turned(angle: float) -> Tensor:
    """``(4, 4)`` a turn about y."""
    c, s = math.cos(angle), math.sin(angle)
    return torch.tensor([[c, 0, s, 0], [0, 1, 0, 0], [-s, 0, c, 0], [0, 0, 0, 1]])


def passing(moves: str) -> tuple[GBuffer, Tensor, Tensor]:
    """A block before a mirror wall, one of which moves; the motion of the block's virtual image, and its normals."""
    table = MaterialTable.of(
        [Material(name="mirror", roughness=0.0, metallic=1.0, variation=0.0), Material(name="clay", variation=0.0)]
    )
    speed = torch.tensor([8.0, 0.0, 0.0] if moves == "block" else [0.0, 0.0, 8.0])

    def pose(what: str, *place: float, turn: float = 0.0) -> Callable[[float], Tensor]:
        def at(time: float) -> Tensor:
            matrix = turned(turn)
            matrix[:3, 3] = torch.tensor(place) + (speed * time if what == moves else 0.0)
            return matrix

        return at

    def box(*size: int, material: int) -> World:
        return World.from_dense(torch.full(size, material, dtype=torch.int16), table)

    wall = Instance(model=box(32, 16, 1, material=1), pose=pose("mirror", 0.0, 0.0, 0.0))
    block = Instance(model=box(6, 6, 6, material=2), pose=pose("block", 12.0, 5.0, 6.0, turn=TURN))
    scene = Scene(world=box(64, 1, 1, material=2), instances=(wall, block))
    camera = View(eye=lambda t: (24.0, 9.0, 26.0), target=lambda t: (14.0, 7.0, 3.0)).camera(0.0, size=SIZE)
    g = gbuffer(scene, camera, previous_camera=camera, time=0.1, previous_time=0.0)
    truth, instance, normal = reflected(scene, g, scene.poses([0.1]))
    shift = 0.1 * speed * (1 if moves == "block" else 2)
    was = camera.project(camera.to_view(truth - shift[None, :, None, None]))
    expected = was - camera.pixel_centers(dtype=was.dtype)
    return g, torch.where(instance == 2, expected, torch.nan), mirrored(normal, g.normal)


@pytest.mark.parametrize("moves", ["block", "mirror"])
def test_images_move_with_what_is_reflected_and_with_the_mirror(moves):
    g, expected, normal = passing(moves)
    image = given(mirror_image(g))
    block = image.mask & (given(image.gbuffer.object_id) == 2) & expected.isfinite().all(1, keepdim=True)
    assert block.sum() > 20
    assert float(length(expected)[block].median()) > 0.5
    assert float(length(given(image.gbuffer.motion) - expected)[block].median()) < 1e-3
    assert float(length(image.gbuffer.normal - normal)[block].median()) < 1e-5


def test_without_motion_or_cameras_the_rest_is_found():
    g, _, _ = passing("block")
    alone = g.replace(previous_camera=None)
    image, whole = given(mirror_image(alone)), given(mirror_image(g))
    assert torch.equal(image.gbuffer.depth, whole.gbuffer.depth)
    assert torch.equal(given(image.gbuffer.motion), given(g.motion))
    told = given(mirror_image(alone, g.previous_camera))
    assert torch.equal(given(told.gbuffer.motion), given(whole.gbuffer.motion))


def test_no_mirror_no_image():
    g = gbuffer(court(mirror=False), court().views["still"].camera(0.0, size=SIZE))
    assert mirror_image(g) is None
    assert mirror_image(g.replace(metallic=None)) is None
