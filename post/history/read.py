"""Histories read where this frame's surfaces were, as a torch operator: kernels on the CPU and on CUDA, else the torch
reference."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from gbufrt import GBuffer
from gbufrt.compute.dispatch import Form, form_of
from gbufrt.compute.operators import operator
from post.history.reproject import check_alike, correspondence_reference, find_taps, motion_of

SAME_PLANE = 0.3  # pixel footprints: a sharp history counts a step in a wall as another surface
BORROWED = 3.0  # frames: a shorter sharp history is replaced by that of a nearby step, capped at this length
LENT = 2.0  # frames: a shorter one still by that of what lies as deep, whichever way it faces


class Reading(NamedTuple):
    """A picture of the previous frame, read at this frame's pixels."""

    image: Tensor
    """``(B, C, H, W)``; zero where not valid."""
    support: Tensor
    """``(B, 1, H, W)`` in [0, 1]: how much of the bilinear footprint showed this surface."""
    trust: Tensor
    """``(B, 1, H, W)``: 1 where there is history, half where that lies as deep whichever way it faces, else 0."""

    @property
    def valid(self) -> Tensor:
        """``(B, 1, H, W)`` bool: whether there is any history."""
        return self.trust > 0

    @property
    def lent(self) -> Tensor:
        """``(B, 1, H, W)`` bool: whether that is of what lies as deep, whichever way it faces."""
        return self.valid & (self.trust < 1)


@operator("gbufrt::read_history")
def read_history_cpu(
    image: Tensor, now: list[Tensor], before: list[Tensor], lenses: Tensor, poses: Tensor, parallel: bool,
    plane: float, normal: float, search: int, sharp: bool,
) -> tuple[Tensor, Tensor]:  # fmt: skip
    """The picture ``(B, C, H, W)``; and ``(B, 2, H, W)``: support and trust, which need not be in memory as long.

    Args:
        image: ``(B, C, H, W)``.
        now: depth, normal, hit, object id, motion, its change of z, where to look, and ``wanted`` of `read_history`,
            ``(B, C, H, W)``; what is not there of the id and the last has no rows.
        before: depth, normal, hit and object id of the frame before, and the history's length, which may have no rows.
        lenses: ``(B, 2, 6)``, see `Camera.lens`: of this frame and the one before.
        poses: ``(B, 3, 3)``: rotation to the view of the frame before.
        parallel: whether its camera is orthographic.
        plane: ``plane_tolerance`` of `read_history`.
        normal: ``normal_tolerance``.
        search: 0 not, 1 for the surface, 2 else for what lies as deep; see `read_history`.
        sharp: see `read_history`.
    """
    from gbufrt.compute.kernel import array, threads
    from post.history.drivers import read_each, read_rows

    batch, _, height, width = image.shape
    out, marks = image.new_empty(image.shape), image.new_empty(batch, 2, height, width)
    given = [t if t.shape[1] > 1 else t[:, 0] for t in (*now, *before)]
    was = [t.flatten(-2) for t in given[len(now) :]]  # not in the kernel: what reshapes cannot be cached for a GPU
    pictures = out, marks, image.flatten(2), *given[: len(now)], *was, lenses, poses
    options = parallel, plane, normal, search, sharp
    if form_of(image, cuda=True) is Form.CUDA:
        read_each(batch * height * width, *pictures, *options)
    else:
        read_rows(*map(array, pictures), *options, threads())
    return out, marks


@read_history_cpu.register_fake
def _(image, now, before, lenses, poses, parallel, plane, normal, search, sharp):
    return image.new_empty(image.shape), image.new_empty(image.shape[0], 2, *image.shape[2:])


def read_history(
    gbuffer: GBuffer,
    previous: GBuffer,
    image: Tensor,
    *,
    length: Tensor | None = None,
    motion: Tensor | None = None,
    plane_tolerance: float = 2.0,
    normal_tolerance: float = 0.9,
    search: bool = True,
    sharp: bool = False,
    lenient: bool = False,
    wanted: Tensor | None = None,
    compiled: bool | None = None,
) -> Reading:
    """Read a picture of the previous frame where this frame's surfaces were.

    Each of the four pixels around the reprojected position counts only if it shows the same surface: the same hit
    flag and object, a similar normal, and a point within ``plane_tolerance`` of the surface's tangent plane at that
    time. Where none does, the 3x3 pixels around are searched for the nearest that does. Sky matches sky.

    History lives on the pixel grid without jitter: a still camera fetches each pixel from itself, jittered or not.

    Args:
        gbuffer: of this frame.
        previous: of the frame before, with its own camera.
        image: ``(B, C, H, W)`` of the frame before.
        length: ``(B, 1, H, W)`` history length of the frame before; pixels of length zero are not used.
        motion: see `correspondence_reference`.
        plane_tolerance: allowed distance from the plane, in pixel footprints.
        normal_tolerance: smallest allowed cosine between normals.
        search: whether to search the neighbours of failures.
        sharp: read with Catmull-Rom weights where all four pixels show the surface; outer taps that do not show it
            give their share to the nearest of the four. A history that moves every frame keeps its detail.
        lenient: where the search finds nothing, take the nearest of the 3x3 pixels of this object that lies within
            ``plane_tolerance`` of the depth expected, whichever way it faces.
        wanted: ``(B, 1, H, W)`` bool: pixels that are read, which alone take time; others have no history.
        compiled: see `gbufrt.compute.dispatch.form_of`.

    Returns:
        `Reading`.

    Raises:
        ValueError: the frames differ in batch or size.

    Source: Schied et al. 2017 (SVGF), section 4.1; per-tap validation as in NVIDIA's ReLAX.
    """
    check_alike(gbuffer, previous)
    moved, moved_z = motion_of(gbuffer, previous.camera)
    pose, lens, was = previous.camera.rotation_to_view, gbuffer.camera.lens, previous.camera.lens
    normals = [g.normal if g.normal_geo is None else g.normal_geo for g in (gbuffer, previous)]
    geometry = (moved_z, gbuffer.depth, previous.depth, *normals, pose, lens, was)
    steps = [t.detach().to(moved) for t in geometry]  # what counts is a step in them: no gradient to keep
    if form_of(image, length, moved, motion, *steps, compiled=compiled, cuda=True) is Form.REFERENCE:
        look = correspondence_reference(gbuffer, previous, length, motion)
        taps = find_taps(*look, plane_tolerance, normal_tolerance, search, sharp, lenient)
        trust = taps.valid.to(image.dtype) * (1 - 0.5 * taps.lent.to(image.dtype))
        read = Reading(taps.fetch(image), taps.support, trust)
        return read if wanted is None else Reading(*(torch.where(wanted, t, torch.zeros_like(t)) for t in read))
    moved_z, depth, depth_then, facing, facing_then, pose, lens, was = steps  # operators have no gradient to pass on
    now, then = _ids(gbuffer, previous)
    none = gbuffer.hit[:, :, :0, :0]
    look = moved if motion is None else motion
    found, marks = read_history_cpu(
        image,
        [depth, facing, gbuffer.hit, now, moved, moved_z, look, none if wanted is None else wanted],
        [depth_then, facing_then, previous.hit, then, image[:, :1, :0, :0] if length is None else length],
        torch.stack([lens, was], dim=1),
        pose,
        previous.camera.orthographic,
        plane_tolerance,
        normal_tolerance,
        search + (search and lenient),
        sharp,
    )
    return Reading(found, *marks.split(1, dim=1))


def read_sharp(gbuffer: GBuffer, previous: GBuffer, state: Tensor, *, lenient: Tensor | None = None) -> Tensor:
    """Read a state of the previous frame that keeps its detail, where this frame's surfaces were.

    The less of a footprint shows the surface, the shorter the history, because what is left lies to one side; where
    next to nothing is left it comes from a step beside it. Bodies thinner than a pixel show another of their sides in
    every frame, so that neither is found: ``lenient`` pixels then have a short history from what lies as deep.

    Args:
        gbuffer: of this frame.
        previous: of the frame before, with its own camera.
        state: ``(B, C, H, W)`` of the frame before, whose last channel is the length of its history.
        lenient: ``(B, 1, H, W)`` bool; none where absent.

    Returns:
        As ``state``; zero where there is no history.
    """
    length = state[:, -1:]
    found = read_history(
        gbuffer, previous, state, length=length, plane_tolerance=SAME_PLANE, search=False, sharp=True
    )  # fmt: skip
    kept, age = found.image, found.image[:, -1:] * found.support**2
    beside = read_history(
        gbuffer, previous, state, length=length, lenient=lenient is not None, wanted=age < BORROWED
    )  # fmt: skip
    other = beside.image[:, -1:].clamp_max(BORROWED)
    if lenient is not None:
        other = torch.where(beside.lent, other.clamp_max(LENT) * lenient, other)
    kept = torch.where(age < other, beside.image, kept)
    return torch.cat([kept[:, :-1], torch.maximum(age, other)], dim=1)


def _ids(gbuffer: GBuffer, previous: GBuffer) -> list[Tensor]:
    """Object ids of two frames, empty unless both have them."""
    ids = gbuffer.object_id, previous.object_id
    if ids[0] is None or ids[1] is None:
        return [gbuffer.hit.new_empty(gbuffer.batch, 1, 0, 0, dtype=torch.int32)] * 2
    return [t.to(torch.int32) for t in ids if t is not None]
