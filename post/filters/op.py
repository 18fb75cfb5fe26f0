"""Edge-aware filters as torch operators: kernels on the CPU and on CUDA, else the torch reference."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt.compute.dispatch import Form, form_of
from gbufrt.compute.operators import operator
from gbufrt.luminance import luminance
from post.filters.constants import COARSE_POWER
from post.filters.edges import Surface, fits_cuda, kinds_of, squarings
from post.filters.reference import bilateral_reference, limits_reference, moments_reference, wavelet_reference


@operator("gbufrt::moments")
def moments_cpu(
    light: Tensor, guide: Tensor, plane: Tensor, radius: int, perspective: bool, depth_sensitivity: float
) -> Tensor:
    """``(B, 2, H, W)``. Tensors are those of `Surface`, and ``light`` as in `moments`."""
    from gbufrt.compute.kernel import array, threads
    from post.filters.drivers import moments_rows
    from post.filters.pixel_drivers import moments_each

    out = light.new_empty(light.shape[0], 2, *light.shape[2:])
    pictures, squares = (out, light[:, 0], guide, plane), squarings(COARSE_POWER)
    if form_of(light, cuda=True) is Form.CUDA:
        moments_each(light.numel(), *pictures, radius, perspective, depth_sensitivity, squares)
    else:
        kinds = kinds_of(perspective, COARSE_POWER, guide)
        moments_rows(*map(array, pictures), radius, depth_sensitivity, *kinds, squares, threads())
    return out


@moments_cpu.register_fake
def _(light, guide, plane, radius, perspective, depth_sensitivity):
    return light.new_empty(light.shape[0], 2, *light.shape[2:])


@operator("gbufrt::wavelet")
def wavelet_cpu(
    values: Tensor,
    guide: Tensor,
    plane: Tensor,
    reach: Tensor,
    step: int,
    perspective: bool,
    phi_color: float,
    phi_depth: float,
    phi_normal: float,
) -> Tensor:
    """``(B, C + 2, H, W)``. Tensors are those of `Surface` and of `wavelet`."""
    from gbufrt.compute.each import counted
    from gbufrt.compute.kernel import array, threads
    from post.filters.drivers import wavelet_rows
    from post.filters.pixel_drivers import wavelet_each

    out = torch.empty_like(values, memory_format=torch.contiguous_format)
    surroundings, phi = (guide, plane, reach[:, 0]), (phi_color, phi_depth, phi_normal)
    squares, channels = squarings(phi_normal), counted(values.shape[1] - 1)
    if form_of(values, cuda=fits_cuda(values)) is Form.CUDA:
        wavelet_each(values[:, 0].numel(), out, values, *surroundings, step, perspective, *phi, squares, channels)
    else:
        numbers, kinds = array(values), kinds_of(perspective, phi_normal, guide)
        pictures = (array(out), numbers, numbers.reshape(-1), *map(array, surroundings))
        wavelet_rows(*pictures, step, *phi, *kinds, squares, channels, threads())
    return out


@wavelet_cpu.register_fake
def _(values, guide, plane, reach, step, perspective, phi_color, phi_depth, phi_normal):
    return torch.empty_like(values, memory_format=torch.contiguous_format)


@operator("gbufrt::joint_bilateral")
def bilateral_cpu(
    values: Tensor,
    guide: Tensor,
    plane: Tensor,
    width: Tensor,
    tolerance: Tensor,
    radius: int,
    perspective: bool,
    depth_sensitivity: float,
    normal_power: float,
) -> Tensor:
    """``(B, C, H, W)``. Tensors are those of `Surface` and of `joint_bilateral`."""
    from gbufrt.compute.each import counted
    from gbufrt.compute.kernel import array, threads
    from post.filters.drivers import bilateral_rows
    from post.filters.pixel_drivers import bilateral_each

    out = values.new_empty(values.shape[0], values.shape[1] - 1, *values.shape[2:])
    squares, channels = squarings(normal_power), counted(values.shape[1] - 1)
    surroundings, options = (guide, plane, width[:, 0], tolerance[:, 0]), (depth_sensitivity, normal_power)
    if form_of(values, cuda=fits_cuda(values)) is Form.CUDA:
        pictures = (out, values, *surroundings)
        bilateral_each(width.numel(), *pictures, radius, perspective, *options, squares, channels)
    else:
        numbers, kinds = array(values), kinds_of(perspective, normal_power, guide)
        pictures = (array(out), numbers, numbers.reshape(-1), *map(array, surroundings))
        bilateral_rows(*pictures, radius, *options, *kinds, squares, channels, threads())
    return out


@bilateral_cpu.register_fake
def _(values, guide, plane, width, tolerance, radius, perspective, depth_sensitivity, normal_power):
    return values.new_empty(values.shape[0], values.shape[1] - 1, *values.shape[2:])


@operator("gbufrt::bilateral_limits")
def limits_cpu(
    light: Tensor, variance: Tensor, sigma: float, sensitivity: float, phi_color: float
) -> tuple[Tensor, Tensor]:
    """See `bilateral_limits`."""
    from gbufrt.compute.kernel import array, threads
    from post.filters.drivers import limits_rows
    from post.filters.pixel_drivers import limits_each

    width, tolerance = (torch.empty_like(light, memory_format=torch.contiguous_format) for _ in range(2))
    planes = [tensor[:, 0] for tensor in (width, tolerance, light, variance)]
    if form_of(light, cuda=True) is Form.CUDA:
        limits_each(light.numel(), *planes, sigma, sensitivity, phi_color)
    else:
        limits_rows(*map(array, planes), sigma, sensitivity, phi_color, threads())
    return width, tolerance


@limits_cpu.register_fake
def _(light, variance, sigma, sensitivity, phi_color):
    return tuple(torch.empty_like(light, memory_format=torch.contiguous_format) for _ in range(2))


def moments(
    light: Tensor, geometry: Surface, *, radius: int = 1, depth_sensitivity: float = 1.0, compiled: bool | None = None
) -> Tensor:
    """Mean and variance over the pixels around that lie on the same surface.

    Args:
        light: ``(B, 1, H, W)``, any unit.
        geometry: of the same size.
        radius: 1 for 3x3, 2 for 5x5, 3 for SVGF's 7x7.
        depth_sensitivity: see `edges.edge_weight`.
        compiled: see `gbufrt.compute.dispatch.form_of`.

    Returns:
        ``(B, 2, H, W)``: mean and unbiased variance; a pixel alone on its surface has variance zero.
    """
    planes = (light, geometry.guide, geometry.plane)
    if form_of(*planes, depth_sensitivity, compiled=compiled, cuda=True) is Form.REFERENCE:
        return moments_reference(light, geometry, radius, depth_sensitivity)
    return moments_cpu(*planes, radius, geometry.perspective, float(depth_sensitivity))


def spatial_moments(
    signal: Tensor, geometry: Surface, *, radius: int = 1, lead: int | None = None, depth_sensitivity: float = 1.0
) -> tuple[Tensor, Tensor]:
    """`moments` of the luminance of a signal ``(B, C, H, W)``, whose first ``lead`` channels make it."""
    found = moments(luminance(signal, lead), geometry, radius=radius, depth_sensitivity=depth_sensitivity)
    return found[:, :1], found[:, 1:]


def wavelet(
    values: Tensor,
    geometry: Surface,
    reach: Tensor | None = None,
    *,
    step: int,
    phi_color: float,
    phi_depth: float,
    phi_normal: float,
    compiled: bool | None = None,
) -> Tensor:
    """One 5x5 B-spline kernel with holes, weighted by geometry and by luminance in standard deviations of its noise.

    Args:
        values: ``(B, C + 2, H, W)``: a signal, then the luminance that is compared, then the signal's variance.
        geometry: of the same size.
        reach: ``(B, 1, H or 1, W)``: 1 / (2 sigma^2) of a spatial Gaussian in pixels; by default there is none.
        step: pixels from tap to tap.
        phi_color: see `post.atrous`, as the rest.
        compiled: see `gbufrt.compute.dispatch.form_of`.

    Returns:
        As ``values``, filtered; the variance is that which is left. Pixels that hit nothing are as before.
    """
    reach = torch.zeros_like(values[:, :1, :1]) if reach is None else reach  # one row stands for all
    phi, planes = (phi_color, phi_depth, phi_normal), (values, geometry.guide, geometry.plane, reach)
    if form_of(*planes, *phi, compiled=compiled, cuda=fits_cuda(values)) is Form.REFERENCE:
        return wavelet_reference(values, geometry, reach, step, *phi)
    return wavelet_cpu(*planes, step, geometry.perspective, *map(float, phi))


def bilateral_limits(
    light: Tensor,
    variance: Tensor,
    *,
    sigma: float,
    sensitivity: float,
    phi_color: float,
    compiled: bool | None = None,
) -> tuple[Tensor, Tensor]:
    """How far `joint_bilateral` reaches, and what differences it takes for noise.

    Args:
        light: ``(B, 1, H, W)``: mean luminance.
        variance: ``(B, 1, H, W)``: of single pixels' luminance.
        sigma: widest standard deviation of the spatial Gaussian, pixels.
        sensitivity: the Gaussian is widest where this times the relative noise reaches one.
        phi_color: difference between 3x3 means, in their standard deviations, up to which a tap counts in full.
        compiled: see `gbufrt.compute.dispatch.form_of`.

    Returns:
        ``width`` and ``tolerance`` of `joint_bilateral`.
    """
    tunables = (sigma, sensitivity, phi_color)
    if form_of(light, variance, *tunables, compiled=compiled, cuda=True) is Form.REFERENCE:
        return limits_reference(light, variance, *tunables)
    return limits_cpu(light, variance, *map(float, tunables))


def joint_bilateral(
    values: Tensor,
    geometry: Surface,
    width: Tensor,
    tolerance: Tensor,
    *,
    radius: int,
    depth_sensitivity: float,
    normal_power: float,
    compiled: bool | None = None,
) -> Tensor:
    """One kernel weighted by geometry, distance in the picture, and luminance beyond a tolerance.

    Args:
        values: ``(B, C + 1, H, W)``: a signal, then the luminance that is compared.
        geometry: of the same size.
        width: ``(B, 1, H, W)``: sigma of the spatial Gaussian, pixels; half of it where no neighbour is on the surface.
        tolerance: ``(B, 1, H, W)``: difference in luminance up to which a tap counts in full.
        radius: of the square of taps, pixels.
        depth_sensitivity: see `post.bilateral`, as the rest.
        compiled: see `gbufrt.compute.dispatch.form_of`.

    Returns:
        ``(B, C, H, W)``; pixels that hit nothing are as before.
    """
    edge, planes = (depth_sensitivity, normal_power), (values, geometry.guide, geometry.plane, width, tolerance)
    if form_of(*planes, *edge, compiled=compiled, cuda=fits_cuda(values)) is Form.REFERENCE:
        return bilateral_reference(values, geometry, width, tolerance, radius, *edge)
    return bilateral_cpu(*planes, radius, geometry.perspective, *map(float, edge))
