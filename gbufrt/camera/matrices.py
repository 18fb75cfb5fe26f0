"""Checks of a camera's matrices: `gbufrt.Camera` inverts rigid poses by transposing.

They hold few numbers and are checked whenever a camera is made: plain Python is ten times as fast here as tensors.
"""

from __future__ import annotations

import math
from itertools import chain
from typing import Any

import torch
from torch import Tensor

RIGID = 1e-4  # how far axes may be off unit length and right angles: float32 and rounded digits
SMALL = 8  # pixels: no picture that is larger has such a focal length, and its middle in its first pixel
LAST_ROW = (0.0, 0.0, 0.0, 1.0)


def check_matrices(intrinsics: Tensor, world_from_view: Tensor, jitter: Tensor | None) -> None:
    """Raise ValueError unless every camera of a batch is a plain pinhole at a rigid pose.

    Args:
        intrinsics: ``(B, 3, 3)``, pixels.
        world_from_view: ``(B, 4, 4)``.
        jitter: ``(B, 2)`` pixels, or None.
    """
    for k in intrinsics.tolist():
        _check_intrinsics(k)
    for pose in world_from_view.tolist():
        _check_rigid(pose)
    if jitter is not None and not all(math.isfinite(n) for n in chain(*jitter.tolist())):
        raise ValueError(f"jitter must be finite, in pixels, got {jitter.tolist()}")


def check_pixels(intrinsics: Tensor, size: tuple[int, int]) -> None:
    """Raise ValueError where a camera's numbers are shares of the picture's sides, not pixels.

    Args:
        intrinsics: ``(B, 3, 3)``.
        size: of the picture, (H, W).
    """
    if min(size) <= SMALL:
        return
    for k in intrinsics.tolist():
        if max(k[0][0], k[1][1]) < SMALL and all(0 < k[i][2] <= 1 for i in (0, 1)):
            raise ValueError(
                f"intrinsics must be in pixels, got {k} for a picture of {size[1]}x{size[0]}; multiply the first row "
                "by the width and the second by the height"
            )


def _check_intrinsics(k: list[list[float]]) -> None:
    (fx, skew, cx), (tilt, fy, cy), last = k
    plain = max(abs(skew), abs(tilt), abs(last[0]), abs(last[1]), abs(last[2] - 1)) <= RIGID
    if not (plain and 0 < fx < math.inf and 0 < fy < math.inf and math.isfinite(cx) and math.isfinite(cy)):
        raise ValueError(
            "intrinsics must be [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] in pixels with fx and fy above 0, got "
            f"{k}; divide by the last element, and leave skew and flips out"
        )


def _check_rigid(pose: list[list[float]]) -> None:
    if not all(math.isfinite(n) for n in chain(*pose)) or math.dist(pose[3], LAST_ROW) > RIGID:
        raise ValueError(
            f"world_from_view must be finite and end in the row (0, 0, 0, 1), got {pose}; transpose it if its position "
            "is in the last row"
        )
    x, y, z = ([row[i] for row in pose[:3]] for i in range(3))
    squares = [_dot(axis, axis) for axis in (x, y, z)]
    skew = max(abs(_dot(x, y)), abs(_dot(y, z)), abs(_dot(z, x)))
    if max(abs(square - 1) for square in squares) > RIGID:
        lengths = ", ".join(f"{math.sqrt(square):.6g}" for square in squares)
        what = f"its axes have the lengths {lengths}; divide its columns by them, and scale the world instead"
    elif skew > RIGID:
        what = f"its axes are skewed, with a cosine of {skew:.2g} between them; make them perpendicular"
    elif _dot(x, [y[1] * z[2] - y[2] * z[1], y[2] * z[0] - y[0] * z[2], y[0] * z[1] - y[1] * z[0]]) < 0:
        what = "it mirrors; negate one of its first three columns (view space is x right, y down, z forward)"
    else:
        return
    raise ValueError(f"world_from_view must be a rotation and a position, but {what}")


def _dot(a: list[float], b: list[float]) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def matrix_of(name: str, rows: Any, side: int) -> Tensor:
    """``(B, side, side)`` of rows of numbers, with or without a batch.

    Raises:
        TypeError: they are no numbers.
        ValueError: they are of another shape.
    """
    try:
        matrix = torch.as_tensor(rows)
    except (TypeError, ValueError, RuntimeError):
        raise TypeError(f"{name} must be rows of numbers, got {rows!r}") from None
    matrix = matrix[None] if matrix.ndim == 2 else matrix
    if matrix.ndim != 3 or matrix.shape[1:] != (side, side) or not len(matrix):
        more = f"; its first three rows and columns: {name}[..., :3, :3]" if matrix.shape[1:] == (4, 4) else ""
        raise ValueError(f"{name} must be ({side},{side}) or (B,{side},{side}), got {told_shape(matrix)}{more}")
    return matrix


def told_shape(tensor: Tensor) -> str:
    """Its shape as messages have it."""
    return "(" + ",".join(str(n) for n in tensor.shape) + ")"
