"""A G-buffer prepared for filters, as a torch operator: kernels on the CPU and on CUDA, else the torch
reference."""

from __future__ import annotations

from torch import Tensor

from gbufrt import Camera
from gbufrt.compute.dispatch import Form, form_of
from gbufrt.compute.operators import operator
from gbufrt.demands.pictures import check_pictures
from post.filters.constants import ROUGHNESS
from post.filters.edges import Surface, surface_reference

PLANES = 4  # of `Surface.plane`


def surface(
    depth: Tensor,
    normal: Tensor,
    hit: Tensor,
    camera: Camera,
    roughness: Tensor | None = None,
    *,
    compiled: bool | None = None,
) -> Surface:
    """Prepare a G-buffer for `edges.edge_weight`; shapes and spaces as in `gbufrt.GBuffer`.

    Args:
        depth: planar view z.
        normal: world space.
        hit: bool.
        camera: of the picture.
        roughness: if filters are to tell surfaces apart by it.
        compiled: see `gbufrt.compute.dispatch.form_of`.

    Raises:
        TypeError: a channel is no tensor, or of the wrong kind of number.
        ValueError: shapes or devices disagree with the camera's.
    """
    check_pictures(camera, depth=depth, normal=normal, hit=hit, roughness=roughness)
    pose, lens = camera.rotation_to_view.to(depth), camera.lens.to(depth)
    if form_of(depth, normal, roughness, pose, lens, compiled=compiled, cuda=True) is Form.REFERENCE:
        return surface_reference(depth, normal, hit, camera, roughness)
    rough = depth[:, :0] if roughness is None else roughness
    guide, plane = surface_cpu(depth, normal, hit, rough, lens, pose, camera.orthographic)
    return Surface(guide, plane, not camera.orthographic)


@operator("gbufrt::surface")
def surface_cpu(
    depth: Tensor, normal: Tensor, hit: Tensor, roughness: Tensor, lens: Tensor, pose: Tensor, parallel: bool
) -> tuple[Tensor, Tensor]:
    """``guide`` and ``plane`` of `Surface`.

    Args:
        depth: ``(B, 1, H, W)``.
        normal: ``(B, 3, H, W)``.
        hit: ``(B, 1, H, W)`` bool.
        roughness: ``(B, 1 or 0, H, W)``.
        lens: ``(B, 6)``, see `Camera.lens`.
        pose: ``(B, 3, 3)``: rotation to view space.
        parallel: whether the camera is orthographic.
    """
    from gbufrt.compute.kernel import array, threads
    from post.filters.drivers import surface_rows
    from post.filters.pixel_drivers import surface_each

    batch, _, *size = depth.shape
    guide = depth.new_empty(batch, ROUGHNESS + roughness.shape[1], *size)
    plane = depth.new_empty(batch, PLANES, *size)
    pictures = (guide, plane, depth[:, 0], normal, hit[:, 0], roughness, lens, pose)
    if form_of(depth, cuda=True) is Form.CUDA:
        surface_each(depth.numel(), *pictures, parallel)
    else:
        surface_rows(*map(array, pictures), parallel, threads())
    return guide, plane


@surface_cpu.register_fake
def _(depth, normal, hit, roughness, lens, pose, parallel):
    batch, _, *size = depth.shape
    return depth.new_empty(batch, ROUGHNESS + roughness.shape[1], *size), depth.new_empty(batch, PLANES, *size)
