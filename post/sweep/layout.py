"""Data that the sweeps pass around: planes in the torch references, scalars in the kernels."""

from __future__ import annotations

from typing import NamedTuple

from torch import Tensor

from gbufrt.camera import Camera


class Receiving(NamedTuple):
    """Which pixels receive: every ``stride``-th of a picture both ways, where ``hit``."""

    camera: Camera
    depth: Tensor
    """``(B, 1, H, W)`` planar view z of the picture, world units."""
    normal: Tensor
    """``(B, 3, H, W)`` world space; zero where nothing was hit."""
    hit: Tensor
    """``(B, 1, H, W)`` bool."""
    stride: int = 1
    offset: tuple[int, int] = (0, 0)
    """First row and column."""

    def of(self, picture: Tensor) -> Tensor:
        """Those pixels of ``(..., H, W)``."""
        return picture[..., self.offset[0] :: self.stride, self.offset[1] :: self.stride]


class Receivers(NamedTuple):
    """The receiving pixels. All planes ``(B, h, w)`` unless said otherwise, view space."""

    column: Tensor
    """In the padded picture."""
    row: Tensor
    x: Tensor
    y: Tensor
    z: Tensor
    nx: Tensor
    ny: Tensor
    nz: Tensor
    vx: Tensor
    """Toward the eye, unit length."""
    vy: Tensor
    vz: Tensor
    scale: Tensor
    """Pixels along x that a world unit across the view spans here."""
    aspect: Tensor
    """``(B, 1, 1)``: pixels along y for each pixel along x."""


class Slice(NamedTuple):
    """One slice of every receiver. All planes ``(B, h, w)``."""

    nx: Tensor
    """Normal divided by the length of its projection into the slice."""
    ny: Tensor
    nz: Tensor
    hx: Tensor
    """Unit vector in the slice: the projected normal."""
    hy: Tensor
    hz: Tensor
    tx: Tensor
    """Unit vector in the slice, across the projected normal."""
    ty: Tensor
    tz: Tensor
    level: Tensor
    """Height of the receiver's plane along (nx, ny, nz), bias included."""
    place: Tensor
    """Of the receiver along (tx, ty, tz)."""
    cos_n: Tensor
    """Of the angle n from the direction toward the eye to the projected normal."""
    sin_n: Tensor
    n: Tensor
    measure: Tensor
    """Cosine-weighted measure of the whole arc, cos n + n sin n."""
    weight: Tensor
    """1: slices are drawn by what they hold of the hemisphere, see `post.sweep.turns`."""
    step_x: Tensor
    """Pixels that a world unit along the slice, across the ray, spans."""
    step_y: Tensor


class Tap(NamedTuple):
    """The surface at one tap along a slice, relative to the receiver. All planes ``(B, h, w)``."""

    front_rise: Tensor
    """Height above the receiver's plane (over the length of the projected normal) of the visible front."""
    front_run: Tensor
    """Along the receiver's plane within the slice, away from the receiver on this side."""
    back_rise: Tensor
    back_run: Tensor
    z: Tensor
    """Planar depth of the front and, below, of the back; equal where empty."""
    back_z: Tensor
    x: Tensor
    """With ``y``: slope (perspective) or place (orthographic) of the ray through the tap."""
    y: Tensor
    rest: Tensor
    """``(B, C, h, w)``: the other channels of the scene's picture."""


class Side(NamedTuple):
    """One side of a slice, outwards from the receiver."""

    cut: Slice
    """The slice; for the other side its mirror image."""
    dx: Tensor
    """Unit direction in the picture. Planes ``(B, h, w)``."""
    dy: Tensor
    length: Tensor
    """Pixels that a world unit spans."""
    frame: Tensor
    """Pixels to the picture's border."""
    border: Tensor
    """Pixels to the end of its margin."""
    half: Tensor
    """1 / (2 measure)."""
    whole: Tensor
    """Share of the arc's measure on this side of the direction toward the eye; both sides add up to 1."""
