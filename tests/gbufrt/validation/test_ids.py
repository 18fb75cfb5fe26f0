"""Masks of objects that lie beside the pixels of depth, as those of another crop or overscan."""

from __future__ import annotations

import boxes
import pytest
import torch


def test_masks_on_their_own_pixels_pass() -> None:
    boxes.frame(boxes.camera((90, 120))).validate()


@pytest.mark.parametrize(("x", "y"), [(3, 0), (0, -2), (-5, 4), (1, 1)])
def test_a_shifted_mask_is_told_with_its_shift(x: int, y: int) -> None:
    g = boxes.frame(boxes.camera((90, 120))).gbuffer
    assert g.object_id is not None
    shifted = g.replace(object_id=torch.roll(g.object_id, (y, x), (2, 3)))
    told = rf"object_id must lie on the pixels of depth: .* shifted by \({-x}, {-y}\) px; .*roll\(object_id, \({-y}"
    with pytest.raises(ValueError, match=told):
        shifted.validate()


def test_masks_without_an_edge_of_their_own_tell_nothing() -> None:
    """Objects that lie flat on others, and noise."""
    g = boxes.frame(boxes.camera((90, 120))).gbuffer
    stripes = (torch.arange(120) // 7 % 3).expand(1, 1, 90, 120).int()
    noise = torch.randint(0, 9, (1, 1, 90, 120), generator=torch.Generator().manual_seed(0)).int()
    for ids in (stripes, noise, 0 * noise):
        g.replace(object_id=ids).validate()
