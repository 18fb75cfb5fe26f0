"""Depth from positions, whatever space and axes they have; and depth that counts down."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from writers.foreign_exr import BEFORE, CAMERA, SIZE, truth, write, write_parts

from gbufrt.camera import Camera
from gbufrt.files import read_gbuffer
from gbufrt.files.gbuffers.agreement import disagreements
from gbufrt.files.gbuffers.detect import detect

T = truth()
SKY, HIT = ~T["hit"], T["hit"][..., None]
GREY = np.full((*SIZE, 3), 0.5)
VIEW = CAMERA.view_from_world[0].double().numpy()
RAYS = [t[0].double().numpy() for t in CAMERA.rays()]
WORLD = np.where(HIT, RAYS[0] + np.where(HIT, T["ray"][..., None], 1) * RAYS[1], 0)
SEEN = np.where(HIT, WORLD @ VIEW[:3, :3].T + VIEW[:3, 3], 0)
NORMAL, TURNED = T["normal"], T["normal"] @ VIEW[:3, :3].T
SPACES = {
    "y up": (WORLD, NORMAL),
    "z up": (WORLD[..., [0, 2, 1]] * (1, -1, 1), NORMAL[..., [0, 2, 1]] * (1, -1, 1)),
    "opengl": (SEEN * (1, -1, -1), TURNED * (1, -1, -1)),
    "pbrt": (SEEN * (1, -1, 1), TURNED * (1, -1, 1)),
}


def layers(space: str) -> dict[str, np.ndarray]:
    """As pbrt calls them."""
    position, normal = SPACES[space]
    return {"P.XYZ": position, "N.XYZ": normal, "Albedo.RGB": GREY, "RGB": GREY}


@pytest.mark.parametrize("space", SPACES)
def test_positions_tell_depth(space: str, tmp_path: Path) -> None:
    path = write(tmp_path / "a.exr", layers(space))
    found = detect(path)
    assert found.name == "generic"
    assert found.reasons[0] == "depth follows from P.X, P.Y, P.Z"
    frame = read_gbuffer(path, camera=CAMERA, previous_camera=BEFORE)
    frame.validate()
    g = frame.gbuffer
    assert bool((g.hit[0, 0].numpy() == T["hit"]).all())
    assert np.abs(g.depth[0, 0].numpy() - T["planar"])[T["hit"]].max() < 1e-4
    assert np.abs(g.normal[0].permute(1, 2, 0).numpy() - NORMAL).max() < 1e-4
    assert disagreements(frame) == []


@pytest.mark.parametrize("space", ["pbrt", "y up"])
def test_old_pbrt_writes_vectors_without_dots(space: str, tmp_path: Path) -> None:
    """``Pz`` alone is Houdini's depth; beside Px and Py it is a part of positions, which may lie in the world."""
    position, normal = SPACES[space]
    bare = {f"{n}{a}": v[..., i] for n, v in (("P", position), ("N", normal)) for i, a in enumerate("xyz")}
    bare |= {f"Ns{a}": normal[..., i] for i, a in enumerate("xyz")} | {"dzdx": SKY * 1.0, "dzdy": SKY * 1.0}
    colours = {f"{layer}{c}": GREY[..., 0] for layer in ("", "Albedo.") for c in "RGB"}
    path = write_parts(tmp_path / "a.exr", {"": bare | colours})
    assert detect(path).reasons[:2] == ("depth follows from P.x, P.y, P.z", "normal is N.x, N.y, N.z")
    g = read_gbuffer(path, camera=CAMERA).gbuffer
    assert np.abs(g.depth[0, 0].numpy() - T["planar"])[T["hit"]].max() < 1e-4
    assert np.abs(g.normal[0].permute(1, 2, 0).numpy() - NORMAL).max() < 1e-4


def test_a_profile_of_ones_own_names_positions_axes_and_scale(tmp_path: Path) -> None:
    mirrored = WORLD * (100, 100, -100)
    path = write(tmp_path / "a.exr", {"where.XYZ": mirrored, "RGB": GREY})
    own = tmp_path / "own.toml"
    own.write_text('handed = "left"\ndepth_scale = 0.01\nfinished = [""]\n[channels]\nposition = ["where"]\n')
    g = read_gbuffer(path, own, camera=CAMERA).gbuffer
    assert np.abs(g.depth[0, 0].numpy() - T["planar"])[T["hit"]].max() < 1e-4
    own.write_text(own.read_text().replace("left", "right"))
    with pytest.raises(ValueError, match=r"positions do not lie on the pixels .* check --camera, and up, handed"):
        read_gbuffer(path, own, camera=CAMERA)


def test_without_a_pose_positions_of_the_camera_alone_tell_depth(tmp_path: Path) -> None:
    g = read_gbuffer(write(tmp_path / "a.exr", layers("pbrt")), fov=50).gbuffer
    assert np.abs(g.depth[0, 0].numpy() - T["planar"])[T["hit"]].max() < 1e-4
    with pytest.raises(ValueError, match="those of the world need --camera"):
        read_gbuffer(write(tmp_path / "b.exr", layers("y up")), fov=50)


def test_positions_of_another_camera_are_refused(tmp_path: Path) -> None:
    other = Camera.look_at((5, 2, 4), (0, 1.2, 0), size=SIZE, fov_y=50)
    with pytest.raises(ValueError, match="positions do not lie on the pixels that show them; check --camera"):
        read_gbuffer(write(tmp_path / "a.exr", layers("z up")), camera=other)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("sky", [0, 1e30, -1e30])
def test_depth_of_karma_counts_down_or_up(sign: int, sky: float, tmp_path: Path) -> None:
    path = write(
        tmp_path / "a.exr", {"hitPz.Z": np.where(SKY, sky, sign * T["planar"]), "hitN.XYZ": NORMAL, "C.RGB": GREY}
    )
    assert detect(path).name == "houdini"
    g = read_gbuffer(path, camera=CAMERA).gbuffer
    assert bool((g.hit[0, 0].numpy() == T["hit"]).all())
    assert np.abs(g.depth[0, 0].numpy() - T["planar"])[T["hit"]].max() < 1e-4
