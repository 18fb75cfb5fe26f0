"""Cameras from TOML."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch

from gbufrt.camera import Camera
from gbufrt.files.gbuffers.cameras import load_cameras

BLENDER = """convention = "opengl"
up = "z"
focal_length = 50
location = [0, -10, 3]
rotation = [80, 0, 0]
"""


def _write(folder: Path, text: str) -> Path:
    path = folder / "camera.toml"
    path.write_text(text)
    return path


def test_a_camera_of_blender_is_that_of_look_at(tmp_path: Path) -> None:
    camera = load_cameras(_write(tmp_path, BLENDER)).at(5, (90, 160))
    drop = 10 * torch.tan(torch.deg2rad(torch.tensor(10.0))).item()
    fov = 2 * torch.rad2deg(torch.atan(torch.tensor(18 / 50 * 9 / 16))).item()
    true = Camera.look_at((0, 3, 10), (0, 3 - drop, 0), size=(90, 160), fov_y=fov)
    assert torch.allclose(camera.world_from_view, true.world_from_view, atol=1e-5)
    assert torch.allclose(camera.intrinsics, true.intrinsics, rtol=1e-5)


def test_lenses_that_are_shifted_parallel_or_of_wide_pixels(tmp_path: Path) -> None:
    rest, size = BLENDER.replace("focal_length = 50\n", ""), (90, 160)
    k = [[200.0, 0.0, 100.0], [0.0, 210.0, 30.0], [0.0, 0.0, 1.0]]
    shifted = load_cameras(_write(tmp_path, f"intrinsics = {k}\n{rest}")).at(1, size)
    assert shifted.intrinsics.tolist() == [k]
    assert not shifted.orthographic
    parallel = load_cameras(_write(tmp_path, f"orthographic_height = 4.5\n{rest}")).at(1, size)
    look = Camera.look_at((0, 3, 10), (0, 0, 0), size=size, orthographic_height=4.5)
    assert parallel.orthographic
    assert torch.equal(parallel.intrinsics, look.intrinsics)
    both = load_cameras(_write(tmp_path, f"intrinsics = {k}\northographic = true\n{rest}")).at(1, size)
    assert both.orthographic
    assert both.intrinsics.tolist() == [k]
    cameras = load_cameras(_write(tmp_path, BLENDER))
    wide, square = (cameras.at(1, size, aspect).intrinsics[0] for aspect in (2.0, 1.0))
    assert torch.allclose(wide[0, 0], square[0, 0])  # the sensor's width holds as many pixels, of half the height
    assert torch.allclose(wide[1, 1], 2 * square[1, 1])


def test_frames_take_what_they_lack_from_the_top(tmp_path: Path) -> None:
    frames = "".join(
        f"[[frames]]\nnumber = {n}\nworld_from_view = [[1,0,0,{n}],[0,1,0,0],[0,0,1,0],[0,0,0,1]]\n" for n in (3, 5)
    )
    cameras = load_cameras(_write(tmp_path, "fov = 40\nfar = 50\n" + frames))
    assert cameras.at(5, (4, 6)).position.tolist() == [[5, 0, 0]]
    assert cameras.at(3, (4, 6)).far == 50
    with pytest.raises(ValueError, match="no frame 4; it has 3 to 5"):
        cameras.at(4, (4, 6))


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (BLENDER.replace("50", '"a"'), "focal_length must be a positive number"),
        (BLENDER.replace("[80, 0, 0]", "80"), "rotation must be three numbers, got 80"),
        ("fov = 40\nlocation = [0, 0, 0]", "rotation must be three numbers, and is missing; or write world_from_view"),
        (BLENDER + "fov = 40", "either fov or focal_length"),
        (BLENDER + "zoom = 4", "unknown key 'zoom'"),
        (BLENDER.replace('"z"', '"x"'), "up must be 'y' or 'z'"),
        ("fov = 400\nlocation = [0, 0, 0]\nrotation = [0, 0, 0]", "fov must lie between"),
        ("fov = 40\nworld_from_view = [[1, 0]]", "world_from_view must be four rows"),
        ("fov = 40", "either world_from_view or location"),
        ("frames = 3", "frames must be a list"),
        ("[[frames]]\nfov = 3", "number must be a whole number"),
        (BLENDER + "orthographic = 1", "orthographic must be true or false"),
        (BLENDER + "orthographic = true", "write orthographic_height alone"),
        (BLENDER.replace("focal_length = 50", "intrinsics = [[1, 0], [0, 1]]"), "intrinsics must be three rows"),
    ],
)
def test_errors_name_the_key(text: str, told: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=told):
        load_cameras(_write(tmp_path, text))
