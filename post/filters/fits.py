"""What the kernels of the filters are made for: how much a GPU's thread holds, and powers of the cosine."""

from __future__ import annotations

from torch import Tensor

from post.filters.constants import MOST_PLANES

SQUARINGS = (11, 7, 5, 4, 3)  # of the cosine between normals: powers that filters have: 2048, 128, 32, 16 and 8


def fits_cuda(values: Tensor) -> bool:
    """Whether a thread of a GPU has room for the sums of so many channels."""
    return values.shape[1] <= MOST_PLANES


def squarings(power: float) -> tuple[int, ...]:
    """As many numbers as a kernel squares a cosine before it raises it to what is left of ``power``.

    Kernels are compiled for each length: few, so that few powers are compiled for.
    """
    return (0,) * next((count for count in SQUARINGS if power >= 2**count), 0)
