"""Thickness estimated from the widths of bodies along the picture's rows and columns and from their visible sides.

Along a row, pixels whose points lie in each other's planes are one body. It ends where depth jumps, at the border of
another object, or in a crease. Bodies are taken for boxes. The picture gives three lengths along the view ray:

- to a back parallel to the front, where a side is on screen: as far back as that side reaches;
- to a hidden side, square to the front, at the silhouette: a ray slanted toward it leaves the body there;
- to the back of a body of which only the front is visible: it is about as deep as it is wide.

The smallest over rows and columns counts. A body that rounds off is no box: see `post.sweep.thickness`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt import GBuffer
from gbufrt.camera import Camera
from gbufrt.demands.pictures import check_pictures
from gbufrt.directions import length
from gbufrt.numeric import check_between
from post.sweep.thickness import End, round_chord

# Fitted to ray-traced AO in six views of the built-in world at 240x135, by the radius and scales of samples/fit_ao.py,
# and to the AO and GI of the Cornell box. The mean RMSE of the views is flat about them: 0.0626, and at most 0.0007
# more for twice or half of any (but 0.0012 for half of WIDER); FULLNESS keeps GI from rising in the Cornell box.
TOLERANCE = 1.5  # pixels that a neighbour may lie off a pixel's plane and belong to the same body
CREASE = 0.7  # cosine between normals below which a concave bend separates two bodies, as a pillar and its floor
FULLNESS = 0.75  # mean length behind a front over that of its box: bodies are rounder (a cylinder: 0.79)
SIDE = 1.5  # pixels: a side that reaches less far back does not count as one
WIDER = 2.0  # times the width on screen: depth of bodies whose ends are not on screen
GRAZING = 0.02  # least cosine between ray and normal


class Picture(NamedTuple):
    """Per-pixel inputs. All ``(B, 1 or 3, H, W)``, view space, world units."""

    point: Tensor
    normal: Tensor
    ray: Tensor
    """Away from the eye, unit length."""
    pixel: Tensor
    """Width of a pixel at the point."""
    hit: Tensor
    """bool."""
    object_id: Tensor
    """All zero where objects are not told apart."""

    def turned(self) -> Picture:
        """Rows and columns swapped; the axes of space stay."""
        return Picture(*(plane.transpose(-1, -2).contiguous() for plane in self))


class Contacts(NamedTuple):
    """Between neighbouring pixels of a row, and at its two ends, where all are False. All ``(B, 1, H, W + 1)`` bool."""

    near: Tensor
    """One of the two points lies in the other's plane."""
    crease: Tensor
    """Near, and bent toward the eye."""
    border: Tensor
    """Near, and of two different objects."""


class Lengths(NamedTuple):
    """Along the view ray, from the runs along one axis. All ``(B, 1, H, W)``, world units."""

    round: Tensor
    """To the back of a body that rounds off, see `post.sweep.thickness`; inf where none does."""

    back: Tensor
    """To the back of a body that ends on screen; inf where it does not."""
    side: Tensor
    """To a hidden side; inf where the ray does not slant toward one."""
    least: Tensor
    """On-screen width of the body, not ended by creases."""

    def turned(self) -> Lengths:
        """Rows and columns swapped."""
        return Lengths(*(plane.transpose(-1, -2) for plane in self))


def thickness_from_depth(
    depth: Tensor,
    normal: Tensor,
    camera: Camera,
    *,
    hit: Tensor | None = None,
    object_id: Tensor | None = None,
) -> Tensor:
    """Thickness estimated from the widths of bodies in the picture and from their visible sides.

    Differentiable in depth and normal almost everywhere; the grouping of pixels into bodies is held fixed.

    Args:
        depth: ``(B, 1, H, W)`` planar view z, world units.
        normal: ``(B, 3, H, W)`` world space, unit length.
        camera: where the picture was taken.
        hit: ``(B, 1, H, W)`` bool; by default every pixel.
        object_id: ``(B, 1, H, W)`` int32; where it changes, bodies end.

    Returns:
        ``(B, 1, H, W)`` distance along the view ray from front to back, world units, at most the camera's ``far``; 0
        where nothing was hit.

    Raises:
        TypeError: not a camera or a tensor.
        ValueError: a picture is not of the camera's size.

    Source: our own, see the module; fitted to ray-traced ambient occlusion.
    """
    check_pictures(camera, depth=depth, normal=normal, hit=hit, object_id=object_id)
    hit = torch.ones_like(depth, dtype=torch.bool) if hit is None else hit
    point = camera.unproject(depth)
    picture = Picture(
        point=point,
        normal=camera.rotate_to_view(normal.to(depth.dtype)),
        ray=-camera.to_eye(point),
        pixel=1 / camera.pixels_per_unit(depth),
        hit=hit,
        object_id=torch.zeros_like(hit, dtype=torch.int32) if object_id is None else object_id,
    )
    flat = camera.orthographic
    row, column = _lengths(picture, 0, flat), _lengths(picture.turned(), 1, flat).turned()
    back = FULLNESS * torch.minimum(row.back, column.back)
    back = torch.where(torch.isfinite(back), back, WIDER * torch.minimum(row.least, column.least))
    solid = torch.minimum(back, FULLNESS * torch.minimum(row.side, column.side))
    ball = torch.minimum(row.round, column.round)
    solid = torch.where(torch.isfinite(ball), FULLNESS * ball, solid)
    return torch.where(hit, solid.clamp_max(camera.far), 0.0)


def known_thickness(gbuffer: GBuffer, **assumed: float | None) -> Tensor | float:
    """The measured thickness of a G-buffer, else the assumed one, else an estimate; see `thickness_from_depth`.

    Args:
        gbuffer: what the camera saw.
        assumed: one number or None, by the name that it is given by.

    Raises:
        TypeError: it is no number.
        ValueError: it is negative or NaN, whether it is used or not.
    """
    g, told = gbuffer, {name: number for name, number in assumed.items() if number is not None}
    check_between(0, math.inf, **told)
    for known in (g.thickness, *told.values()):
        if known is not None:
            return known
    return thickness_from_depth(g.depth, g.normal, g.camera, hit=g.hit, object_id=g.object_id)


def _lengths(picture: Picture, axis: int, orthographic: bool) -> Lengths:
    """Lengths from the runs along the last dimension, along which ``axis`` of space grows."""
    contacts = _contacts(picture)
    joined = contacts.near & ~contacts.border
    runs = _runs(joined & ~contacts.crease)
    ends = _ends(picture, contacts, *runs)
    # A crease can end a body but does not prove that there is one: rooms and stairs have creases on both sides.
    ended = (ends[0].opened & (ends[1].opened | ends[1].crease)) | (ends[1].opened & ends[0].crease)
    back = torch.where(ended, length(ends[1].point - ends[0].point) + picture.pixel, torch.inf)
    facing = -(picture.normal * picture.ray).sum(1, keepdim=True)
    along = _along_the_front(picture, facing, axis)
    slant = (picture.ray * along).sum(1, keepdim=True)
    side, reach = torch.full_like(back, torch.inf), torch.zeros_like(back)
    for end, way in zip(ends, (-1.0, 1.0), strict=True):
        behind = ((picture.point - end.point) * picture.normal).sum(1, keepdim=True)
        reach = torch.maximum(reach, torch.where(end.opened, behind, 0.0))
        beside = way * ((end.point - picture.point) * along).sum(1, keepdim=True)
        leaves = (beside.clamp_min(0.0) + picture.pixel / 2) / (way * slant).clamp_min(GRAZING)
        side = torch.where(end.opened & (way * slant > GRAZING), torch.minimum(side, leaves), side)
    shown = torch.where(reach > SIDE * picture.pixel, reach / facing.clamp_min(GRAZING), torch.inf)
    chord = round_chord(picture.point, picture.normal, facing, ends, runs, orthographic)
    return Lengths(chord, torch.minimum(back, shown), side, _span(picture, *_runs(joined)))


def _contacts(picture: Picture) -> Contacts:
    """The contact of each pixel with the next of its row."""
    (one, other), (n_one, n_other) = _pairs(picture.point), _pairs(picture.normal)
    step = other - one
    off_one, off_other = (n_one * step).sum(1, keepdim=True), (n_other * step).sum(1, keepdim=True)
    near = torch.minimum(off_one.abs(), off_other.abs()) < TOLERANCE * torch.minimum(*_pairs(picture.pixel))
    near = near & torch.logical_and(*_pairs(picture.hit))
    crease = near & (off_other < off_one) & ((n_one * n_other).sum(1, keepdim=True) < CREASE)
    border = near & torch.ne(*_pairs(picture.object_id))
    return Contacts(*(F.pad(plane, (1, 1)) for plane in (near, crease, border)))


def _runs(joined: Tensor) -> tuple[Tensor, Tensor]:
    """First and last pixel ``(B, 1, H, W)`` int64 of each pixel's run, given which contacts join their pixels."""
    width = joined.shape[-1] - 1
    place = torch.arange(width, device=joined.device)
    first = torch.where(joined[..., :-1], -1, place).cummax(-1).values
    return first, torch.where(joined[..., 1:], width, place).flip(-1).cummin(-1).values.flip(-1)


def _ends(picture: Picture, contacts: Contacts, first: Tensor, last: Tensor) -> tuple[End, End]:
    """Both ends of each pixel's run."""
    depth = picture.point[:, 2:]
    past = F.pad(torch.where(picture.hit, depth, torch.inf), (1, 1), value=-torch.inf)  # sky: open; border: not open
    ends = []
    for pixel, contact, beyond in ((first, first, first), (last, last + 1, last + 2)):
        crease, border = contacts.crease.gather(-1, contact), contacts.border.gather(-1, contact)
        opened = (past.gather(-1, beyond) > depth.gather(-1, pixel)) | border
        ends.append(End(picture.point.gather(-1, pixel.expand_as(picture.point)), opened & ~crease, crease))
    return ends[0], ends[1]


def _along_the_front(picture: Picture, facing: Tensor, axis: int) -> Tensor:
    """``(B, 3, H, W)`` unit vectors in the pixels' planes, in the direction that ray hits move as ``axis`` grows."""
    step = picture.normal[:, axis, None] / facing.clamp_min(GRAZING) * picture.ray
    step = torch.cat([step[:, i, None] + (1.0 if i == axis else 0.0) for i in range(3)], dim=1)
    return step / length(step)


def _span(picture: Picture, first: Tensor, last: Tensor) -> Tensor:
    """Distance between the ends of runs, a pixel included."""
    one, other = (picture.point.gather(-1, place.expand_as(picture.point)) for place in (first, last))
    return length(other - one) + picture.pixel


def _pairs(plane: Tensor) -> tuple[Tensor, Tensor]:
    """Each pixel of a row but the last, and the one after it."""
    return plane[..., :-1], plane[..., 1:]
