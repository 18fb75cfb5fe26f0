"""Screen-space rays, and what they traverse, as torch operators: kernels on the CPU and on CUDA, else the torch
reference."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt import Camera
from gbufrt.compute.dispatch import Form, form_of
from gbufrt.compute.operators import operator
from post.march.hierarchy import hierarchy_reference, levels_of
from post.march.reference import march_rays_reference


@operator("gbufrt::march_rays")
def march_rays_cpu(
    planes: Tensor,
    pyramid: Tensor,
    table: Tensor,
    lens: Tensor,
    origins: Tensor,
    directions: Tensor,
    near: float,
    orthographic: bool,
    distance: float,
    steps: int,
) -> Tensor:
    """``(B, 5, h, w)`` float32: px x, px y, distance, agreement, status. Inputs as `post.march.rays` lays them out."""
    from post.march.drivers import march_each

    origins, directions, size = origins.flatten(2), directions.flatten(2), origins.shape[2:]
    out = origins.new_empty((len(origins), 5, origins.shape[2]), dtype=torch.float32)
    inputs = (planes, pyramid, table, lens, origins, directions)
    march_each(len(origins) * origins.shape[2], out, *inputs, near, orthographic, distance, steps)
    return out.unflatten(2, size)


@march_rays_cpu.register_fake
def _(planes, pyramid, table, lens, origins, directions, near, orthographic, distance, steps):
    return origins.new_empty((origins.shape[0], 5, *origins.shape[2:]), dtype=torch.float32)


def march(
    planes: Tensor,
    pyramid: Tensor,
    table: Tensor,
    lens: Tensor,
    origins: Tensor,
    directions: Tensor,
    near: float,
    orthographic: bool,
    distance: float,
    steps: int,
    *,
    compiled: bool | None,
) -> Tensor:
    """Either form of `march_rays_cpu`; see `gbufrt.compute.dispatch.form_of` for ``compiled``."""
    form = form_of(planes, pyramid, origins, directions, compiled=compiled, cuda=True)
    run = march_rays_reference if form is Form.REFERENCE else march_rays_cpu
    return run(planes, pyramid, table, lens, origins, directions, near, orthographic, distance, steps)


@operator("gbufrt::depth_hierarchy")
def hierarchy_cpu(
    depth: Tensor,
    normal: Tensor,
    hit: Tensor,
    thickness: Tensor,
    assumed: float,
    lens: Tensor,
    pose: Tensor,
    orthographic: bool,
) -> tuple[Tensor, Tensor]:
    """``planes`` and ``pyramid`` of `post.march.rays.Hierarchy`.

    Args:
        depth: ``(B, 1, H, W)``.
        normal: ``(B, 3, H, W)``.
        hit: ``(B, 1, H, W)`` bool.
        thickness: ``(B, 1 or 0, H, W)`` along view rays.
        assumed: planar, where there is no ``thickness``.
        lens: ``(B, 6)``, see `Camera.lens`.
        pose: ``(B, 3, 3)``: rotation to view space.
        orthographic: whether the camera is.
    """
    from post.march.drivers import coarser_each, planes_each

    planes, pyramid = _empty_hierarchy(depth)
    (first, *coarser), batch = levels_of(*depth.shape[2:]), len(depth)
    pictures = (depth[:, 0], normal, hit[:, 0], thickness)
    planes_each(batch * first[1] * first[2], planes, pyramid, *pictures, assumed, lens, pose, orthographic)
    for finer, (_, tall, wide) in zip([first, *coarser], coarser, strict=False):
        coarser_each(batch * tall * wide, pyramid, *finer)
    return planes, pyramid


@hierarchy_cpu.register_fake
def _(depth, normal, hit, thickness, assumed, lens, pose, orthographic):
    return _empty_hierarchy(depth)


def _empty_hierarchy(depth: Tensor) -> tuple[Tensor, Tensor]:
    batch, _, height, width = depth.shape
    start, tall, wide = levels_of(height, width)[-1]
    return depth.new_empty(batch, height, width, 4), depth.new_empty(batch, start + tall * wide, 2)


def hierarchy_of(
    depth: Tensor,
    normal: Tensor,
    hit: Tensor,
    thickness: Tensor | float,
    camera: Camera,
    *,
    compiled: bool | None,
) -> tuple[Tensor, Tensor]:
    """Either form of `hierarchy_cpu`; see `post.march.rays.depth_hierarchy`, and `form_of` for ``compiled``."""
    lens, pose = camera.lens.to(depth), camera.rotation_to_view.to(depth)
    if form_of(depth, normal, thickness, lens, pose, compiled=compiled, cuda=True) is Form.REFERENCE:
        return hierarchy_reference(depth, normal, hit, thickness, camera)
    measured = isinstance(thickness, Tensor)
    solid = thickness.expand_as(depth) if measured else depth[:, :0]
    return hierarchy_cpu(
        depth, normal, hit, solid, 0.0 if measured else float(thickness), lens, pose, camera.orthographic
    )
