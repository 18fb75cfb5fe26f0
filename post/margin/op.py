"""The picture that taps read: visible fronts, solids, light and normals, with a margin past the border.

The torch code is in `post.margin.reference`, the kernel in `post.margin.kernel`.
"""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt import Camera
from gbufrt.compute.dispatch import Form, form_of
from gbufrt.compute.operators import operator
from post.margin.reference import LEAST, padded, width
from post.margin.view import PaddedView


def scene(
    camera: Camera,
    depth: Tensor,
    normal: Tensor,
    hit: Tensor,
    reach: Tensor,
    *,
    light: Tensor | None = None,
    within: bool = False,
    compiled: bool | None = None,
) -> PaddedView:
    """Continue and pad the pictures that taps read.

    Args:
        camera: of the picture.
        depth: ``(B, 1, H, W)`` planar view z, world units.
        normal: ``(B, 3, H, W)`` world space.
        hit: ``(B, 1, H, W)`` bool.
        reach: ``(B, 1, H, W)`` planar depth from front to back of visible surfaces, world units.
        light: ``(B, 3, H, W)`` that pixels send, read together with their normals in view space; the margin and
            pixels that hit nothing send none.
        within: whether taps end at the picture's border. Of the margin, which has twice the picture's pixels, only
            what is next to the border is then made.
        compiled: see `gbufrt.compute.dispatch.form_of`.
    """
    focal, center, jitter = camera.lens.to(depth.dtype).split(2, dim=1)
    first = (0.5 + jitter - center) / focal
    m = width(camera)
    kept = LEAST if within else m
    given = (depth, normal, reach) if light is None else (depth, normal, reach, light)
    if form_of(*given, camera.world_from_view, focal, compiled=compiled, cuda=True) is not Form.REFERENCE:
        lens = torch.cat([focal, first], dim=1)
        pose = camera.rotation_to_view.to(depth.dtype)
        sent = depth.new_empty(depth.shape[0], 0, *camera.size) if light is None else light
        view = (lens, pose, kept, float(camera.near), camera.orthographic)
        picture = padded_cpu(*given[:3], hit, sent, *view).movedim(-1, 1)
    else:
        picture = padded(camera, depth, normal, hit, reach, light, kept)
    pitch = 1 / focal
    origin = first - pitch * (m + 1)
    return PaddedView(
        picture=picture,
        origin_x=origin[:, 0, None, None],
        origin_y=origin[:, 1, None, None],
        pitch_x=pitch[:, 0, None, None],
        pitch_y=pitch[:, 1, None, None],
        margin=m,
        left_out=m - kept,
    )


@operator("gbufrt::padded")
def padded_cpu(
    depth: Tensor,
    normal: Tensor,
    reach: Tensor,
    hit: Tensor,
    light: Tensor,
    lens: Tensor,
    pose: Tensor,
    margin: int,
    near: float,
    parallel: bool,
) -> Tensor:
    """``(B, H', W', 2 or 8)``: the picture of `scene`, channels last.

    Args:
        depth: see `scene`, as ``normal``, ``reach`` and ``hit``.
        normal: see ``depth``.
        reach: see ``depth``.
        hit: see ``depth``.
        light: ``(B, 3 or 0, H, W)``.
        lens: ``(B, 4)``: focal lengths in pixels, and the ray through the first pixel at depth 1.
        pose: ``(B, 3, 3)``: from world to view.
        margin: pixels.
        near: least depth that a plane is continued at.
        parallel: whether the camera is orthographic.
    """
    from gbufrt.compute.kernel import array, threads
    from post.margin.drivers import padded_each, padded_rows

    tall, wide = (n + 2 * (margin + 1) for n in depth.shape[-2:])
    out = depth.new_empty(depth.shape[0], tall, wide, 8 if light.shape[1] else 2)
    planes = (out, depth[:, 0], normal, reach[:, 0], hit[:, 0], light, lens, pose)
    if form_of(depth, cuda=True) is Form.CUDA:
        padded_each(out[..., 0].numel(), *planes, margin, near, parallel)
    else:
        padded_rows(*map(array, planes), margin, near, parallel, threads())
    return out


@padded_cpu.register_fake
def _(depth, normal, reach, hit, light, lens, pose, margin, near, parallel):
    tall, wide = (n + 2 * (margin + 1) for n in depth.shape[-2:])
    return depth.new_empty(depth.shape[0], tall, wide, 8 if light.shape[1] else 2)
