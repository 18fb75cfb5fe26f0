"""What is told where blur is cut to the largest that a pass was given."""

from __future__ import annotations

import warnings

from torch import Tensor

from gbufrt.compute.resident import waits

MANY = 0.01  # share of the pixels: a blade of grass before the lens is nothing to tell


def tell_cut(size: Tensor, most: float, effect: str, tunable: str, set_to: float) -> None:
    """Warn where more than one pixel in a hundred has a larger blur than it gets; on a GPU nothing is told.

    Args:
        size: of the blur, of any shape and sign.
        most: the largest that it may be.
        effect: what is cut.
        tunable: the argument that sets the largest, in pixels.
        set_to: its value.
    """
    if waits(size):
        return
    size = size.detach().abs()
    if float(size.max()) <= most or float((size > most).float().mean()) <= MANY:
        return
    # no number that changes by the frame, or Python would tell of each frame
    warnings.warn(f"{effect} is cut to {most:g} pixels; set {tunable} above {set_to:g} to have all of it", stacklevel=3)
