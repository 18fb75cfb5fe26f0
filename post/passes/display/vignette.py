"""Vignette: a picture that darkens toward its corners."""

from __future__ import annotations

from torch import Tensor

from gbufrt import Frame, Pass
from gbufrt.channels import check_picture
from gbufrt.numeric import check_between, check_numbers
from post.display.op import darkened


def vignette(image: Tensor, *, strength: float = 0.25, inner: float = 0.4, outer: float = 1.2) -> Tensor:
    """Darken by distance from the middle, smoothly between two circles.

    Args:
        image: ``(B, C, H, W)`` display-linear.
        strength: how much is taken away at ``outer`` and beyond; 0 changes nothing, 1 goes to black.
        inner: distance where the darkening begins, in half diagonals: 1 is the corner.
        outer: distance where it is complete.

    Returns:
        ``(B, C, H, W)``.

    Raises:
        ValueError: ``strength`` is not in [0, 1], or not 0 <= inner < outer, or ``image`` has another shape.
        TypeError: ``image`` is no tensor of floats.

    Source: none; a smoothstep of the distance, as common in engines.
    """
    check_between(0, 1, strength=strength)
    check_numbers(inner=inner, outer=outer)
    if not 0 <= inner < outer:
        raise ValueError(f"inner and outer must satisfy 0 <= inner < outer, got {inner} and {outer}")
    check_picture("image", image, "display-linear", components=None)
    return darkened(image, strength, inner, outer)


class Vignette(Pass):
    """See `vignette`."""

    reads = frozenset({"image"})
    writes = frozenset({"image"})

    def __init__(self, *, strength: float = 0.25, inner: float = 0.4, outer: float = 1.2) -> None:
        super().__init__()
        self.strength, self.inner, self.outer = strength, inner, outer

    def forward(self, frame: Frame) -> Frame:
        return frame.replace(image=vignette(frame.read("image"), **self.tunables()))
