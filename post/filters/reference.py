"""The edge-aware filters in torch: the definition of `post.filters.op`, with its gradients."""

from __future__ import annotations

import math
from collections.abc import Sequence

import torch
from torch import Tensor

from post.filters.constants import AT_EDGES, B3, COARSE_POWER, FLOOR, MIN_CONTRAST, MIN_MEAN, NARROWEST
from post.filters.edges import Surface, blurred, edge_weight, offsets, padded, windows


def moments_reference(light: Tensor, geometry: Surface, radius: int, depth_sensitivity: float) -> Tensor:
    """``(B, 2, H, W)``. Arguments and result are those of `post.filters.op.moments`."""
    planes, guide = padded(light, radius), padded(geometry.guide, radius)
    return _moments(planes, guide, geometry.plane, radius, geometry.perspective, depth_sensitivity)


def _moments(
    light: Tensor, guide: Tensor, plane: Tensor, radius: int, perspective: bool, depth_sensitivity: float
) -> Tensor:
    values, guides = windows(light, radius), windows(guide, radius)
    center = guides[len(guides) // 2]
    pivot = values[len(values) // 2][:, 0]  # moments about the centre's value keep their precision
    total, first, second = torch.zeros_like(pivot), torch.zeros_like(pivot), torch.zeros_like(pivot)
    for (dy, dx), value, tap in zip(offsets(radius), values, guides, strict=True):
        weight = edge_weight(
            center, tap, plane, dx, dy,
            perspective=perspective, depth_sensitivity=depth_sensitivity, normal_power=COARSE_POWER,
        )  # fmt: skip
        away = value[:, 0] - pivot
        total, first, second = total + weight, first + weight * away, second + weight * away * away
    total = total.clamp_min(1e-6)
    mean = first / total
    unbiased = total / (total - 1.0).clamp_min(1.0)
    variance = (second / total - mean * mean).clamp_min(0.0) * unbiased
    return torch.stack([mean + pivot, variance], dim=1)


def wavelet_reference(
    values: Tensor,
    geometry: Surface,
    reach: Tensor,
    step: int,
    phi_color: float,
    phi_depth: float,
    phi_normal: float,
) -> Tensor:
    """``(B, C + 2, H, W)``. Arguments and result are those of `post.filters.op.wavelet`."""
    light, variance = values[:, -2:-1], values[:, -1:]
    spread = variance.detach() if math.isinf(phi_color) else variance  # infinity times no slope would be NaN
    tolerance = phi_color * noise_of_mean(spread) + FLOOR * light.abs()
    filtered = _wavelet(
        windows(padded(values, 2 * step), 2, step),
        windows(padded(geometry.guide, 2 * step), 2, step),
        geometry.scaled(step, step), tolerance, reach * step**2, geometry.perspective, phi_depth, phi_normal,
    )  # fmt: skip
    return torch.where(geometry.hit, filtered, values)


def _wavelet(
    values: Sequence[Tensor],
    surroundings: Sequence[Tensor],
    plane: Tensor,
    tolerance: Tensor,
    reach: Tensor,
    perspective: bool,
    phi_depth: float,
    phi_normal: float,
) -> Tensor:
    middle = len(values) // 2
    here, center = values[middle], surroundings[middle]
    channels = here.shape[1] - 1
    light = here[:, channels - 1]
    total, sums = torch.zeros_like(light), [torch.zeros_like(light) for _ in range(channels)]
    spread = torch.zeros_like(light)
    for (dy, dx), value, guide in zip(offsets(2), values, surroundings, strict=True):
        weight = torch.full_like(light, B3[dy + 2] * B3[dx + 2])
        if dy or dx:
            edge = edge_weight(
                center, guide, plane, dx, dy,
                perspective=perspective, depth_sensitivity=phi_depth, normal_power=phi_normal,
            )  # fmt: skip
            away = (value[:, channels - 1] - light).abs() / tolerance[:, 0] + reach[:, 0] * (dx * dx + dy * dy)
            weight = weight * edge * torch.exp(-away)
        total = total + weight
        sums = [s + weight * value[:, c] for c, s in enumerate(sums)]
        spread = spread + weight * weight * value[:, channels]
    return torch.stack([*(s / total for s in sums), spread / (total * total)], dim=1)


def bilateral_reference(
    values: Tensor,
    geometry: Surface,
    width: Tensor,
    tolerance: Tensor,
    radius: int,
    depth_sensitivity: float,
    normal_power: float,
) -> Tensor:
    """``(B, C, H, W)``. Arguments and result are those of `post.filters.op.joint_bilateral`."""
    edge = (geometry.perspective, depth_sensitivity, normal_power)
    width = width * (AT_EDGES + (1 - AT_EDGES) * _open_share(geometry.guide, geometry.plane, *edge))
    falloff, signal, local = -0.5 / (width * width), values[:, :-1], values[:, -1:]
    planes, guide, sums = padded(values, radius), padded(geometry.guide, radius), torch.zeros_like(values)
    for dy in range(-radius, radius + 1):
        rows = slice(radius + dy, radius + dy + values.shape[-2])
        sums = _add_row(
            sums, planes[..., rows, :], guide[..., rows, :], local, geometry.guide, geometry.scaled(1, dy),
            falloff, torch.exp(falloff * dy * dy), tolerance, radius, *edge,
        )  # fmt: skip
    return torch.where(geometry.hit, sums[:, :-1] / sums[:, -1:].clamp_min(1e-6), signal)


def _add_row(
    sums: Tensor,
    values: Tensor,
    guides: Tensor,
    local: Tensor,
    center: Tensor,
    plane: Tensor,
    falloff: Tensor,
    row_share: Tensor,
    tolerance: Tensor,
    radius: int,
    perspective: bool,
    depth_sensitivity: float,
    normal_power: float,
) -> Tensor:
    """Add one row of taps: the weighted signals, and in the last plane the weights."""
    last, size = sums.shape[1] - 1, sums.shape[-1]
    planes = [sums[:, c] for c in range(last + 1)]
    for dx in range(-radius, radius + 1):
        columns = slice(radius + dx, radius + dx + size)
        value, guide = values[..., columns], guides[..., columns]
        alike = edge_weight(
            center, guide, plane, dx, 1,
            perspective=perspective, depth_sensitivity=depth_sensitivity, normal_power=normal_power,
        )  # fmt: skip
        unlike = (((value[:, last] - local[:, 0]) / tolerance[:, 0]) ** 2 - 1.0).clamp_min(0.0)
        weight = row_share[:, 0] * alike * torch.exp(falloff[:, 0] * (dx * dx) - unlike)
        planes = [planes[c] + weight * value[:, c] for c in range(last)] + [planes[last] + weight]
    return torch.stack(planes, dim=1)


def _open_share(
    guide: Tensor, plane: Tensor, perspective: bool, depth_sensitivity: float, normal_power: float
) -> Tensor:
    """Share of the four neighbours that lie on the same surface."""
    taps = windows(padded(guide, 1), 1)
    total = torch.zeros_like(guide[:, 0])
    for (dy, dx), tap in zip(offsets(1), taps, strict=True):
        if abs(dx) + abs(dy) == 1:
            total = total + edge_weight(
                guide, tap, plane, dx, dy,
                perspective=perspective, depth_sensitivity=depth_sensitivity, normal_power=normal_power,
            )  # fmt: skip
    return total[:, None] / 4


def limits_reference(
    light: Tensor, variance: Tensor, sigma: float, sensitivity: float, phi_color: float
) -> tuple[Tensor, Tensor]:
    """Arguments and result are those of `post.filters.op.bilateral_limits`."""
    noise = variance.clamp_min(1e-12).sqrt() / light.abs().clamp_min(MIN_MEAN)
    width = sigma * (NARROWEST + (1 - NARROWEST) * (sensitivity * noise).clamp_max(1.0))
    return width, phi_color * noise_of_mean(variance) + MIN_CONTRAST * light.abs()


def noise_of_mean(variance: Tensor) -> Tensor:
    """Standard deviation of a 3x3 mean of samples with this variance."""
    return blurred(variance).clamp_min(0.0).add(1e-12).sqrt() / 3
