"""The padded picture, as sweeps take it."""

from __future__ import annotations

from typing import NamedTuple

from torch import Tensor


class PaddedView(NamedTuple):
    """What taps read: pictures continued past their border, then one empty pixel; how pixels map to points."""

    picture: Tensor
    """``(B, C, H + 2 m + 2, W + 2 m + 2)`` with a margin of m pixels, see `post.margin.reference`: planar depth, planar
    depth of the back minus that of the front, and further channels. Empty where the two depths are equal."""
    origin_x: Tensor
    """``(B, 1, 1)``: slope (perspective) or place (orthographic) of the ray through column 0 of the padded picture."""
    origin_y: Tensor
    pitch_x: Tensor
    """``(B, 1, 1)``: change of slope or place from one pixel to the next."""
    pitch_y: Tensor
    margin: int
    """Pixels between the picture's border and the empty one."""
