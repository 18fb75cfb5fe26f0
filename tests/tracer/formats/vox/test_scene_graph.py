"""MagicaVoxel scenes: orientation, rotations, nested transforms, what is hidden, real files."""

from __future__ import annotations

import itertools
import os
from pathlib import Path

import numpy as np
import pytest
import torch
from writers import vox
from writers.vox import MODEL, STEPS, read

from tracer import worlds
from tracer.formats.vox.scene_graph import load_vox_scene, read_vox
from tracer.scene.cells import cells_of_world
from tracer.scene.placement import place
from tracer.scene.world import World
from tracer.traversal.rays import trace


def contents(world: World) -> dict[tuple[int, ...], int]:
    cells, ids = cells_of_world(world)
    return {tuple(c): int(i) for c, i in zip(cells.tolist(), ids, strict=True)}


def by_color(world: World) -> dict[int, tuple[int, ...]]:
    return {i: c for c, i in contents(world).items()}


@pytest.mark.parametrize("version", [150, 200])
def test_z_up_becomes_y_up_without_a_mirror(tmp_path: Path, version: int) -> None:
    at = {k: np.array(v) for k, v in by_color(read(tmp_path, MODEL, version=version)).items()}
    x, y, z = at[2] - at[1], at[3] - at[1], at[4] - at[1]
    assert x.tolist() == [1, 0, 0]
    assert y.tolist() == [0, 0, -1]
    assert z.tolist() == [0, 1, 0]
    assert np.dot(np.cross(x, y), z) == 1


def test_every_rotation_turns_about_the_middle_as_its_byte_says(tmp_path: Path) -> None:
    odd = vox.model((3, 3, 3), STEPS)  # of odd size, so that turns about the middle stay on the grid
    for first, second in itertools.permutations(range(3), 2):
        for signs in range(8):
            byte = first | second << 2 | signs << 4
            rotation = np.zeros((3, 3), int)
            for row, column in enumerate((first, second, 3 - first - second)):
                rotation[row, column] = -1 if signs >> row & 1 else 1
            world = read(tmp_path, odd, vox.transform(0, 1, _r=str(byte), _t="10 -20 30"), vox.shape(1, 0))
            at = by_color(world)
            for x, y, z, color in STEPS:
                p = rotation @ (np.array([x, y, z]) + 0.5 - 1) + (10, -20, 30)
                assert at[color] == (int(np.floor(p[0])), int(np.floor(p[2])), int(np.floor(-p[1])))


def test_transforms_nest_and_models_repeat(tmp_path: Path) -> None:
    quarter = 1 | 0 << 2 | 1 << 4  # x' = -y, y' = x: a quarter turn about z
    dot = vox.model((1, 1, 1), [(0, 0, 0, 9)])
    world = read(
        tmp_path,
        dot,
        vox.transform(0, 1, _r=str(quarter), _t="100 0 0"),
        vox.group(1, 2, 4),
        vox.transform(2, 3, _t="5 0 0"),
        vox.shape(3, 0),
        vox.transform(4, 5, _t="0 0 7"),
        vox.shape(5, 0),
    )
    cells = sorted(contents(world))
    # (5,0,0) turns to (0,5,0), and 100 along x is added; the dot's own cell turns to the other side of the axis
    assert cells == sorted([(99, 0, -6), (99, 7, -1)])


def test_what_is_hidden_by_node_or_layer_stays_hidden(tmp_path: Path) -> None:
    dots = [vox.model((1, 1, 1), [(0, 0, 0, i)]) for i in (1, 2, 3)]
    world = read(
        tmp_path,
        *dots,
        vox.transform(0, 1),
        vox.group(1, 2, 4, 6),
        vox.transform(2, 3, _t="1 0 0"),
        vox.shape(3, 0),
        vox.transform(4, 5, hidden=True, _t="2 0 0"),
        vox.shape(5, 1),
        vox.transform(6, 7, layer=3, _t="3 0 0"),
        vox.shape(7, 2),
        vox.layer(3, hidden=True),
    )
    assert sorted(contents(world).values()) == [1]


def test_a_placed_model_stands_on_ground_and_is_framed(tmp_path: Path) -> None:
    column = vox.model((4, 5, 20), [(x, y, z, 5) for x in range(4) for y in range(5) for z in range(20)])
    scene = place(read(tmp_path, column))
    assert list(scene.views) == ["front", "orbit", "detail"]
    table = scene.world.materials
    for name, view in scene.views.items():
        for t in (0.0, 5.0, 13.0):
            camera = view.camera(t, size=(60, 90))
            assert not bool(scene.world.at(camera.position.floor().long()).any())
            hits = trace(scene, *camera.rays())
            model = hits.hit & (hits.material == 5)
            assert model.any(), name
            if name != "detail":  # all of it is in the picture: nothing touches the border
                border = model[:, 0].any() or model[:, -1].any() or model[:, :, 0].any() or model[:, :, -1].any()
                assert not bool(border)
                rows = model[0].any(dim=1).sum().item()
                assert rows > 30
    under = scene.world.at(torch.tensor([[2, -1, -3], [2, 0, -3]]))
    assert table.names[int(under[0])].startswith("ground")
    assert int(under[1]) == 5


REAL = Path(os.environ.get("GBUFRT_TEST_DATA", "")) / "vox"


@pytest.mark.skipif("GBUFRT_TEST_DATA" not in os.environ, reason="GBUFRT_TEST_DATA is unset: no real .vox scenes")
@pytest.mark.parametrize(("name", "voxels"), [("scene_store8", 441118), ("scene_church1", 181774), ("chr_cop1", 267)])
def test_real_scenes_load(name: str, voxels: int) -> None:
    path = REAL / f"{name}.vox"
    assert int((read_vox(path).bricks > 0).sum()) == voxels
    scene = worlds.load(path)
    hits = trace(scene, *load_vox_scene(path).views["front"].camera(0.0, size=(27, 48)).rays())
    grounded = torch.tensor([n.startswith("ground") for n in scene.materials.names])[hits.material.long()]
    assert (hits.hit & ~grounded).float().mean().item() > 0.08
