"""Small voxel scenes for tests of the tracer."""

from __future__ import annotations

import math
from dataclasses import replace

import torch
from torch import Tensor

from gbufrt import Camera, GBuffer
from tracer.scene.material import Material, MaterialTable
from tracer.scene.scene import MASK_ALL, Instance, Scene, Sky, Sun
from tracer.scene.world import World

TABLE = MaterialTable.of(
    [
        Material(name="stone"),
        Material(name="glass", opacity=0.25, tint=(0.9, 0.7, 0.5)),
        Material(name="water", opacity=0.5, tint=(0.4, 0.8, 0.9)),
        Material(name="lamp", emission=(4.0, 3.0, 2.0)),
    ]
)
STONE, GLASS, WATER, LAMP = 1, 2, 3, 4
EVEN = (0.5, 0.6, 0.7)
DARK = Sky(zenith=(0.0, 0.0, 0.0), horizon=(0.0, 0.0, 0.0), ground=(0.0, 0.0, 0.0))
EVEN_SKY = Sky(zenith=EVEN, horizon=EVEN, ground=EVEN)


def world(
    size: tuple[int, int, int],
    *boxes: tuple[int, tuple[int, int, int], tuple[int, int, int]],
    table: MaterialTable = TABLE,
    **kw,
) -> World:
    """A grid of ``size`` with boxes of (id, low corner, high corner) in it."""
    voxels = torch.zeros(size, dtype=torch.int16)
    for voxel, low, high in boxes:
        voxels[tuple(slice(a, b) for a, b in zip(low, high, strict=True))] = voxel
    return World.from_dense(voxels, table, **kw)


def above(*, size: tuple[int, int] = (8, 8), span: float = 4.0, height: float = 30.0) -> Camera:
    """Looks straight down on the middle of 48x48 voxels; picture right is +x."""
    return Camera.look_at((24, height, 24), (24, 0, 24), size=size, up=(0.0, 0.0, -1.0), orthographic_height=span)


def random_world(seed: int, size: tuple[int, int, int] = (37, 22, 41), *, share: float = 0.03, **kw) -> World:
    """Scattered voxels and a few blocks of every material."""
    g = torch.Generator().manual_seed(seed)
    voxels = torch.randint(1, len(TABLE), size, generator=g) * (torch.rand(size, generator=g) < share)
    for _ in range(5):
        low = [int(torch.randint(0, n - 4, (), generator=g)) for n in size]
        side = torch.randint(1, 7, (3,), generator=g).tolist()
        voxels[tuple(slice(a, a + n) for a, n in zip(low, side, strict=True))] = int(
            torch.randint(1, len(TABLE), (), generator=g)
        )
    return World.from_dense(voxels.to(torch.int16), TABLE, **kw)


def pose(position: tuple[float, float, float], *, yaw: float = 0.0, pitch: float = 0.0) -> Tensor:
    """World from model: pitched about x, then turned about y (radians), then moved."""
    c, s, cp, sp = math.cos(yaw), math.sin(yaw), math.cos(pitch), math.sin(pitch)
    turn = torch.tensor([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    tilt = torch.tensor([[1.0, 0.0, 0.0], [0.0, cp, -sp], [0.0, sp, cp]])
    matrix = torch.eye(4)
    matrix[:3, :3] = turn @ tilt
    matrix[:3, 3] = torch.tensor(position)
    return matrix


def random_scene(seed: int) -> Scene:
    """A random world at a negative origin and two turning, moving models of which one is finely scaled."""
    model = random_world(seed + 1, (9, 8, 7), share=0.4, origin=(-4, -4, -3))
    return Scene(
        world=random_world(seed, origin=(-20, -6, -17)),
        instances=(
            Instance(model=model, pose=lambda t: pose((-3.0 + t, 4.0, 2.0), yaw=0.6 + t, pitch=0.3)),
            Instance(model=model, pose=lambda t: pose((5.0, 6.0 - t, -2.0), yaw=-1.1), scale=0.4, mask=MASK_ALL & ~2),
        ),
    )


def random_rays(seed: int, count: int) -> tuple[Tensor, Tensor]:
    """Rays of all kinds through `random_scene`: from far outside, from inside, on faces and edges, along axes."""
    g = torch.Generator().manual_seed(seed)
    origins = (torch.rand(count, 3, generator=g) - 0.5) * torch.tensor([70.0, 50.0, 70.0])
    directions = torch.nn.functional.normalize(torch.randn(count, 3, generator=g), dim=1)
    kind = torch.arange(count) % 6
    aimed = torch.nn.functional.normalize((torch.rand(count, 3, generator=g) - 0.5) * 20 - origins, dim=1)
    directions = torch.where((kind == 0)[:, None], aimed, directions)
    origins = torch.where((kind == 1)[:, None], origins * 0.4, origins)
    axis = torch.nn.functional.one_hot(torch.randint(0, 3, (count,), generator=g), 3)
    along = axis * (1.0 - 2.0 * torch.randint(0, 2, (count, 1), generator=g))
    directions = torch.where(((kind == 2) | (kind == 3))[:, None], along, directions)
    origins = torch.where((kind == 3)[:, None], origins.round(), origins)
    origins = torch.where((kind == 4)[:, None] & (axis > 0), (origins * 0.4).round(), origins)
    origins = torch.where((kind == 5)[:, None], (origins * 0.4).round(), origins)
    return origins, directions


def polished_scene(seed: int) -> Scene:
    """`random_scene` with every kind of surface: metals and dielectrics, sharp and rough, glass and lamps."""
    table = MaterialTable.of(
        [
            Material(name="diffuse", albedo=(0.7, 0.5, 0.3)),
            Material(name="glass", opacity=0.25, tint=(0.9, 0.7, 0.5), roughness=0.05),
            Material(name="metal", albedo=(0.9, 0.6, 0.4), metallic=1.0, roughness=0.4),
            Material(name="mirror", albedo=(0.9, 0.9, 0.9), metallic=0.7, roughness=0.02),
            Material(name="lamp", emission=(4.0, 3.0, 2.0), roughness=0.2),
        ]
    )
    scene, g = random_scene(seed), torch.Generator().manual_seed(seed)

    def recast(world: World) -> World:
        other = torch.randint(1, len(table), world.bricks.shape, generator=g).to(world.bricks)
        return World(
            bricks=torch.where(world.bricks > 0, other, world.bricks),
            index=world.index,
            origin=world.origin,
            materials=table,
        )

    return Scene(
        world=recast(scene.world),
        instances=tuple(
            Instance(model=recast(i.model), pose=i.pose, scale=i.scale, mask=i.mask) for i in scene.instances
        ),
        sun=Sun(angular_radius=2.0),
    )


def gallery(
    metallic: float, albedo: tuple[float, float, float] = (0.9, 0.8, 0.7), *, size: tuple[int, int] = (10, 13)
) -> tuple[Scene, Camera]:
    """Walls that send light to and fro, round a lamp."""
    wall = Material(name="wall", albedo=albedo, roughness=0.4, metallic=metallic)
    lamp = Material(name="lamp", emission=(4.0, 3.0, 2.0))
    table = MaterialTable.of([wall, *(Material(name=name) for name in ("glass", "water")), lamp])
    sides = ((STONE, (0, 0, 0), (9, 1, 9)), (STONE, (0, 8, 0), (9, 9, 9)), (STONE, (0, 1, 0), (1, 8, 9)))
    far = ((STONE, (8, 1, 0), (9, 8, 9)), (STONE, (1, 1, 0), (8, 8, 1)), (LAMP, (4, 5, 4), (5, 6, 5)))
    room = replace(world((9, 9, 9), *sides, *far), materials=table)
    inside = Camera.look_at((4.5, 4.0, 8.9), (4.0, 3.0, 0.0), size=size, far=100.0)
    sky = Sky(zenith=EVEN, horizon=EVEN, ground=EVEN)
    return Scene(world=room, sun=Sun(direction=(0.1, 0.2, 0.9)), sky=sky), inside


def points_of(g: GBuffer) -> torch.Tensor:
    return g.camera.to_world(g.points_view())
