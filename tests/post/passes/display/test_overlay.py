"""Overlay: blended over the finished picture, and drawn by nothing else."""

from __future__ import annotations

from pathlib import Path

import boxes
import numpy as np
import pytest
import torch
from PIL import Image

from gbufrt.files.png import read_rgba
from post import me1
from post.passes.display.overlay import Overlay, overlay

SIZE = (12, 16)


@pytest.fixture
def hud(tmp_path: Path) -> tuple[str, torch.Tensor]:
    """A file whose left half is opaque red, whose right half is nothing; and the same as a tensor."""
    levels = np.zeros((*SIZE, 4), np.uint8)
    levels[:, :8] = (255, 0, 0, 255)
    Image.fromarray(levels).save(tmp_path / "hud.png")
    return str(tmp_path / "hud.png"), torch.from_numpy(levels).permute(2, 0, 1)[None].float() / 255


def test_alpha_weighs_and_colour_is_not_multiplied_by_it():
    image = torch.full((2, 3, 1, 3), 0.5)
    ui = torch.tensor([[0.8, 0.8, 0.8], [0.2, 0.2, 0.2], [0.0, 0.0, 0.0], [0.0, 0.25, 1.0]]).reshape(1, 4, 1, 3)
    expected = torch.tensor([[0.5, 0.575, 0.8], [0.5, 0.425, 0.2], [0.5, 0.375, 0.0]])
    assert torch.allclose(overlay(image, ui), expected[None, :, None].expand(2, 3, 1, 3))


def test_the_picture_under_it_is_that_of_a_run_without(hud: tuple[str, torch.Tensor]):
    frame = boxes.frame(boxes.camera(SIZE))
    plain, _ = me1("low").settle(frame, 1)
    pipeline = me1("low", tunables={"ui.picture": hud[0]})
    image = pipeline.settle(frame, 1)[0].read("image")
    assert torch.equal(image[..., 8:], plain.read("image")[..., 8:])
    red = torch.tensor([1.0, 0.0, 0.0])[None, :, None, None]
    assert torch.equal(image[..., :8], red.expand_as(image[..., :8])), "no curve, no vignette, no blur"


def test_a_signal_comes_before_the_file(hud: tuple[str, torch.Tensor]):
    image = torch.rand(1, 3, *SIZE)
    frame = boxes.frame(boxes.camera(SIZE)).replace(image=image)
    assert Overlay()(frame) is frame
    path, ui = hud
    assert torch.equal(read_rgba(path), ui)
    assert torch.equal(Overlay(picture=path)(frame).read("image"), overlay(image, ui))
    assert torch.equal(Overlay(picture=path)(frame.write("ui", 0 * ui)).read("image"), image)


def test_gradients():
    image = torch.rand(1, 3, 3, 4, dtype=torch.float64, requires_grad=True)
    ui = torch.rand(1, 4, 3, 4, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(overlay, (image, ui))


@pytest.mark.parametrize("shape", [(1, 3, *SIZE), (2, 4, *SIZE), (1, 4, 6, 8), (4, *SIZE)])
def test_another_shape_is_told(shape: tuple[int, ...]):
    with pytest.raises(ValueError, match=r"ui must be \((1,4,12,16|B,4,H,W)\), colour and alpha"):
        overlay(torch.zeros(1, 3, *SIZE), torch.zeros(shape))


def test_files_that_do_not_fit_are_told(hud: tuple[str, torch.Tensor], tmp_path: Path):
    frame = boxes.frame(boxes.camera((6, 8))).replace(image=torch.zeros(1, 3, 6, 8))
    with pytest.raises(ValueError, match="has 16x12 pixels, the frame 8x6"):
        Overlay(picture=hud[0])(frame)
    with pytest.raises(TypeError, match="picture must be a path, got 3"):
        Overlay(picture=3)  # pyright: ignore[reportArgumentType]
    with pytest.raises(FileNotFoundError, match="does not exist"):
        Overlay(picture=str(tmp_path / "none.png"))(frame)
    Image.new("RGB", (8, 6)).save(tmp_path / "opaque.png")
    with pytest.raises(ValueError, match="has no alpha"):
        Overlay(picture=str(tmp_path / "opaque.png"))(frame)
    whole = Path(hud[0]).read_bytes()
    for damaged in (b"", b"text", whole[: len(whole) // 2]):
        (tmp_path / "damaged.png").write_bytes(damaged)
        with pytest.raises(ValueError, match="no picture that can be read"):
            read_rgba(tmp_path / "damaged.png")
