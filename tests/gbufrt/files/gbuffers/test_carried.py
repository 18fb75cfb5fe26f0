"""Cameras that files carry: OpenEXR's matrices in the forms that renderers write, and Unreal's text."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import boxes
import numpy as np
import pytest
import torch
from writers.foreign_exr import CAMERA, SIZE, truth, write

from gbufrt.camera import Camera
from gbufrt.commands.foreign import Source
from gbufrt.files import read_gbuffer
from gbufrt.files.exr import write_exr
from gbufrt.files.gbuffers.agreement import disagreements
from gbufrt.files.gbuffers.carried import carried_camera
from gbufrt.files.gbuffers.profile import Profile, load_profile
from gbufrt.files.guard import read_parts

VIEW = CAMERA.world_from_view[0].double().numpy()
FOCAL = SIZE[0] / 2 / math.tan(math.radians(25))
Y_UP = Profile(channels={"depth": ("Z",)})


def matrices(forward: int, *, signed: bool = False, shift: float = 0.0) -> dict[str, np.ndarray]:
    """worldToCamera and worldToNDC as a file has them; ``forward`` is 1 or -1, the sign of z before the camera."""
    camera = np.diag([1.0, -1.0, forward, 1.0]) @ np.linalg.inv(VIEW)
    across, down = (FOCAL / n * (2 if signed else 1) for n in SIZE[::-1])
    middle = 0.0 if signed else 0.5
    rows = [[across, 0, forward * (middle + shift), 0], [0, down if signed else -down, forward * middle, 0]]
    project = np.array([*rows, [0, 0, forward, 0.1], [0, 0, forward, 0]])
    found = {"worldToCamera": camera.T, "worldToNDC": (project @ camera).T}
    return {name: np.ascontiguousarray(matrix, np.float32) for name, matrix in found.items()}


def close(found: Camera | None, wanted: Camera = CAMERA) -> bool:
    assert found is not None
    pairs = ((found.intrinsics, wanted.intrinsics), (found.world_from_view, wanted.world_from_view))
    return all(torch.allclose(a, b, atol=1e-3) for a, b in pairs)


@pytest.mark.parametrize("forward", [1, -1])
@pytest.mark.parametrize("signed", [False, True])
def test_both_directions_of_view_and_both_ranges_are_read(forward: int, signed: bool) -> None:
    assert close(carried_camera(matrices(forward, signed=signed), Y_UP, SIZE))


@pytest.mark.parametrize("target", [(0.0, 1.2, 0.0), (5.0, 3.0, -2.0), (0.3, 1.5, 3.0)])
def test_the_axis_that_is_up_is_the_one_that_the_camera_holds_upright(target: tuple[float, float, float]) -> None:
    """Where the profile leaves it open: in the file's own world nothing else would tell."""
    camera = Camera.look_at((0.3, 2, 4), target, size=SIZE, fov_y=50)
    from_y_up = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1.0]])
    ours, auto = camera.world_from_view[0].double().numpy(), replace(Y_UP, up="auto")
    for pose in (ours, from_y_up @ ours):
        header = {n: (VIEW @ np.linalg.inv(pose)).T @ m for n, m in matrices(1).items()}
        assert close(carried_camera(header, auto, SIZE), camera)


@pytest.mark.parametrize("orthographic", [False, True])
def test_what_is_written_carries_its_camera_for_others(orthographic: bool, tmp_path: Path) -> None:
    camera = boxes.camera(SIZE)
    shifted = camera.intrinsics + torch.tensor([[0.0, 0, 7], [0, 0, -3], [0, 0, 0]])
    camera = replace(camera, intrinsics=shifted, orthographic=orthographic, jitter=torch.tensor([[0.3, 0.2]]))
    write_exr(tmp_path / "a.exr", boxes.frame(camera))
    header = read_parts(tmp_path / "a.exr", header_only=True)[0].header
    if not orthographic:
        assert close(carried_camera(header, Y_UP, SIZE), camera)
    seen, place = camera.unproject(torch.full((1, 1, *SIZE), 3.0)), torch.tensor([0.3, 0.2])
    world = camera.to_world(seen)[0, :, 5, 9].double()
    across, down, _, share = torch.cat([world, torch.ones(1)]).numpy() @ header["worldToNDC"]
    assert [across / share * SIZE[1], down / share * SIZE[0]] == pytest.approx(
        (torch.tensor([9.5, 5.5]) + place).tolist()
    )
    assert (torch.cat([world, torch.ones(1)]).numpy() @ header["worldToCamera"])[2] == pytest.approx(-3, abs=1e-5)


def test_a_shifted_lens_is_kept() -> None:
    found = carried_camera(matrices(-1, shift=0.1), Y_UP, SIZE)
    assert found is not None
    assert float(found.intrinsics[0, 0, 2]) == pytest.approx(0.6 * SIZE[1], abs=1e-3)


def test_a_file_with_its_camera_needs_no_other(tmp_path: Path) -> None:
    found = truth()
    layers = {"Z": np.where(found["hit"], found["planar"], 1e30), "N.XYZ": found["normal"]}
    path = write(tmp_path / "a.exr", layers, matrices(1))  # pyright: ignore[reportArgumentType]
    frame = read_gbuffer(path)
    assert close(frame.gbuffer.camera)
    assert disagreements(frame) == []
    with pytest.raises(ValueError, match="carries no camera; give one, or a field of view"):
        read_gbuffer(write(tmp_path / "b.exr", layers))


def test_the_frame_before_gives_the_camera_before(tmp_path: Path) -> None:
    found = truth()
    layers = {"Z": np.where(found["hit"], found["planar"], 1e30), "RGB": np.full((*SIZE, 3), 0.5)}
    for number, shift in ((1, 0.0), (2, 0.1), (4, 0.1)):
        header = matrices(1, shift=shift)
        write(tmp_path / f"a.{number}.exr", layers, header)  # pyright: ignore[reportArgumentType]
    source = Source.of([tmp_path / f"a.{n}.exr" for n in (1, 2, 4)], "auto", None, None)
    first, second, third = (frame.gbuffer for frame in source.frames())
    assert first.previous_camera is None
    assert third.previous_camera is None
    assert second.previous_camera is not None
    assert torch.equal(second.previous_camera.intrinsics, first.camera.intrinsics)
    assert not torch.equal(second.camera.intrinsics, first.camera.intrinsics)
    assert second.motion is not None
    assert float(second.motion[second.hit.expand_as(second.motion)].abs().max()) > 1


def unreal() -> dict[str, float]:
    """The camera as Unreal's text tells it."""
    x, y, z = VIEW[:3, 3]
    dx, dy, dz = VIEW[:3, 2]
    fov = 2 * math.degrees(math.atan(math.tan(math.radians(25)) * SIZE[1] / SIZE[0]))
    told = {f"curPos/{axis}": 100 * v for axis, v in zip("xyz", (x, z, y), strict=True)}
    told |= {"curRot/pitch": math.degrees(math.asin(dy)), "curRot/yaw": math.degrees(math.atan2(dz, dx))}
    return told | {"curRot/roll": 0.0, "fov": fov}


def test_the_text_of_unreal_is_read_in_metres() -> None:
    told = {("FinalImage/fov" if name == "fov" else name): value for name, value in unreal().items()}
    header = {f"unreal/camera/{name}": str(value) for name, value in told.items()}
    assert close(carried_camera(header, load_profile("unreal"), SIZE))
    header["unreal/camera/curRot/roll"] = "90"  # to the right: what was right of the picture is now at its foot
    turned = carried_camera(header, load_profile("unreal"), SIZE)
    assert turned is not None
    assert torch.allclose(turned.world_from_view[0, :3, 1], -CAMERA.world_from_view[0, :3, 0], atol=1e-5)


@pytest.mark.parametrize("place", ["Cam_B/FinalImage", "layerData/FinalImage.Cam_B", "ShotCam/FinalImage"])
def test_cameras_of_unreal_have_names_where_there_are_several(place: str) -> None:
    """The pose of the player's camera is written too, but no field of view for it."""
    header = {f"unreal/camera/{name}": "7.5" for name in unreal() if name != "fov"}
    header |= {f"unreal/{place}/{name}": str(value) for name, value in unreal().items()}
    header |= {"unreal/camera/shutterAngle": "180.0", f"unreal/{place}/prevPos/x": "1.0"}
    assert close(carried_camera(header, load_profile("unreal"), SIZE))
    header |= {f"unreal/{place}2/{name}": str(value) for name, value in unreal().items()}
    assert close(carried_camera(header, load_profile("unreal"), SIZE))
    header[f"unreal/{place}2/fov"] = "33.0"
    with pytest.warns(UserWarning, match=rf"carries the cameras {place}, {place}2; took {place}, --camera"):
        assert close(carried_camera(header, load_profile("unreal"), SIZE))


@pytest.mark.parametrize(
    "header",
    [
        {},
        {"worldToCamera": np.eye(4)},
        {"worldToCamera": np.zeros((4, 4)), "worldToNDC": np.eye(4)},
        {"worldToCamera": "text", "worldToNDC": np.eye(4)},
        {"worldToCamera": 3 * np.eye(4), "worldToNDC": matrices(1)["worldToNDC"]},
        {"worldToCamera": np.full((4, 4), np.nan), "worldToNDC": np.full((4, 4), np.inf)},
        {"unreal/camera/curPos/x": "1"},
    ],
)
@pytest.mark.filterwarnings("ignore:invalid value")
def test_what_cannot_be_a_camera_is_none(header: dict[str, Any]) -> None:
    assert carried_camera(header, Y_UP, SIZE) is None
