"""Axes of normals that were flipped or swapped: named by what is round or askew."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from writers import foreign_exr

from gbufrt.files import read_gbuffer
from gbufrt.files.gbuffers.agreement import disagreements
from gbufrt.files.gbuffers.profile import load_profile


def beside_a_ball() -> tuple[np.ndarray, np.ndarray]:
    """Planar depth and normals of the floor and the wall, and of a ball on the floor."""
    truth = foreign_exr.truth()
    origins, rays = (t[0].double().numpy() for t in foreign_exr.CAMERA.rays())
    middle, radius = np.array([-0.3, 0.9, 0.5]), 0.9
    along = ((middle - origins) * rays).sum(-1)
    inside = radius**2 - ((origins + along[..., None] * rays - middle) ** 2).sum(-1)
    ray = along - np.sqrt(np.maximum(inside, 0))
    round_ = ((origins + ray[..., None] * rays) - middle) / radius
    depth = np.where(inside > 0, ray * (rays @ foreign_exr.CAMERA.forward[0].double().numpy()), truth["planar"])
    return np.where(np.isfinite(depth), depth, 0), np.where((inside > 0)[..., None], round_, truth["normal"])


AXES = 'base = "generic"\nup = "{}"\nnormal_space = "{}"\nnormal_scale = [2, 2, 2]\ndepth_kind = "planar"'


@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize("space", ["world", "opengl"])
@pytest.mark.parametrize(
    ("order", "signs", "told"),
    [
        ((0, 1, 2), (1, 1, 1), None),
        ((0, 1, 2), (-1, 1, 1), "normal_scale = [-2, 2, 2] fits better: normals agree with depth at "),
        ((0, 1, 2), (1, -1, 1), "normal_scale = [2, -2, 2] fits better: normals agree with depth at "),
        ((0, 1, 2), (1, 1, -1), "normal_scale = [2, 2, -2] fits better: normals agree with depth at "),
        ((1, 0, 2), (1, 1, 1), "axes of normals in the order Y, X, Z fit better: they agree with depth at "),
        ((2, 0, 1), (1, 1, -1), "axes of normals in the order Y, -Z, X fit better: they agree with depth at "),
    ],
)
def test_axes_of_normals_are_told_by_what_is_round(
    tmp_path: Path, up: str, space: str, order: tuple[int, ...], signs: tuple[int, ...], told: str | None
) -> None:
    """Of walls along the axes too, where normals that face away are turned, and most fit whatever the signs are."""
    depth, normal = beside_a_ball()
    own = normal if up == "y" else np.stack([normal[..., 0], -normal[..., 2], normal[..., 1]], -1)
    if space == "opengl":
        own = normal @ foreign_exr.CAMERA.world_from_view[0, :3, :3].double().numpy() * (1, -1, -1)
    layers = {"depth.Z": depth, "normal.XYZ": own[..., order] * signs, "RGB": np.full((*depth.shape, 3), 0.5)}
    profile = tmp_path / "own.toml"
    profile.write_text(AXES.format(up, space))
    path = foreign_exr.write(tmp_path / "a.exr", layers)
    frame = read_gbuffer(path, profile, camera=foreign_exr.CAMERA)
    lines = disagreements(frame, profile=load_profile(profile))
    assert [line[: len(told or "")] for line in lines] == ([told] if told else [])
