"""Motion of what mirrors show: the virtual image moves unlike the surface that holds it."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from gbufrt import GBuffer
from gbufrt.compute.dispatch import Form, form_of
from gbufrt.compute.operators import operator
from gbufrt.directions import length as norm
from post.filters.around import pooled
from post.history.read import SAME_PLANE, read_history
from post.history.reproject import motion_of

AROUND = 5  # pixels: squares whose means tell which history a signal of rare bright samples belongs to
STEADY = 0.02  # radians a frame that the normal of a mirror may turn, besides its lobe, until it keeps half its image


def agreeing_motion(
    image: Tensor, signal: Tensor, gbuffer: GBuffer, before: GBuffer, length: Tensor, distance: Tensor
) -> Tensor:
    """Motion of each surface, or of its virtual image, by whichever history agrees better with the signal.

    Args:
        image: ``(B, C, H, W)`` of the frame before.
        signal: of this frame, as ``image``.
        gbuffer: of this frame.
        before: of the frame before.
        length: ``(B, 1, H, W)`` history length of the frame before.
        distance: ``(B, 1, H, W)`` world units to the reflected hit, 0 where the surface holds no image.

    Returns:
        ``(B, 2, H, W)`` pixels, previous minus current.
    """
    motion, virtual = motion_of(gbuffer, before.camera)[0], virtual_motion(gbuffer, before, distance)
    lead, wanted = image.shape[1], _compared(distance)
    surfaces = read_history(gbuffer, before, image, length=length, wanted=wanted)
    images = read_history(gbuffer, before, image, length=length, motion=virtual, wanted=wanted)
    agrees = closer(surfaces.image, images.image, signal[:, :lead], found := images.valid & (distance > 0))
    return torch.where(found & (agrees | ~surfaces.valid), virtual, motion)


def with_image(
    state: Tensor,
    history: Tensor,
    signal: Tensor,
    gbuffer: GBuffer,
    before: GBuffer,
    distance: Tensor,
    *,
    rare: bool,
) -> Tensor:
    """The sharp history of each surface, or of its virtual image, whichever agrees better with the signal.

    Args:
        state: ``(B, K, H, W)`` history of the surfaces at this frame's pixels, whose last channel is its length.
        history: ``(B, K, H, W)`` of the frame before, at its pixels; begins with the channels of ``signal``.
        signal: ``(B, C, H, W)`` of this frame.
        gbuffer: of this frame.
        before: of the frame before.
        distance: see `agreeing_motion`.
        rare: see `misfit`.

    Returns:
        As ``state``.
    """
    lead, virtual = signal.shape[1], virtual_motion(gbuffer, before, distance)
    sharp: dict[str, Any] = {"plane_tolerance": SAME_PLANE, "search": False, "sharp": True}
    found = read_history(
        gbuffer, before, history, length=history[:, -1:], motion=virtual, wanted=_compared(distance), **sharp
    )  # fmt: skip
    agrees = misfit(found.image, signal, lead, rare=rare) < misfit(state, signal, lead, rare=rare)
    return torch.where(found.valid & (distance > 0) & (agrees | (state[:, -1:] <= 0)), found.image, state)


def _compared(distance: Tensor) -> Tensor:
    """``(B, 1, H, W)`` bool: pixels that hold an image, and those around, which `misfit` compares too."""
    image = (distance > 0).to(distance.dtype)
    return pooled(image, torch.ones_like(image), AROUND) > 0


@operator("gbufrt::closer")
def closer_op(one: Tensor, other: Tensor, signal: Tensor, where: Tensor) -> Tensor:
    """See `closer`."""
    from post.history.drivers import closer_each

    out = torch.empty_like(where, memory_format=torch.contiguous_format)
    closer_each(out.numel(), out, one, other, signal, where)
    return out


@closer_op.register_fake
def _(one, other, signal, where):
    return torch.empty_like(where, memory_format=torch.contiguous_format)


def closer(one: Tensor, other: Tensor, signal: Tensor, where: Tensor, *, compiled: bool | None = None) -> Tensor:
    """Whether the ``other`` history differs less from a signal than ``one``, see `misfit`.

    Args:
        one: ``(B, C, H, W)``.
        other: as ``one``.
        signal: as ``one``.
        where: ``(B, 1, H, W)`` bool: pixels where it is wanted; the kernel finds False at others.
        compiled: see `gbufrt.compute.dispatch.form_of`.

    Returns:
        ``(B, 1, H, W)`` bool.
    """
    if form_of(one, other, signal, compiled=compiled, cuda=True) is not Form.REFERENCE:
        return closer_op(one, other, signal, where)
    return misfit(other, signal, signal.shape[1]) < misfit(one, signal, signal.shape[1])


@operator("gbufrt::image_motion")
def image_motion_cpu(
    depth: Tensor, distance: Tensor, lenses: Tensor, moves: Tensor, parallel: bool, was_parallel: bool
) -> Tensor:
    """See `virtual_motion`.

    Args:
        depth: ``(B, 1, H, W)`` planar view z, world units.
        distance: as ``depth``, to the reflected hit.
        lenses: ``(B, 2, 6)``: `Camera.lens` of this frame and the one before.
        moves: ``(B, 4, 4)`` from this view to the one before.
        parallel: whether the camera is orthographic.
        was_parallel: whether the one before is.
    """
    from post.history.drivers import image_motion_each

    out = depth.new_empty(len(depth), 2, *depth.shape[2:])
    image_motion_each(depth.numel(), out, depth, distance, lenses, moves, parallel, was_parallel)
    return out


@image_motion_cpu.register_fake
def _(depth, distance, lenses, moves, parallel, was_parallel):
    return depth.new_empty(len(depth), 2, *depth.shape[2:])


def virtual_motion(gbuffer: GBuffer, before: GBuffer, distance: Tensor, *, compiled: bool | None = None) -> Tensor:
    """Motion of the virtual image, which lies as far behind the surface as the reflected hit lies in front of it.

    Args:
        gbuffer: of this frame.
        before: of the frame before.
        distance: ``(B, 1, H, W)`` world units to the reflected hit.
        compiled: see `gbufrt.compute.dispatch.form_of`.

    Returns:
        ``(B, 2, H, W)`` pixels, previous minus current.
    """
    camera, was, depth = gbuffer.camera, before.camera, gbuffer.depth
    poses = (camera.intrinsics, camera.world_from_view, was.intrinsics, was.world_from_view)
    if form_of(depth, distance, *poses, compiled=compiled, cuda=True) is not Form.REFERENCE:
        lenses = torch.stack([one.lens.expand(len(depth), -1) for one in (camera, was)], dim=1).to(depth)
        moves = was.view_from_world.double() @ camera.world_from_view.double()
        return image_motion_cpu(depth, distance, lenses, moves.to(depth), camera.orthographic, was.orthographic)
    points = gbuffer.points_view()
    points = points - camera.to_eye(points) * distance  # one name: each of these ends with the next
    points = was.to_view(camera.to_world(points))
    return was.project(points) - camera.pixel_centers(dtype=points.dtype)


def image_kept(gbuffer: GBuffer, before: GBuffer) -> Tensor:
    """``(B, 1, H, W)`` in [0, 1]: how far a surface still mirrors what it mirrored in the frame before.

    Where its normal has turned, as on waves, it mirrors something else at the same place, which neither motion nor
    samples taken again tell of: those start from the normals of the frame before. 1 on rough surfaces, where the lobe
    is wider than the turn, and where the frame before does not show the surface.

    Args:
        gbuffer: of this frame; without roughness it mirrors nothing.
        before: of the frame before.
    """
    if gbuffer.roughness is None:
        return torch.ones_like(gbuffer.depth)
    found = read_history(gbuffer, before, before.normal.detach())
    turn = norm(found.image - gbuffer.normal.detach())
    kept = 1 / (1 + (turn / (STEADY + gbuffer.roughness.detach().square())).square())
    return torch.where(found.valid & gbuffer.hit, kept, 1.0)


def misfit(history: Tensor, signal: Tensor, lead: int, *, rare: bool = False) -> Tensor:
    """``(B, 1, H, W)``: by how much the first ``lead`` channels differ around each pixel.

    With ``rare`` bright samples their means are compared. Most samples are darker than the mean then, so that the
    history which differs less from each of them is the darker one: a tenth of the light of lamps would be lost.
    """
    apart, every = history[:, :lead] - signal[:, :lead], torch.ones_like(signal[:, :1])
    if rare:
        return pooled(apart, every, AROUND).abs().sum(1, keepdim=True)
    return pooled(apart.abs().sum(1, keepdim=True), every)
