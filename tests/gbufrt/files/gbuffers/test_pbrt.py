"""Files of pbrt-v4's film "gbuffer": its names, spaces and matrices."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import torch
from writers.foreign_exr import CAMERA, SIZE, truth, write

from gbufrt.camera import Camera
from gbufrt.files import read_gbuffer
from gbufrt.files.gbuffers.agreement import disagreements
from gbufrt.files.gbuffers.carried import carried_camera
from gbufrt.files.gbuffers.detect import detect
from gbufrt.files.gbuffers.profile import load_profile

T = truth()
HIT = T["hit"][..., None]
MIRROR = np.diag([1.0, 1.0, -1.0, 1.0])  # our world in a left-handed one


def header(camera: Camera, *, left: bool = True) -> dict[str, np.ndarray | float]:
    """As its cameras.cpp makes them: matrices before columns, x right, y up, z forward, the shorter side -1 to 1."""
    view = np.diag([1.0, -1.0, 1.0, 1.0]) @ camera.view_from_world[0].double().numpy() @ (MIRROR if left else np.eye(4))
    focal = 2 * float(camera.intrinsics[0, 0, 0]) / min(camera.size)
    near, far = 0.01, 1000.0
    screen = np.array(
        [[focal, 0, 0, 0], [0, focal, 0, 0], [0, 0, far / (far - near), -far * near / (far - near)], [0, 0, 1, 0]]
    )
    halves = np.diag([0.5, 0.5, 0.5, 1.0])
    halves[:3, 3] = 0.5
    matrices = {"worldToCamera": view, "worldToNDC": halves @ screen @ view}
    found = {name: np.ascontiguousarray(matrix, np.float32) for name, matrix in matrices.items()}
    return {**found, "renderTimeSeconds": 1.5}


def layers(*, world: bool) -> dict[str, np.ndarray]:
    """``P``, ``N`` and ``Ns`` in the camera's space or the world, 0 where nothing was hit."""
    origins, directions = (t[0].double().numpy() for t in CAMERA.rays())
    points = origins + directions * np.where(HIT, T["ray"][..., None], 0)
    normal = T["normal"]
    if not world:
        turn, place = (CAMERA.world_from_view[0].double().numpy()[:3, at] for at in (slice(3), 3))
        points, normal = (points - place) @ turn * (1, -1, 1), normal @ turn * (1, -1, 1)
    else:
        points, normal = points * (1, 1, -1), normal * (1, 1, -1)
    grey = np.full((*SIZE, 3), 0.5)
    named = {"P.XYZ": points * HIT, "N.XYZ": normal, "Ns.XYZ": normal, "Albedo.RGB": grey * HIT, "RGB": grey}
    return named | {"Variance.RGB": grey, "RelativeVariance.RGB": grey}


@pytest.mark.parametrize("world", [False, True])
def test_positions_and_the_camera_of_the_file_make_the_frame(world: bool, tmp_path: Path) -> None:
    path = write(tmp_path / "a.exr", layers(world=world), header(CAMERA))  # pyright: ignore[reportArgumentType]
    assert detect(path).name == "pbrt"
    frame = read_gbuffer(path)
    g = frame.gbuffer
    assert disagreements(frame) == []
    assert frame.composite is not None
    assert torch.allclose(g.camera.intrinsics, CAMERA.intrinsics, atol=1e-3)
    assert torch.allclose(g.camera.world_from_view, CAMERA.world_from_view, atol=1e-4)
    assert np.array_equal(g.hit[0, 0].numpy(), T["hit"])
    assert np.allclose(g.depth[0, 0].numpy()[T["hit"]], T["planar"][T["hit"]], rtol=1e-4)
    assert np.allclose(g.normal[0].numpy().transpose(1, 2, 0), T["normal"], atol=1e-4)


@pytest.mark.parametrize("size", [(48, 64), (64, 48)])
@pytest.mark.parametrize("left", [True, False])
def test_the_shorter_side_counts_and_scenes_may_be_mirrored(size: tuple[int, int], left: bool) -> None:
    fov = 2 * math.degrees(math.atan(math.tan(math.radians(25)) * size[0] / min(size)))
    camera = Camera.look_at((0.3, 2, 4), (0, 1.2, 0), size=size, fov_y=fov)
    found = carried_camera(header(camera, left=left), load_profile("pbrt"), size)
    assert found is not None
    assert torch.allclose(found.intrinsics, camera.intrinsics, atol=1e-3)
    assert torch.allclose(found.world_from_view, camera.world_from_view, atol=1e-4)
