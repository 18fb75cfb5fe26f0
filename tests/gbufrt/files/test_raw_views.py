"""Pictures of the layers of any EXR file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenEXR
import pytest
import torch

from gbufrt.files.gbuffers.layers import Layers
from gbufrt.files.guard import read_parts
from gbufrt.files.raw_views import pictures

SIZE = (8, 10)
RAMP = np.linspace(0, 1, SIZE[1], dtype=np.float32)[None].repeat(SIZE[0], 0)


def shown(folder: Path, channels: dict[str, np.ndarray]) -> dict[str, torch.Tensor]:
    """Pictures ``(3, H, W)`` by their labels."""
    path = folder / "a.exr"
    header = {"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION}
    OpenEXR.File(header, {name: np.ascontiguousarray(plane) for name, plane in channels.items()}).write(str(path))
    found = {label: picture[0] for label, picture in pictures(Layers(path, read_parts(path)))}
    for picture in found.values():
        assert picture.shape == (3, *SIZE)
        assert 0 <= float(picture.min()) <= float(picture.max()) <= 1
    return found


def test_channels_that_belong_together_make_one_picture_and_each_is_in_one(tmp_path: Path) -> None:
    names = ["V.C.B", "V.C.G", "V.C.R", "V.C.A", "V.Vector.X", "V.Vector.Y", "V.Vector.Z", "V.Vector.W", "Z", "UV.U"]
    labels = [label.split("  ")[0] for label in shown(tmp_path, dict.fromkeys(names, RAMP))]
    assert sorted(labels) == ["UV.U", "V.C.A", "V.C.RGB", "V.Vector.XY", "V.Vector.ZW", "Z"]


def test_labels_tell_the_range_of_finite_values(tmp_path: Path) -> None:
    odd = RAMP.copy()
    odd[0, :3] = np.nan, np.inf, -np.inf
    found = shown(tmp_path, {"a.q": RAMP * 4 - 1, "b.q": odd, "c.q": RAMP * 0 + 7, "d.q": RAMP * np.nan})
    assert list(found) == ["a.q  -1 to 3", "b.q  0 to 1", "c.q  7", "d.q  nothing finite"]
    magenta = torch.tensor([1.0, 0.0, 1.0])
    assert torch.equal(found["b.q  0 to 1"][:, 0, :3], magenta[:, None].expand(3, 3))
    assert not torch.equal(found["b.q  0 to 1"][:, 0, 3], magenta)


def test_sky_does_not_drown_what_is_before_it(tmp_path: Path) -> None:
    depth = RAMP * 10 + 2
    depth[:2] = 1e10
    view = next(iter(shown(tmp_path, {"D.Z": depth}).values()))
    assert float(view[:, :2].max()) == 0
    assert float((view[:, 5, 0] - view[:, 5, -1]).abs().max()) > 0.8


def test_vectors_of_length_one_are_directions_and_others_are_scaled(tmp_path: Path) -> None:
    zero = np.zeros(SIZE, np.float32)
    up = np.where(np.arange(SIZE[0]) < 2, 0, 1).astype(np.float32)[:, None].repeat(SIZE[1], 1)
    xyz = {
        f"{n}.{c}": plane
        for n, size in (("n", 1), ("p", 40))
        for c, plane in zip("XYZ", (zero, up * size, zero), strict=True)
    }
    normal, position = shown(tmp_path, xyz).values()
    assert normal[:, 5, 5].tolist() == [0.5, 1.0, 0.5]
    assert float(normal[:, 0].max()) == 0
    assert position[:, 5, 5].tolist() == [0.0, 1.0, 0.0]


def test_colours_up_to_one_are_shown_as_they_are_and_brighter_ones_fit(tmp_path: Path) -> None:
    grey = {f"c.{c}": RAMP * 0 + 0.5 for c in "RGB"}
    bright = {f"l.{c}": RAMP * 50 for c in "RGB"}
    plain, light = shown(tmp_path, grey | bright).values()
    assert plain.mean().item() == pytest.approx(0.7354, abs=1e-3)
    assert 0.3 < float(light[0, 0, 3]) < float(light[0, 0, 5]) < float(light[0, 0, 9]) < 1


def test_whole_numbers_are_told_apart(tmp_path: Path) -> None:
    view = next(iter(shown(tmp_path, {"id.X": np.arange(80, dtype=np.uint32).reshape(SIZE)}).values()))
    assert float((view[:, :, 1:] - view[:, :, :-1]).abs().amax(0).min()) > 0.1


def test_pairs_are_shown_as_motion_up_to_their_longest(tmp_path: Path) -> None:
    right, left = shown(
        tmp_path,
        {f"{name}.{c}": RAMP * size if c == "X" else RAMP * 0 for name, size in (("a", 40), ("b", -0.1)) for c in "XY"},
    ).values()
    assert right[:, 0, -1].tolist() == pytest.approx([1.0, 0.25, 0.25], abs=1e-3)
    assert left[:, 0, -1].tolist() == pytest.approx([0.0, 0.75, 0.75], abs=1e-3)
    assert float(right[:, 0, 0].max()) == 0


def test_numbers_are_scaled_from_their_lowest_and_nothing_but_sky_is_black(tmp_path: Path) -> None:
    ramp, sky = shown(tmp_path, {"a.q": RAMP + 100, "b.q": RAMP * 0 + 1e9}).values()
    assert ramp[:, 0, 0].tolist() == pytest.approx([0.267, 0.005, 0.329], abs=0.03)
    assert ramp[:, 0, -1].tolist() == pytest.approx([0.993, 0.906, 0.144], abs=0.03)
    assert float(sky.max()) == 0


def test_one_value_everywhere_is_shown_as_itself(tmp_path: Path) -> None:
    zero, half, one = shown(
        tmp_path, {f"{name}.q": RAMP * 0 + value for name, value in (("a", 0), ("b", 0.5), ("c", 1))}
    ).values()
    assert float((one - zero).abs().max()) > 0.5
    assert float((one - half).abs().amax()) > 0.2
