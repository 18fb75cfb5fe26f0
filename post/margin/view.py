"""The padded picture, as sweeps take it."""

from __future__ import annotations

from typing import NamedTuple

from torch import Tensor

from gbufrt.sampling import gather


class PaddedView(NamedTuple):
    """What taps read: pictures continued past their border, then one empty pixel; how pixels map to points."""

    picture: Tensor
    """``(B, C, H + 2 k + 2, W + 2 k + 2)`` with k <= m pixels of the margin, see `post.margin.reference`: planar depth,
    planar depth of the back minus that of the front, and further channels. Empty where the two depths are equal."""
    origin_x: Tensor
    """``(B, 1, 1)``: slope (perspective) or place (orthographic) of the ray through column 0 of the padded picture."""
    origin_y: Tensor
    pitch_x: Tensor
    """``(B, 1, 1)``: change of slope or place from one pixel to the next."""
    pitch_y: Tensor
    margin: int
    """Pixels m between the picture's border and the empty one. Columns and rows are counted as if all were there."""
    left_out: int = 0
    """m - k: pixels of the margin on each side that no tap reads, and that take no memory."""

    @property
    def size(self) -> tuple[int, int]:
        """Rows and columns with the whole margin."""
        height, width = self.picture.shape[-2:]
        return height + 2 * self.left_out, width + 2 * self.left_out

    def at(self, column: Tensor, row: Tensor, channels: slice = slice(None)) -> Tensor:
        """``(B, C, h, w)``: pixels of the picture at whole columns and rows ``(B, h, w)``."""
        return gather(self.picture[:, channels], column.int() - self.left_out, row.int() - self.left_out)
