"""Textures on faces: which texel a ray sees, near and far, at rest and on instances; and all light paths use them."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch
import torch.nn.functional as F
import voxels
from torch import Tensor

from gbufrt import Camera, GBuffer
from tracer.frames import render
from tracer.gbuffers import gbuffer
from tracer.lights.samples import Lights
from tracer.paths import op as path_ops
from tracer.paths import radiance as path_radiance
from tracer.scene.material import Material, MaterialTable
from tracer.scene.scene import Instance, Scene, Sun
from tracer.scene.textures import COLOR, COLUMNS, GLOW, METAL, ROUGH, TILT, Textures, with_mips
from tracer.scene.world import World
from tracer.texture import GRAZING
from tracer.truth.truth import ambient_occlusion

S = 4
EYES = ((-3, 0.6, 0.4), (4, 0.6, 0.4), (0.6, -3, 0.41), (0.6, 4, 0.41), (0.6, 0.4, -3), (0.6, 0.4, 4))


def numbered(side: int = S) -> Tensor:
    """``(6, S, S, 10)``: a texture for each face; red is the row, green the column, blue the face."""
    rows, columns = torch.meshgrid(torch.arange(side), torch.arange(side), indexing="ij")
    texels = torch.zeros(6, side, side, COLUMNS)
    texels[..., 0], texels[..., 1] = rows / side, columns / side
    texels[..., 2] = torch.arange(6)[:, None, None] / 6
    texels[..., ROUGH], texels[..., METAL] = texels[..., 0], texels[..., 1]
    texels[..., GLOW : GLOW + 3] = 3 * texels[..., :3]
    return texels


def skinned(texels: Tensor, *plain: Material) -> MaterialTable:
    """A table whose first material has these textures, and others that have none."""
    table = MaterialTable.of([Material(name="skin"), *plain])
    rows = [with_mips(face) for face in texels]
    faces = torch.zeros(len(table), 6, 2, dtype=torch.int32)
    faces[1, :, 0] = torch.arange(6) * len(rows[0])
    faces[1, :, 1] = texels.shape[1]
    return replace(table, textures=Textures(faces=faces, texels=torch.cat(rows)))


def channel(gbuffer: GBuffer, name: str) -> Tensor:
    """``(C, H, W)`` of the only picture."""
    return getattr(gbuffer, name)[0]


def block(table: MaterialTable, *, shaped: bool, pose: Tensor | None = None) -> Scene:
    """One block at the origin: a voxel of the world, or 8 x 8 x 8 of an instance."""
    if not shaped:
        return Scene(world=World.from_dense(torch.ones(1, 1, 1, dtype=torch.long), table))
    model = World.from_dense(torch.ones(8, 8, 8, dtype=torch.long), table)
    still = torch.eye(4) if pose is None else pose
    nothing = World.from_dense(torch.zeros(1, 1, 1, dtype=torch.long), table)
    return Scene(world=nothing, instances=(Instance(model=model, pose=lambda _: still, scale=1 / 8),))


@pytest.mark.parametrize("shaped", [False, True])
@pytest.mark.parametrize("face", range(6))
def test_every_face_shows_its_own_texture_along_its_axes(face: int, shaped: bool):
    target = [0.6, 0.6, 0.4]
    camera = Camera.look_at(EYES[face], target, size=(40, 40), fov_y=20.0)
    g = gbuffer(block(skinned(numbered()), shaped=shaped), camera)
    points = camera.to_world(g.points_view())[0].flatten(1)
    hit = g.hit.flatten() & ((points[face // 2] - face % 2).abs() < 1e-4)
    points, albedo = points[:, hit], channel(g, "albedo").flatten(1)[:, hit]
    first, second = [points[axis] for axis in range(3) if axis != face // 2]
    inner = ((first * S % 1 - 0.5).abs() < 0.45) & ((second * S % 1 - 0.5).abs() < 0.45)
    wanted = torch.stack([(second * S).floor() / S, (first * S).floor() / S, torch.full_like(first, face / 6)])
    assert inner.sum() > 300
    torch.testing.assert_close(albedo[:, inner], wanted[:, inner])
    assert len(albedo[:, inner].unique(dim=1).T) == S * S
    g.validate()
    for name, value in (("roughness", albedo[0]), ("metallic", albedo[1])):
        torch.testing.assert_close(channel(g, name).flatten(1)[0, hit], value)
    torch.testing.assert_close(channel(g, "emission").flatten(1)[:, hit], 3 * albedo)


def test_far_faces_show_means_of_their_texels():
    """From so far that a texel spans a quarter of a pixel, each pixel shows what four by four would average to."""
    texels = torch.rand(6, 8, 8, COLUMNS, generator=torch.Generator().manual_seed(1))
    texels[..., TILT : TILT + 2] = 0
    scene = block(skinned(texels), shaped=False)
    level = with_mips(texels[3])
    for texels_per_pixel, first, count in ((1, 0, 64), (2, 64, 16), (4, 80, 4), (8, 84, 1)):
        camera = Camera.look_at(
            (0.5, 40, 0.5001), (0.5, 0, 0.5), size=(16, 16), orthographic_height=2.0 * texels_per_pixel
        )
        g = gbuffer(scene, camera)
        seen = channel(g, "albedo").permute(1, 2, 0)[g.hit[0, 0]]
        allowed = level[first : first + count, COLOR : COLOR + 3]
        assert ((seen[:, None] - allowed).abs().amax(dim=-1).amin(dim=1) < 1e-5).all()


def test_a_tilted_texture_turns_the_normal_and_never_away_from_the_eye():
    texels = numbered()
    texels[..., TILT], texels[..., TILT + 1] = 0.6, 0.0
    turn = voxels.pose((0.0, 0.0, 0.0), yaw=90.0)
    for pose, wanted in ((None, (0.6, 0.8, 0.0)), (turn, turn[:3, :3] @ torch.tensor([0.6, 0.8, 0.0]))):
        scene = block(skinned(texels), shaped=True, pose=pose)
        middle = (torch.eye(4) if pose is None else pose) @ torch.tensor([0.5, 1.0, 0.5, 1.0])
        x, y, z, _ = middle.tolist()
        g = gbuffer(scene, Camera.look_at((x, y + 4, z + 0.01), (x, y, z), size=(8, 8), fov_y=8.0))
        torch.testing.assert_close(g.normal[0, :, 4, 4], torch.as_tensor(wanted), atol=1e-5, rtol=0)
        torch.testing.assert_close(channel(g, "normal_geo")[:, 4, 4], torch.tensor([0.0, 1.0, 0.0]), atol=1e-5, rtol=0)
        g.validate()
    low = gbuffer(
        block(skinned(texels), shaped=False), Camera.look_at((-9, 1.5, 0.5), (0.5, 1, 0.5), size=(64, 64), fov_y=9)
    )
    low.validate()
    top = low.hit[0, 0] & (channel(low, "normal_geo")[1] > 0.5)
    facing = -(low.normal[0] * low.camera.rays()[1][0].permute(2, 0, 1)).sum(0)[top]
    assert len(facing) > 50
    assert (facing > 0.9 * GRAZING).all()


def test_faces_without_a_texture_are_as_before():
    plain = MaterialTable.of([Material(name="skin")])
    camera = Camera.look_at((3, 3, 4), (0.5, 0.5, 0.5), size=(24, 24))
    before = gbuffer(block(plain, shaped=False), camera)
    bare = replace(plain, textures=Textures.none(2, plain.albedo))
    after = gbuffer(block(bare, shaped=False), camera)
    for name in before.present:
        torch.testing.assert_close(getattr(after, name), getattr(before, name), rtol=0, atol=0)


def test_joined_tables_keep_their_textures():
    first, second = skinned(numbered()), skinned(1 - numbered(8), Material(name="other"))
    plain = MaterialTable.of([Material(name="plain")])
    joined = MaterialTable.joined([first, plain, second], ["air", "a", "b", "c", "d"])
    assert joined.textures is not None
    assert joined.textures.faces[..., 1].tolist() == [[0] * 6, [4] * 6, [0] * 6, [8] * 6, [0] * 6]
    begin = int(joined.textures.faces[3, 5, 0])
    torch.testing.assert_close(joined.textures.texels[begin : begin + 64].view(8, 8, -1), (1 - numbered(8))[5])


def test_mips_are_means():
    texels = torch.rand(4, 4, 2)
    rows = with_mips(texels)
    assert len(rows) == 16 + 4 + 1
    torch.testing.assert_close(rows[16], texels[:2, :2].mean(dim=(0, 1)))
    torch.testing.assert_close(rows[17], texels[:2, 2:].mean(dim=(0, 1)))
    torch.testing.assert_close(rows[-1], texels.mean(dim=(0, 1)))


def painted(seed: int) -> Scene:
    """A scene whose every second material has textures of its own on all faces."""
    scene, made = voxels.polished_scene(seed), torch.Generator().manual_seed(seed)

    def with_textures(world: World) -> World:
        count = len(world.materials)
        texels = torch.rand(count * 6, 4, 4, COLUMNS, generator=made)
        texels[..., TILT : TILT + 2] -= 0.5
        texels[..., GLOW : GLOW + 3] *= (world.materials.emission.amax(dim=1) > 0).repeat_interleave(6)[
            :, None, None, None
        ]
        faces = torch.zeros(count, 6, 2, dtype=torch.int32)
        faces[..., 0] = torch.arange(count * 6).view(count, 6) * 21
        faces[1::2, :, 1] = 4
        own = Textures(faces=faces, texels=torch.cat([with_mips(t) for t in texels]))
        return replace(world, materials=replace(world.materials, textures=own))

    return replace(
        scene,
        world=with_textures(scene.world),
        instances=tuple(replace(i, model=with_textures(i.model)) for i in scene.instances),
    )


def test_compiled_paths_see_the_same_textures():
    scene, count = painted(3), 2000
    poses = scene.poses([0.3])[0]
    u = torch.rand(1 + path_radiance.MORE * 3, count, generator=torch.Generator().manual_seed(4))
    given = {"bounces": 2, "poses": poses, "t_min": 0.05, "t_max": 100.0, "detail": 60.0, "spreads": True}
    rays = voxels.random_rays(3, count)
    got, want = (f.radiance(scene, Lights.of(scene, poses), *rays, u, **given)[0] for f in (path_ops, path_radiance))
    off = (got - want).abs() > 1e-3 + 1e-2 * want.abs()
    assert off.float().mean() <= 0.006
    plain = path_ops.radiance(voxels.polished_scene(3), Lights.of(scene, poses), *rays, u, **given)[0]
    assert ((plain - got).abs() > 0.01).float().mean() > 0.2


def test_direct_light_and_truth_use_the_textured_normal():
    """A floor tilted by its texture is lit, and open, as a tilted floor is, but for what the flat one hides."""
    texels = torch.zeros(6, 1, 1, COLUMNS)
    texels[..., COLOR : COLOR + 3], texels[..., ROUGH], texels[..., TILT] = 0.5, 1.0, 0.6
    floor = World.from_dense(torch.ones(64, 1, 64, dtype=torch.long), skinned(texels))
    scene, sun = Scene(world=floor), Sun()
    frame = render(scene, Camera.look_at((32, 9, 32.01), (32, 1, 32), size=(8, 8), fov_y=20.0))
    toward = F.normalize(torch.tensor(sun.direction), dim=0)
    wanted = 0.5 / math.pi * torch.tensor(sun.irradiance) * (toward @ torch.tensor([0.6, 0.8, 0.0]))
    assert frame.radiance is not None
    torch.testing.assert_close(frame.radiance[0, :, 4, 4], wanted, rtol=0.01, atol=0)
    truth = ambient_occlusion(scene, frame.gbuffer, radius=10.0, samples=256)
    assert float(truth["ao"].mean()) == pytest.approx((1 + 0.8) / 2, abs=0.01)


def test_faces_vary_near_and_are_flat_far() -> None:
    table = MaterialTable.of([Material(name="a", albedo=(0.5, 0.4, 0.3), variation=0.2)])
    scene = Scene(world=World.from_dense(torch.ones(64, 64, 1, dtype=torch.int16), table, origin=(-32, -32, 0)))
    mean = torch.tensor([0.5, 0.4, 0.3])[None, :, None, None]

    def visible(distance: float) -> Tensor:
        camera = Camera.look_at((0.3, 0.2, 1 + distance), (0.3, 0.2, 0.0), size=(64, 64), far=9000.0)
        albedo = gbuffer(scene, camera).albedo
        assert albedo is not None
        return albedo / mean - 1

    near = visible(4.0)
    assert 0.04 < float(near.std()) < 0.2
    assert float(near.abs().max()) < 0.2 * 1.3
    assert abs(float(near.mean())) < 0.03
    assert float(near[..., 1:].sub(near[..., :-1]).abs().mean()) > 0.01
    far = Camera.look_at((0.3, 0.2, 200.0), (0.3, 0.2, 0.0), size=(64, 64), far=9000.0)
    g = gbuffer(scene, far)
    assert g.albedo is not None
    torch.testing.assert_close(g.albedo[g.hit.expand(-1, 3, -1, -1)].view(3, -1).mean(1), mean.flatten())
    assert float(g.albedo[:, 0][g.hit[:, 0]].std()) < 1e-6
