"""What is told where blur is cut to the largest that a pass was given."""

from __future__ import annotations

import warnings
from collections.abc import Callable

import boxes
import pytest
import torch
from torch import Tensor

from post import depth_of_field, motion_blur

SIZE = (16, 24)
COLOR = torch.rand(1, 3, *SIZE)


def moved(share: float) -> Tensor:
    """Blur by motion, of which a share of the pixels is 10 pixels to either side."""
    motion = torch.zeros(1, 2, SIZE[0] * SIZE[1])
    motion[:, 0, : round(share * motion.shape[-1])] = 20.0
    return motion_blur(COLOR, torch.ones(1, 1, *SIZE), motion.view(1, 2, *SIZE), shutter=1.0, tile=8)


def unsharp(share: float) -> Tensor:
    """Blur by a lens, of which a share of the pixels has discs of more than 4 pixels."""
    depth = torch.full((1, 1, SIZE[0] * SIZE[1]), 5.0)
    depth[..., : round(share * depth.shape[-1])] = 500.0
    camera = boxes.camera(SIZE)
    return depth_of_field(
        COLOR, depth.view(1, 1, *SIZE), camera, focus_distance=5.0, aperture_radius=2.0, max_radius_px=4.0
    )


BLURS: dict[Callable[[float], Tensor], str] = {
    moved: "motion blur is cut to 16 pixels; set tile above 8 to",
    unsharp: "depth of field is cut to 4 pixels; set max_radius_px above 4 to",
}


@pytest.mark.parametrize("blur", BLURS)
def test_blur_that_is_cut_is_told(blur: Callable[[float], Tensor]):
    with pytest.warns(UserWarning, match=f"^{BLURS[blur]}"):
        blur(0.02)


@pytest.mark.parametrize("blur", BLURS)
def test_a_few_pixels_are_nothing_to_tell(blur: Callable[[float], Tensor]):
    with warnings.catch_warnings(action="error"):
        blur(0.005)
