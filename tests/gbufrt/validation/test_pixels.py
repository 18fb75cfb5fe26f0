"""What `validate` tells of pixels: how many are wrong, and where the first is."""

from __future__ import annotations

import boxes
import pytest
import torch


def put(tensor: torch.Tensor, *places: tuple[int, int], value: float) -> torch.Tensor:
    changed = tensor.clone()
    for y, x in places:
        changed[:, :, y, x] = value
    return changed


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("depth", torch.nan, r"depth must be finite, but 2 pixels are not, such as nan at \(b, c, y, x\) = \(0, 0, 40"),
        ("normal", torch.inf, r"normal must be finite, but 2 pixels are not, such as inf at .* = \(0, 0, 40, 50\)"),
        ("depth", -1.0, r"depth must be positive .* but 2 pixels are not positive, such as -1 at .*40, 50\)"),
        ("depth", 150.0, r"pass the camera's far \(100\) where hit, but 2 pixels are beyond it, such as 150 at"),
        ("albedo", 1.5, r"albedo must lie in \[0, 1\], but 2 pixels are outside \(0.* to 1.5\), such as 1.5 at"),
        ("emission", -0.5, r"emission must not be negative, but 2 pixels are so \(down to -0.5\)"),
        ("thickness", -0.5, r"thickness must not be negative, but 2 pixels are so"),
    ],
)
def test_wrong_pixels_are_counted(moving, name, value, message):
    with pytest.raises(ValueError, match=message):
        moving.replace(**{name: put(getattr(moving, name), (40, 50), (41, 3), value=value)}).validate()


def test_one_wrong_pixel_is_one(moving):
    with pytest.raises(ValueError, match="1 pixel is not, such as nan"):
        moving.replace(depth=put(moving.depth, (40, 50), value=torch.nan)).validate()


def test_many_wrong_normals_are_counted(moving):
    count = int(moving.hit.sum())
    with pytest.raises(ValueError, match=f"{count} pixels are of another length, such as 3 at"):
        moving.replace(normal=moving.normal * 3).validate()
    with pytest.raises(ValueError, match=rf"{count} pixels face away \(100% of those hit\), such as at \(b, c, y, x\)"):
        moving.replace(normal=-moving.normal).validate()
    with pytest.raises(ValueError, match=r"and \d+ pixels are off by more than"):
        moving.replace(motion=-moving.motion).validate()


def test_a_miss_with_another_depth_is_told(moving):
    hit = moving.hit.clone()
    hit[..., 40:42, 50] = False
    with pytest.raises(ValueError, match=r"the camera's far \(100\) where hit is False, but 2 pixels are another"):
        moving.replace(hit=hit).validate()
    moving.replace(hit=hit, depth=torch.where(hit, moving.depth, 100.0)).validate()


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("radiance", torch.nan, r"radiance must be finite, but 2 pixels are not, such as nan at .*mended"),
        ("ambient", torch.inf, "ambient must be finite"),
        ("radiance", -0.1, r"radiance must not be negative, but 2 pixels are so \(down to -0.1\)"),
        ("ao", 1.5, r"ao must lie in \[0, 1\], but 2 pixels are outside"),
        ("glow", torch.inf, "glow must be finite, but 2 pixels are not"),
    ],
)
def test_light_and_signals_are_validated(name, value, message):
    frame = boxes.frame()
    frame = frame.replace(ao=torch.ones_like(frame.gbuffer.depth)).write("glow", frame.gbuffer.depth)
    frame.validate()
    bad = frame.write(name, put(frame.read(name), (40, 50), (41, 3), value=value))
    with pytest.raises(ValueError, match=message):
        bad.validate()
    with pytest.raises(ValueError, match=f"^behind.{message}"):
        frame.replace(behind=bad).validate()


def test_environments_and_bent_normals_are_validated():
    frame = boxes.frame()
    with pytest.raises(ValueError, match="environment must be finite, but 1 pixel is not"):
        frame.replace(environment=put(frame.read("environment"), (3, 7), value=torch.nan)).validate()
    with pytest.raises(ValueError, match="bent_normal must have unit length where hit"):
        frame.replace(bent_normal=frame.gbuffer.normal * 2).validate()
    behind = frame.replace(gbuffer=frame.gbuffer.replace(depth=frame.gbuffer.depth * torch.nan))
    with pytest.raises(ValueError, match=r"^behind\.depth must be finite"):
        frame.replace(behind=behind).validate()
