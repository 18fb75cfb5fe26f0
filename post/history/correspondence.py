"""What a history is looked up by, as a torch operator: kernels on CPU and CUDA, the torch reference elsewhere."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt import GBuffer
from gbufrt.compute.dispatch import Form, form_of
from post.history.reproject import check_alike, correspondence_reference, motion_of


@torch.library.custom_op("gbufrt::correspondence", mutates_args=())
def correspondence_cpu(
    now: list[Tensor], before: list[Tensor], length: Tensor, lenses: Tensor, poses: Tensor, parallel: bool
) -> tuple[Tensor, Tensor, Tensor]:
    """`correspondence` of two frames, from the channels that it reads.

    Args:
        now: depth, normal, hit, object id, motion, its change of z, and where to look, ``(B, C, H, W)``; an id that is
            not there has no rows.
        before: depth, normal, hit and object id of the frame before.
        length: as there, or without rows.
        lenses: ``(B, 2, 6)``, see `Camera.lens`: of this frame and the one before.
        poses: ``(B, 3, 3)``: rotation to the view of the frame before.
        parallel: whether its camera is orthographic.
    """
    from gbufrt.compute.kernel import array, threads
    from post.history.drivers import correspondence_each, correspondence_rows

    depth, size = now[0], now[0].shape[2:]
    out = [depth.new_empty(depth.shape[0], channels, *size) for channels in (9, 8, 2)]
    given = [t if t.shape[1] > 1 else t[:, 0] for t in (*now, *before, length)]
    if form_of(depth, cuda=True) is Form.CUDA:
        correspondence_each(depth.numel(), *out, *given, lenses, poses, parallel)
    else:
        correspondence_rows(*map(array, (*out, *given, lenses, poses)), parallel, threads())
    return out[0], out[1], out[2]


@correspondence_cpu.register_fake
def _(now, before, length, lenses, poses, parallel):
    depth = now[0]
    shapes = [(depth.shape[0], channels, *depth.shape[2:]) for channels in (9, 8, 2)]
    return depth.new_empty(shapes[0]), depth.new_empty(shapes[1]), depth.new_empty(shapes[2])


def correspondence(
    gbuffer: GBuffer,
    previous: GBuffer,
    length: Tensor | None = None,
    motion: Tensor | None = None,
    *,
    compiled: bool | None = None,
) -> tuple[Tensor, Tensor, Tensor]:
    """See `correspondence_reference`, the definition; ``compiled`` as in `gbufrt.compute.dispatch.form_of`."""
    check_alike(gbuffer, previous)
    moved, moved_z = motion_of(gbuffer, previous.camera)
    pose, lens, was = previous.camera.view_from_world[:, :3, :3], gbuffer.camera.lens, previous.camera.lens
    normals = [g.normal if g.normal_geo is None else g.normal_geo for g in (gbuffer, previous)]
    given = (gbuffer.depth, previous.depth, *normals, moved, moved_z, length, motion)
    if form_of(*given, *(t.to(moved) for t in (pose, lens, was)), compiled=compiled, cuda=True) is Form.REFERENCE:
        return correspondence_reference(gbuffer, previous, length, motion)
    none = gbuffer.depth.new_empty(gbuffer.batch, 1, 0, 0)
    by_object = gbuffer.object_id is not None and previous.object_id is not None
    ids = [g.object_id.to(none) if by_object and g.object_id is not None else none for g in (gbuffer, previous)]
    return correspondence_cpu(
        [gbuffer.depth, normals[0], gbuffer.hit, ids[0], moved, moved_z, moved if motion is None else motion],
        [previous.depth, normals[1], previous.hit, ids[1]],
        none if length is None else length,
        torch.stack([lens, was], dim=1).to(moved),
        pose.to(moved),
        previous.camera.orthographic,
    )
