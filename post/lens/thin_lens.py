"""The thin lens: how far out of focus a point is, and what to focus on."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt import Camera
from gbufrt.camera.normals import check_depth_map
from gbufrt.channels import check_tensor
from gbufrt.compute.resident import number
from gbufrt.demands.pictures import check_camera, check_pictures
from gbufrt.focus import median_depth
from gbufrt.gbuffer import CHANNELS
from gbufrt.numeric import check_each, check_for_each, check_numbers

TINY = 1e-6


def circle_of_confusion(
    depth: Tensor,
    camera: Camera,
    *,
    focus_distance: float | Tensor,
    aperture_radius: float | Tensor,
    hit: Tensor | None = None,
) -> Tensor:
    """Signed radius of the disc into which a lens spreads each point: negative before the focal plane, positive behind.

    A ray from the lens at offset o to a point at depth z intersects the focal plane f at o (1 - f/z) from the pinhole's
    ray; one world unit there is pixels_per_unit(f). So the radius is a pixels_per_unit(f) (1 - f/z), and
    a pixels_per_unit(f) for the sky. An orthographic camera has the matching telecentric lens: a cone of rays of radius
    a around each parallel ray, converging on the focal plane, hence a pixels_per_unit (z - f) / f.

    Args:
        depth: ``(B, 1, H, W)`` planar view z, world units.
        camera: where the picture was taken.
        focus_distance: planar depth of the focal plane, world units; a float or ``(B,)``.
        aperture_radius: of the lens, world units; a float or ``(B,)``.
        hit: ``(B, 1, H, W)`` bool; False marks the sky.

    Returns:
        ``(B, 1, H, W)`` pixels.

    Raises:
        ValueError: ``focus_distance`` is not positive or ``aperture_radius`` is negative; on a GPU they go unchecked.

    Source: Potmesil and Chakravarty 1981 (thin lens).
    """
    check_pictures(camera, depth=depth, hit=hit)
    check_each(0, above=True, unit="world units", focus_distance=focus_distance)
    check_each(0, unit="world units", aperture_radius=aperture_radius)
    check_for_each(len(depth), focus_distance=focus_distance, aperture_radius=aperture_radius)
    focus, aperture = _per_camera(focus_distance, depth), _per_camera(aperture_radius, depth)
    scale = aperture * camera.pixels_per_unit(torch.ones_like(depth[:, :, :1, :1]))
    if camera.orthographic:
        depth = depth if hit is None else torch.where(hit, depth, camera.far)
        return scale * (depth - focus) / focus
    inverse = 1 / depth.clamp_min(TINY)
    inverse = inverse if hit is None else torch.where(hit, inverse, 0.0)
    return scale * (1 / focus - inverse)


def autofocus(depth: Tensor, camera: Camera, *, hit: Tensor | None = None, region: float = 0.1) -> Tensor:
    """Median finite depth of the surfaces at the middle of the picture; the camera's far where there is only sky.

    Args:
        depth: ``(B, 1, H, W)`` planar view z, world units.
        camera: where the picture was taken.
        hit: ``(B, 1, H, W)`` bool; False marks the sky.
        region: height and width of the middle as a share of the picture's.

    Returns:
        ``(B,)`` world units.

    Raises:
        ValueError: ``region`` is not in (0, 1], or a picture has another form.

    Source: after BetterRTX, which focuses on a few central rays; the median of a region is our own.
    """
    check_numbers(region=region)
    check_camera(camera)
    check_depth_map(depth, camera.size)  # of any number: one camera serves them, as only its far counts
    if hit is not None:
        check_tensor("hit", hit, CHANNELS["hit"], batch=len(depth), size=camera.size, device=depth.device)
    if not 0 < region <= 1:
        raise ValueError(f"region must lie in (0, 1], got {region}")
    rows, columns = (max(1, round(n * float(region))) for n in depth.shape[-2:])
    top, left = (depth.shape[-2] - rows) // 2, (depth.shape[-1] - columns) // 2
    place = (..., slice(top, top + rows), slice(left, left + columns))
    middle = depth[place]
    known = torch.isfinite(middle) & (middle > 0)  # no surface lies at the eye: 0 stands for the sky in many files
    known = known if hit is None else hit[place] & known
    return median_depth(torch.where(known, middle, torch.nan).flatten(1), camera.far)


def _per_camera(value: float | Tensor, like: Tensor) -> Tensor:
    return number(value, like).reshape(-1, 1, 1, 1)
