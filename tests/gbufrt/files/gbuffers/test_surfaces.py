"""What shows a surface and what the sky, where a profile does not know what the sky holds, or a scene is large."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from writers.foreign_exr import CAMERA, SIZE, truth, write

from gbufrt.files import read_gbuffer

T = truth()
SKY = ~T["hit"]
NORMAL = {"normal.XYZ": T["normal"]}
FACING = {"normal.XYZ": np.where(SKY[..., None], [0.0, -1.0, 0.0], T["normal"])}  # of a backdrop in the sky's place
REST = np.random.default_rng(0).choice((-1.0, 1.0), SIZE) * 1e-8


def _hit(path: Path, depth: np.ndarray, profile: str = "auto", name: str = "depth.Z") -> np.ndarray:
    g = read_gbuffer(write(path / "a.exr", {name: depth, **NORMAL}), profile, camera=CAMERA).gbuffer
    return g.hit[0, 0].numpy()


@pytest.mark.parametrize("sky", [1e6, 1e8, 1e10, 9e11])
def test_what_lies_far_beyond_all_else_at_one_depth_is_sky(sky: float, tmp_path: Path) -> None:
    (tmp_path / "own.toml").write_text('[channels]\ndepth = ["depth.Z"]\nnormal = ["normal"]')
    assert (_hit(tmp_path, np.where(SKY, sky, T["planar"]), str(tmp_path / "own.toml")) == T["hit"]).all()


def test_the_far_plane_without_normals_is_sky(tmp_path: Path) -> None:
    """As of Blender's EEVEE, which has the camera's clip end there, be it near; a far wall has normals."""
    normal = np.where(SKY[..., None], 0.0, T["normal"])
    layers = {"V.Depth.Z": np.where(SKY, 4 * T["planar"][~SKY].max(), T["planar"]), "V.Normal.XYZ": normal}
    marked = {"BlenderMultiChannel": "Blender V2.55.1 and newer"}
    frame = read_gbuffer(write(tmp_path / "a.exr", layers, marked), camera=CAMERA)
    assert torch.equal(frame.gbuffer.hit[0, 0], torch.from_numpy(~SKY))
    wall = layers | {"V.Normal.XYZ": FACING["normal.XYZ"]}
    assert bool(read_gbuffer(write(tmp_path / "b.exr", wall, marked), camera=CAMERA).gbuffer.hit.all())


def test_a_backdrop_of_one_depth_is_a_surface(tmp_path: Path) -> None:
    (tmp_path / "own.toml").write_text('[channels]\ndepth = ["depth.Z"]\nnormal = ["normal"]')
    path = write(tmp_path / "a.exr", {"depth.Z": np.where(SKY, 900.0, T["planar"]), **FACING})
    assert read_gbuffer(path, str(tmp_path / "own.toml"), camera=CAMERA).gbuffer.hit.all()


@pytest.mark.parametrize("sky", [0.0, np.inf, 1e11])
@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e4, 1e6])
def test_units_may_be_small(unit: float, sky: float, tmp_path: Path) -> None:
    """A scene in millimetres reaches beyond the largest half, which as depth is the sky in files of halves."""
    depth = np.where(SKY, sky, unit * T["planar"])
    g = read_gbuffer(write(tmp_path / "a.exr", {"depth.Z": depth, **NORMAL}), camera=CAMERA).gbuffer
    assert (g.hit[0, 0].numpy() == T["hit"]).all()
    assert np.allclose(g.depth[0, 0].numpy()[T["hit"]], unit * T["planar"][T["hit"]], rtol=1e-5)


def test_edges_that_mix_surfaces_with_the_sky_are_sky(tmp_path: Path) -> None:
    """Of filtered depth, some per cent of the pixels hold any share of the sky's 1e10."""
    depth, rng = np.where(SKY, 1e10, T["planar"]), np.random.default_rng(0)
    mixed = (rng.random(SIZE) < 0.05) & T["hit"]
    depth[mixed] = 10 ** rng.uniform(5, 10, mixed.sum())
    assert (_hit(tmp_path, depth) == (T["hit"] & ~mixed)).all()


def test_what_lossy_compression_leaves_of_an_empty_sky_is_no_surface(tmp_path: Path) -> None:
    assert (_hit(tmp_path, np.where(SKY, REST, T["planar"])) == T["hit"]).all()


def test_normals_in_0_1_may_fall_below_it(tmp_path: Path) -> None:
    """As lossy compression leaves them."""
    layers = {"depth.Z": np.where(SKY, 0, T["planar"]), "normal.XYZ": T["normal"] / 2 + 0.5 + 3000 * REST[..., None]}
    normal = read_gbuffer(write(tmp_path / "a.exr", layers), camera=CAMERA).gbuffer.normal[0].permute(1, 2, 0).numpy()
    assert np.abs(normal - T["normal"])[T["hit"]].max() < 1e-3


def test_silhouettes_averaged_with_a_sky_of_0_lie_where_their_surface_does(tmp_path: Path) -> None:
    """As Mitsuba's filters make them, of a wall that fills three quarters and a tenth of two columns of pixels."""
    share = np.where(np.arange(SIZE[1]) < 20, 1.0, 0.0)
    share[20], share[21] = 0.75, 0.1
    ahead = CAMERA.rotate_to_world(torch.tensor([0.0, 0.0, -1.0]).view(1, 3, 1, 1).expand(1, 3, *SIZE))
    normal = ahead[0].permute(1, 2, 0).numpy() * share[:, None]
    layers = {"dd.T": np.broadcast_to(8 * share, SIZE), "nn.XYZ": normal}
    (tmp_path / "own.toml").write_text('base = "mitsuba"\nup = "y"\ndepth_kind = "planar"')
    g = read_gbuffer(write(tmp_path / "a.exr", layers), tmp_path / "own.toml", camera=CAMERA).gbuffer
    assert (g.hit[0, 0].numpy() == (share >= 0.5)).all()
    torch.testing.assert_close(g.depth[g.hit], torch.full_like(g.depth[g.hit], 8.0))


def test_what_fills_its_pixel_before_a_sky_of_0_stays_near(tmp_path: Path) -> None:
    """A leaf, one pixel wide, before the far wall and the sky."""
    depth = np.where(np.arange(SIZE[1]) < 20, 8.0, 0.0) + np.zeros(SIZE)
    depth[:, 19] = 2.0
    normal = np.broadcast_to(np.array([0.0, 0.0, 1.0]), (*SIZE, 3))
    (tmp_path / "own.toml").write_text('base = "mitsuba"\nup = "y"\ndepth_kind = "planar"')
    g = read_gbuffer(
        write(tmp_path / "a.exr", {"dd.T": depth, "nn.XYZ": normal}), tmp_path / "own.toml", camera=CAMERA
    ).gbuffer
    assert (g.depth[..., 19] == 2).all()


def test_normals_averaged_over_an_edge_are_those_of_the_surface_that_depth_is_of(tmp_path: Path) -> None:
    """Beside the edge between floor and wall, and along their silhouettes, where the sky leaves half of a normal."""
    normal = T["normal"].astype(np.float32)
    around = [np.roll(normal, shift, axis=axis) for axis in (0, 1) for shift in (-1, 1)]
    other = np.stack([(normal != side).any(-1) for side in around]).any(0) & T["hit"]
    assert other.sum() > 50
    normal[other] = np.mean([normal, *around], axis=0)[other]
    short = np.linalg.norm(normal, axis=-1) < 0.9
    file = write(tmp_path / "a.exr", {"depth.Z": np.where(SKY, 0, T["planar"]), "normal.XYZ": normal})
    found = read_gbuffer(file, camera=CAMERA).gbuffer.normal[0].permute(1, 2, 0).numpy()
    cosine = (found * T["normal"]).sum(-1)[other & short]
    assert cosine.size > 200
    assert (cosine > 0.999).mean() > 0.98  # not where three surfaces meet


def _motion(path: Path, motion: np.ndarray, depth: np.ndarray) -> torch.Tensor:
    layers = {"V.Depth.Z": depth, "V.Vector.XYZW": np.concatenate([motion, motion], -1)}
    marked = {"BlenderMultiChannel": "Blender V2.55.1 and newer"}
    found = read_gbuffer(write(path / "a.exr", layers, marked), fov=40).gbuffer.motion
    assert found is not None
    return found[0].permute(1, 2, 0) * torch.tensor([1.0, -1.0])


def test_motion_averaged_over_an_edge_is_that_of_the_surface_that_depth_is_of(tmp_path: Path) -> None:
    """Something that spins and flies before a still wall: as Blender's Vector holds it, all round its silhouette."""
    y, x = np.mgrid[: SIZE[0], : SIZE[1]] - np.array(SIZE).reshape(2, 1, 1) / 2
    own, flies = np.hypot(y, x) < 8, np.stack([20 - 0.3 * y, 5 + 0.3 * x], -1)
    sharp, depth = np.where(own[..., None], flies, 0.0), np.where(own, 4.0, 9.0)
    steps = np.linspace(-0.4, 0.4, 5)
    inside = [np.hypot(y + down, x + right) < 8 for down in steps for right in steps]
    share = np.mean(inside, axis=0)[..., None]
    mixed = ((share > 0) & (share < 1))[..., 0]
    assert mixed.sum() > 40
    assert np.abs(share * flies - sharp)[mixed].max() > 8
    found = _motion(tmp_path, share * flies, depth).numpy()
    assert np.abs(found - sharp)[~mixed].max() < 1e-3, "others stay"
    near = (np.abs(found - sharp).max(-1) < 0.25 * 21 + 1.0)[mixed]
    assert near.mean() > 0.75, "0.58 as the file has it; some have no two neighbours in a line"


def test_motion_that_no_two_neighbours_tell_stays(tmp_path: Path) -> None:
    """A wire a pixel wide, and motion that nobody has averaged."""
    motion, depth = np.zeros((*SIZE, 2)), np.full(SIZE, 9.0)
    motion[:, 12], depth[:, 12] = 7.0, 4.0
    motion[10:18, 20:30], depth[10:18, 20:30] = -5.0, 5.0
    assert np.abs(_motion(tmp_path, motion, depth).numpy() - motion).max() < 1e-5
