"""How far directions that leave the picture count as open sky."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from gbufrt.camera import Camera
from post.margin.view import PaddedView
from post.sweep import arcs
from post.sweep.constants import FREE
from post.sweep.layout import Receivers, Side, Slice

WALL = 0.25  # weight of walls at the border, above the horizon, as evidence of a roof; a ceiling's is 1
CEILING = 0.5  # cosine with straight down above which a surface is a ceiling
LITTLE = 1e-3  # mean weight of the border that is half a proof; its square counts, so that rooms are closed
TINY = 1e-12


class Sky(NamedTuple):
    """Estimate of the sky beyond a picture's border. Planes ``(B, 1, 1)``."""

    share: Tensor
    """Of the directions above the horizon."""
    trust: Tensor
    """0 where the picture shows nothing above the horizon."""
    up_x: Tensor
    """World up in view space."""
    up_y: Tensor
    up_z: Tensor


def sky_beyond(camera: Camera, hit: Tensor, normal: Tensor) -> Sky:
    """Estimate from the picture's border above the horizon: its sky against its ceilings and, weighted less, its walls.

    Args:
        camera: of the picture.
        hit: ``(B, 1, H, W)`` bool.
        normal: ``(B, 3, H, W)`` world space.
    """
    hit, normal, px = (_border(t) for t in (hit, normal, camera.pixel_centers(dtype=normal.dtype)))
    ray = -camera.rotate_to_world(camera.to_eye(camera.unproject(torch.ones_like(normal[:, :1]), px)))
    weight = ray[:, 1:2].clamp_min(0) ** 2
    tall = (normal[:, 1:2].abs() < CEILING).to(normal)
    closed = ((normal[:, 1:2] < -CEILING) + WALL * tall) * hit
    free, taken = ((weight * part).mean((2, 3)) for part in (~hit, closed))
    told = free + taken
    trust = told**2 / (told**2 + LITTLE**2)
    share = 1 - trust * taken / (told + TINY)
    up = camera.world_from_view[:, 1, :3].to(normal)
    return Sky(share[..., None], trust[..., None], *up[..., None, None].unbind(1))


def _border(picture: Tensor) -> Tensor:
    """``(B, C, 1, P)``: the pixels along the border of ``(B, C, H, W)``, each once."""
    first, last, middle = picture[..., :1, :], picture[..., 1:, :][..., -1:, :], picture[..., 1:-1, :]
    lines = (first, last, middle[..., :1], middle[..., 1:][..., -1:])
    return torch.cat([line.flatten(2) for line in lines], dim=2)[:, :, None]


def leaves_hit(around: PaddedView, at: Receivers, side: Side) -> Tensor:
    """1 where a slice leaves the picture at a pixel that hit something, else 0."""
    column, row = (at.column + side.dx * side.frame).round(), (at.row + side.dy * side.frame).round()
    return arcs.step(around.at(column, row, slice(1, 2))[:, 0])


def open_share(sky: Sky, cut: Slice, groups: int, seam: Tensor, hits: tuple[Tensor, Tensor]) -> Tensor:
    """``(groups, B, h, w)``: how far uncovered parts of a slice's arc count as open.

    Sectors on a side that leaves the picture at the sky are open. On a side that leaves it at a surface, what follows
    is unknown: it is taken to be closed near the horizon, and as open as `Sky.share` above.

    Args:
        sky: of the picture.
        cut: the slice.
        groups: equal parts of the arc.
        seam: share of the arc on the left side.
        hits: see `leaves_hit`, for the right and the left side.
    """
    rise, run = arcs.mean_directions(cut.sin_n, groups)
    lift = cut.hx * sky.up_x + cut.hy * sky.up_y + cut.hz * sky.up_z
    slide = cut.tx * sky.up_x + cut.ty * sky.up_y + cut.tz * sky.up_z
    elevation = (rise * lift + run * slide) * (rise * rise + run * run + 1e-12).rsqrt()
    middle = (torch.arange(groups, dtype=rise.dtype, device=rise.device) + 0.5).view(-1, 1, 1, 1)
    right = (middle - seam * groups + 0.5).clamp(0, 1)
    unknown = (right * hits[0] + (1 - right) * hits[1]) * sky.trust
    return 1 - unknown * (1 - sky.share * (elevation / FREE).clamp(0, 1))
