"""Crops, overscan, stereo, and files of one pass each become whole frames."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from writers.foreign_exr import CAMERA, SIZE, truth, write, write_parts

from gbufrt.camera import Camera
from gbufrt.files import read_gbuffer
from gbufrt.files.gbuffers.detect import detect
from gbufrt.files.gbuffers.layers import Layers
from gbufrt.files.gbuffers.sequence import expanded, shot_parts, shots_of
from gbufrt.files.guard import read_parts

T = truth()
LAYERS = {
    "Depth.Z": np.where(T["hit"], T["planar"], 1e10),
    "Combined.RGB": np.moveaxis(np.indices((*SIZE, 3))[0], 0, 0),
}


def window(x0: int, y0: int, x1: int, y1: int) -> tuple[np.ndarray, np.ndarray]:
    """Corners of a window, both inside."""
    return np.array([x0, y0], np.int32), np.array([x1, y1], np.int32)


@pytest.mark.filterwarnings("ignore:.* has no surface")
@pytest.mark.parametrize("display", [(4, 6, 59, 41), (-4, -2, 70, 49), (10, -3, 90, 20), (200, 200, 210, 205)])
def test_a_data_window_is_placed_in_the_display_window(display: tuple[int, int, int, int], tmp_path: Path) -> None:
    path = write(tmp_path / "a.exr", LAYERS, {"displayWindow": window(*display)})  # pyright: ignore[reportArgumentType]
    x0, y0, x1, y1 = display
    camera = Camera.look_at((0, 0, 5), (0, 0, 0), size=(y1 - y0 + 1, x1 - x0 + 1), fov_y=50)
    g = read_gbuffer(path, camera=camera).gbuffer
    for (y, x), hit in np.ndenumerate(g.hit[0, 0].numpy()):
        inside = 0 <= y + y0 < SIZE[0] and 0 <= x + x0 < SIZE[1] and bool(T["hit"][y + y0, x + x0])
        assert hit == inside
        if inside:
            assert float(g.depth[0, 0, y, x]) == np.float32(T["planar"][y + y0, x + x0])


def test_of_two_views_the_first_is_taken_and_told(tmp_path: Path) -> None:
    planes = {f"V.Depth.{view}.Z": np.full(SIZE, depth) for view, depth in (("right", 3.0), ("left", 2.0))}
    header = {"multiView": ["left", "right"]}
    path = write(tmp_path / "a.exr", planes, header)  # pyright: ignore[reportArgumentType]
    with pytest.warns(UserWarning, match="holds the views left, right; took left"):
        frame = read_gbuffer(path, fov=40)
    assert float(frame.gbuffer.depth.max()) == 2


def test_stereo_parts_and_layers_of_nuke_are_read(tmp_path: Path) -> None:
    """Named as in the OpenEXR project's sample frames of a ball: views end the names of parts, or precede letters."""
    views, uv = ("right", "left"), dict(zip(("u", "v"), (-T["motion"][..., 0], T["motion"][..., 1]), strict=True))
    depth = np.where(T["hit"], T["planar"], 0)
    light = dict.fromkeys("RGB", np.full(SIZE, 0.5))
    parts = {
        f"{layer}_{view}": {name: pixels * (1 + views.index(view)) for name, pixels in channels.items()}
        for view in views
        for layer, channels in (
            ("rgba", light),
            ("depth", {"Z": depth}),
            ("forward", {f"forward.{letter}": pixels for letter, pixels in uv.items()}),
        )
    }
    single = {"Z": depth, "left.Z": 2 * depth, **light, **{f"left.{c}": 2 * pixels for c, pixels in light.items()}}
    single |= {f"forward.{view}.{c}": pixels for view in views for c, pixels in uv.items()}
    planes = {name if "." in name else f".{name}": pixels for name, pixels in single.items()}
    header = {"multiView": [*views]}
    for path in (
        write_parts(tmp_path / "parts.exr", parts, views),
        write(tmp_path / "single.exr", planes, header),  # pyright: ignore[reportArgumentType]
    ):
        assert detect(path).name == "nuke"
        with pytest.warns(UserWarning, match="holds the views right, left; took right"):
            frame = read_gbuffer(path, camera=CAMERA)
        g = frame.gbuffer
        assert g.motion is not None
        assert frame.composite is not None
        assert np.array_equal(g.hit[0, 0].numpy(), T["hit"])
        assert np.allclose(g.depth[0, 0].numpy()[T["hit"]], T["planar"][T["hit"]], rtol=1e-6)
        assert np.allclose(g.motion[0].numpy().transpose(1, 2, 0)[T["hit"]], T["motion"][T["hit"]], atol=1e-5)
        assert float(frame.composite.max()) == 0.5


NORMAL = dict(zip("XYZ", np.moveaxis(T["normal"], -1, 0), strict=True))


@pytest.mark.parametrize(
    "parts",
    [
        {"rgba.main": dict.fromkeys("RGB", 0.5), "depth.main": {"Z": T["planar"]}, "N.main": NORMAL},
        {"rgba": dict.fromkeys("RGB", 0.5) | {"Z": T["planar"]}, "N": {f"N.{c}": v for c, v in NORMAL.items()}},
    ],
    ids=["nuke 13, one view", "gaffer"],
)
def test_parts_of_a_layer_each_are_read(parts: dict[str, Any], tmp_path: Path) -> None:
    """Named as in files of Nuke 13.1, whose only view ends the names of parts, and of Gaffer 0.62."""
    planes = {
        part: {name: np.where(T["hit"], value, 0) for name, value in layer.items()} for part, layer in parts.items()
    }
    path = write_parts(tmp_path / "parts.exr", planes, ("main",))
    assert (detect(path).name, detect(path).certainty > 0.3) == ("nuke", True)
    frame = read_gbuffer(path, camera=CAMERA)
    assert frame.composite is not None
    assert np.allclose(frame.gbuffer.depth[0, 0].numpy()[T["hit"]], T["planar"][T["hit"]], rtol=1e-6)


def test_files_of_one_pass_each_make_one_frame(tmp_path: Path) -> None:
    """As Falcor's capture names them."""
    sky = ~T["hit"]
    passes = {
        "GBufferRaster.linearZ": {"R": np.where(sky, 0, T["planar"])},
        "GBufferRaster.normW": dict(zip("RGB", np.moveaxis(T["normal"], -1, 0), strict=True)),
        "PathTracer.color": dict.fromkeys("RGB", np.full(SIZE, 0.5)),
    }
    files = [
        write(tmp_path / f"Mogwai.{name}.{number}.exr", {f".{c}": plane for c, plane in planes.items()})
        for name, planes in passes.items()
        for number in (7, 8)
    ]
    shots = shots_of(files)
    assert [(shot.number, shot.name, len(shot.files)) for shot in shots] == [(7, "Mogwai_7", 3), (8, "Mogwai_8", 3)]
    frame = read_gbuffer(shots[1].files, camera=CAMERA)
    assert np.allclose(frame.gbuffer.normal[0].numpy().transpose(1, 2, 0), T["normal"], atol=1e-6)
    assert frame.composite is not None
    assert float(frame.composite.min()) == 0.5
    with pytest.raises(ValueError, match="both of the pass 'linearZ'; run them apart"):
        read_gbuffer(files[:2], camera=CAMERA)


def test_patterns_stand_for_the_files_there_by_number(tmp_path: Path) -> None:
    for number in (10, 9, 2):
        (tmp_path / f"shot.{number:02}.exr").touch()
    (tmp_path / "shot.x.exr").touch()
    wanted = [tmp_path / f"shot.{number:02}.exr" for number in (2, 9, 10)]
    for pattern in ("shot.##.exr", "shot.%02d.exr", "shot.####.exr"):
        assert expanded(tmp_path / pattern) == wanted
    assert expanded(tmp_path / "other.exr") == [tmp_path / "other.exr"]
    with pytest.raises(ValueError, match=r"no file fits .*other\.#\.exr"):
        expanded(tmp_path / "other.#.exr")
    (tmp_path / "a%d_0007.exr").touch()  # a program that was given a pattern it does not know
    assert expanded(tmp_path / "a%d_####.exr") == [tmp_path / "a%d_0007.exr"]
    (tmp_path / "a1_0008.exr").touch()
    assert expanded(tmp_path / "a%d_####.exr") == [tmp_path / "a1_0008.exr"]


def test_numbers_below_zero_have_a_sign_and_separators_none(tmp_path: Path) -> None:
    names = ("a_-002.exr", "a_-001.exr", "a_0000.exr")
    for name in reversed(names):
        (tmp_path / name).touch()
    assert [path.name for path in expanded(tmp_path / "a_####.exr")] == [*names]
    assert [shot.number for shot in shots_of([tmp_path / name for name in names])] == [-2, -1, 0]
    assert [shot.number for shot in shots_of([tmp_path / "a-001.exr", tmp_path / "a-002.exr"])] == [1, 2]


def test_layers_of_a_frame_may_lie_in_several_files(tmp_path: Path) -> None:
    """As Blender 5.0 writes them: parts whose channels carry their names, here light and surface apart."""
    depth, light = LAYERS["Depth.Z"], np.full(SIZE, 0.5)
    data = {"V.Depth": {"V.Depth.Z": depth}, "V.Normal": {f"V.Normal.{c}": light for c in "XYZ"}}
    files = [
        write_parts(tmp_path / "shot_data_0001.exr", data),
        write_parts(tmp_path / "shot_beauty_0001.exr", {"V.Combined": {f"V.Combined.{c}": light for c in "RGB"}}),
        write_parts(tmp_path / "shot_mask_0001.exr", {"": dict.fromkeys("RGB", light)}),
    ]
    layers = Layers(files[0], shot_parts(files))
    assert {*layers.groups()} == {"V.Depth", "V.Normal", "V.Combined", "mask"}
    assert read_gbuffer(files, "blender", camera=CAMERA).composite is not None


def test_a_camera_reaches_as_far_as_the_file(tmp_path: Path) -> None:
    path = write(tmp_path / "a.exr", LAYERS | {"Depth.Z": np.where(T["hit"], 50 * T["planar"], 1e10)})
    g = read_gbuffer(path, camera=CAMERA).gbuffer
    assert float(g.depth[g.hit].max()) > CAMERA.far
    assert float(g.depth[g.hit].max()) < g.camera.far
    assert bool((g.depth[~g.hit] == g.camera.far).all())


def test_a_small_crop_of_a_picture_too_large_for_memory_is_refused(tmp_path: Path) -> None:
    many = {f"layer{n}.RGBA": np.zeros((*SIZE, 4)) for n in range(8)}
    path = write(tmp_path / "a.exr", many, {"displayWindow": window(0, 0, 8191, 8191)})  # pyright: ignore[reportArgumentType]
    with pytest.raises(ValueError, match=r"claims 8\.0 GB of pixels, more than the limit of 4; if true, set"):
        read_parts(path, header_only=True)


def test_luminance_with_chroma_at_half_size_is_refused(tmp_path: Path) -> None:
    path = write_parts(tmp_path / "a.exr", {"": dict.fromkeys(("Y", "BY", "RY"), np.ones(SIZE))})
    data = bytearray(path.read_bytes())
    for name in (b"BY\0", b"RY\0"):
        sampling = data.index(name) + len(name) + 8  # after type, linearity and three bytes of nothing
        data[sampling : sampling + 8] = struct.pack("<ii", 2, 2)
    path.write_bytes(data)
    with pytest.raises(ValueError, match="has subsampled channels, which gbufrt does not read; save it as RGB"):
        read_gbuffer(path, fov=40)


def test_wide_pixels_are_seen_under_wider_angles(tmp_path: Path) -> None:
    path = write(tmp_path / "a.exr", LAYERS, {"pixelAspectRatio": 2.0})  # pyright: ignore[reportArgumentType]
    wide, square = (read_gbuffer(p, fov=50).gbuffer.camera for p in (path, write(tmp_path / "b.exr", LAYERS)))
    corner = [camera.unproject(torch.ones(1, 1, *SIZE))[0, :, 0, 0] for camera in (wide, square)]
    assert torch.allclose(corner[0], corner[1] * torch.tensor([2.0, 1.0, 1.0]))
