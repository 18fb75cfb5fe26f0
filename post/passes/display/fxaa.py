"""Fast approximate anti-aliasing: smooth staircase edges in a single finished picture, without jittered history."""

from __future__ import annotations

import math

from torch import Tensor

from gbufrt import Frame, Pass
from gbufrt.channels import check_picture
from gbufrt.mending import finite
from gbufrt.numeric import check_between
from post.filters.fxaa_op import smooth_stairs


def fxaa(
    image: Tensor, *, subpixel: float = 0.5, edge_threshold: float = 0.125, dark_threshold: float = 0.03
) -> Tensor:
    """Anti-alias a finished picture by its own luma edges.

    Each pixel beside an edge searches along that edge for its two ends. It then shifts its sample position across the
    edge by the share of the pixel that a straight line between the ends would cover.

    Args:
        image: ``(B, 3, H, W)`` display-referred and encoded (perceptually uniform steps), in [0, 1].
        subpixel: how far isolated pixels fade into their neighbourhood, 0 to 1.
        edge_threshold: contrast relative to the brightest neighbour below which nothing is done.
        dark_threshold: contrast below which nothing is done however dark it is.

    Returns:
        ``(B, 3, H, W)``; pixels without an edge are returned exactly as they were.

    Raises:
        TypeError: ``image`` is no tensor of float32 or float64.
        ValueError: ``image`` is not ``(B, 3, H, W)``, or a number is out of range.

    Source: Lottes 2009, "FXAA" (NVIDIA white paper).
    """
    check_picture("image", image, "display-referred")
    check_between(0, 1, subpixel=subpixel)
    check_between(0, math.inf, edge_threshold=edge_threshold, dark_threshold=dark_threshold)
    image = finite(image)  # edges would lead far from a bad pixel
    return smooth_stairs(image, subpixel=subpixel, edge_threshold=edge_threshold, dark_threshold=dark_threshold)


class FXAA(Pass):
    """See `fxaa`. For single frames; frames of a jittered camera are better served by `TAA`."""

    reads = frozenset({"image"})
    writes = frozenset({"image"})

    def __init__(self, *, subpixel: float = 0.5, edge_threshold: float = 0.125, dark_threshold: float = 0.03) -> None:
        super().__init__()
        self.subpixel = subpixel
        self.edge_threshold = edge_threshold
        self.dark_threshold = dark_threshold

    def forward(self, frame: Frame) -> Frame:
        return frame.replace(image=fxaa(frame.read("image"), **self.tunables()))
