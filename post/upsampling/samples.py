"""Which of a small jittered picture's samples lie around each pixel of a larger one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import torch
from torch import Tensor

from gbufrt.compute.resident import resident
from gbufrt.sampling import gather, sample
from post.filters.edges import offsets


@dataclass(frozen=True, eq=False)
class Samples:
    """Samples of a small picture, seen from the pixels of a larger one.

    Args:
        x: ``(B, H, W)`` integer column of the sample nearest to each pixel.
        y: as ``x``, row.
        away: ``(B, 2, H, W)`` from the pixel's centre to that sample, in pixels of the larger picture.
        ratio: sides of the larger picture over those of the small one, across and down.
    """

    x: Tensor
    y: Tensor
    away: Tensor
    ratio: tuple[float, float]

    @staticmethod
    def of(small: tuple[int, int], large: tuple[int, int], jitter: Tensor | None, like: Tensor) -> Samples:
        """The samples of a picture of size ``small`` ``(h, w)``, for the pixels of one of size ``large``.

        Args:
            small: ``(h, w)``.
            large: ``(H, W)``.
            jitter: ``(B, 2)`` pixels of the small picture from its pixels' centres to its samples.
            like: a tensor of the batch, the type and the device to have.
        """
        ratio = large[1] / small[1], large[0] / small[0]
        offset = like.new_zeros(like.shape[0], 2) if jitter is None else jitter.to(like)
        nearest, away = [], []
        for axis, (count, limit) in enumerate(((large[1], small[1]), (large[0], small[0]))):
            place = (torch.arange(count, dtype=like.dtype, device=like.device) + 0.5) / ratio[axis]
            index = torch.floor(place - offset[:, axis : axis + 1]).clamp(0, limit - 1)
            nearest.append(index.long())
            away.append((index + 0.5 + offset[:, axis : axis + 1] - place) * ratio[axis])
        shape = like.shape[0], *large
        x, y = nearest[0][:, None, :].expand(shape), nearest[1][:, :, None].expand(shape)
        gaps = torch.stack([away[0][:, None, :].expand(shape), away[1][:, :, None].expand(shape)], dim=1)
        return Samples(x=x, y=y, away=gaps, ratio=ratio)

    def between(self, small: Tensor) -> Tensor:
        """``(B, C, H, W)``: what a small picture ``(B, C, h, w)`` holds between its samples, bilinearly."""
        index = torch.stack([self.x, self.y], dim=1).to(self.away)
        return sample(small, index + 0.5 - self.away / resident(self.ratio, self.away)[None, :, None, None])

    def nearest(self, small: Tensor) -> Tensor:
        """``(B, C, H, W)``: what the nearest sample of a small picture ``(B, C, h, w)`` of any type holds."""
        return gather(small, self.x, self.y)

    def around(self, small: Tensor) -> Iterator[tuple[Tensor, Tensor]]:
        """The 3x3 samples about the nearest, with ``(B, 2, H, W)`` from the pixel to each, in its own pixels.

        Samples outside the picture repeat those of its border, and count as farther away.
        """
        (across, down), (height, width) = self.ratio, small.shape[-2:]
        for dy, dx in offsets(1):
            x, y = self.x + dx, self.y + dy
            step = self.away.new_tensor([dx * across, dy * down])[None, :, None, None]
            yield gather(small, x.clamp(0, width - 1), y.clamp(0, height - 1)), self.away + step

    def surrounding(self, small: Tensor) -> Iterator[tuple[Tensor, Tensor]]:
        """As `around`, the four samples that surround each pixel."""
        (across, down), (height, width) = self.ratio, small.shape[-2:]
        side = torch.where(self.away > 0, -1, 1)
        step = side * resident((across, down), self.away)[None, :, None, None]
        for dy, dx in ((0, 0), (0, 1), (1, 0), (1, 1)):
            x, y = self.x + dx * side[:, 0], self.y + dy * side[:, 1]
            away = self.away + step * resident((float(dx), float(dy)), self.away)[None, :, None, None]
            yield gather(small, x.clamp(0, width - 1), y.clamp(0, height - 1)), away
