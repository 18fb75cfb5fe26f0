"""Joint bilateral denoise: one edge-aware kernel whose width follows the noise."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt import Camera, Frame, Pass
from gbufrt.compute.fusion import fusible
from gbufrt.specular import BROAD_ROUGHNESS
from post.filters.edges import MIN_MEAN, blurred, edge_weight, offsets, padded, spatial_moments, surface, windows
from post.filters.signals import guides, signal_names, stack, unstack, wants_albedo

MIN_CONTRAST = 0.01  # of the local luminance: smaller differences are no edge
NARROWEST = 0.4  # of sigma, where there is no noise
AT_EDGES = 0.5  # of sigma, where no neighbour is on the same surface
LOBE = 1.5  # tangents of a lobe's spread, alpha, by which it may be blurred


def bilateral(
    signal: Tensor,
    depth: Tensor,
    normal: Tensor,
    *,
    hit: Tensor,
    camera: Camera,
    radius: int = 4,
    sigma: float = 4.0,
    depth_sensitivity: float = 1.0,
    normal_power: float = 32.0,
    variance_sensitivity: float = 5.0,
    phi_color: float = 2.5,
    variance: Tensor | None = None,
    roughness: Tensor | None = None,
    confidence: Tensor | None = None,
    distance: Tensor | None = None,
    lead: int | None = None,
) -> Tensor:
    """Denoise a signal with one joint bilateral kernel: depth exp(-s d), normal dot^p, spatial Gaussian.

    d is the distance from the pixel's tangent plane in pixel footprints, so slanted floors are not cut and the weight
    means the same near and far. The Gaussian is wide where the signal is noisy and narrow at edges. A lighting edge is
    where 3x3 means of luminance differ by more than the noise.

    Args:
        signal: ``(B, C, H, W)``, any unit; several signals stacked share one set of weights.
        depth: ``(B, 1, H, W)`` planar view z, world units.
        normal: ``(B, 3, H, W)`` world space, unit length.
        hit: ``(B, 1, H, W)`` bool; pixels without a hit keep their value and are left out of other pixels' kernels.
        camera: the camera of depth.
        radius: of the square of taps, pixels.
        sigma: widest standard deviation of the spatial Gaussian, pixels.
        depth_sensitivity: s, per pixel footprint.
        normal_power: p.
        variance_sensitivity: the Gaussian is widest where this times the relative noise reaches one.
        phi_color: difference between 3x3 means of luminance, in their standard deviations, up to which a tap counts
            in full.
        variance: ``(B, 1, H, W)`` of the luminance of ``signal``; estimated from 3x3 neighbours where absent.
        roughness: ``(B, 1, H, W)`` for reflections: mirrors stay sharp, different roughnesses do not mix.
        confidence: ``(B, 1, H, W)`` in [0, 1] for reflections: blur more where it is low.
        distance: ``(B, 1, H, W)`` world units to the reflected hit, with ``roughness``: blur no more than the lobe does
            over that distance, so that reflections are sharp at contact.
        lead: how many of the first channels make the luminance; all by default.

    Returns:
        ``(B, C, H, W)``.

    Raises:
        ValueError: radius is below 1 or sigma not positive, or sizes disagree.

    Source: Tomasi and Manduchi 1998; Petschnigg et al. 2004 (joint bilateral); plane distance as in Schied et al. 2017;
    blur by the lobe and the distance of the reflected hit as in NVIDIA's ReBLUR (Zhdan 2021).
    """
    if radius < 1 or sigma <= 0:
        raise ValueError(f"radius must be at least 1 and sigma positive, got radius={radius}, sigma={sigma}")
    geometry = surface(depth, normal, hit, camera, roughness)
    local, spread = spatial_moments(signal, geometry, lead=lead, depth_sensitivity=depth_sensitivity)
    variance = spread if variance is None else variance
    noise = variance.clamp_min(1e-12).sqrt() / local.abs().clamp_min(MIN_MEAN)
    width = sigma * (NARROWEST + (1 - NARROWEST) * (variance_sensitivity * noise).clamp_max(1.0))
    if roughness is not None:
        width = width * (roughness / BROAD_ROUGHNESS).clamp(1e-3, 1.0)
    if confidence is not None:
        width = width * (1.5 - 0.5 * confidence.clamp(0.0, 1.0))
    if roughness is not None and distance is not None:
        lobe = LOBE * roughness.square() * distance * camera.pixels_per_unit(depth + distance)
        width = torch.minimum(width, lobe.clamp_min(1e-3))
    noise_of_mean = blurred(variance).clamp_min(0.0).add(1e-12).sqrt() / 3  # nine pixels
    tolerance = phi_color * noise_of_mean + MIN_CONTRAST * local.abs()
    edge = (geometry.perspective, depth_sensitivity, normal_power)
    width = width * (AT_EDGES + (1 - AT_EDGES) * _open_share(geometry.guide, geometry.plane, *edge))
    falloff = -0.5 / (width * width)
    values, guide = padded(torch.cat([signal, local], dim=1), radius), padded(geometry.guide, radius)
    sums = torch.cat([torch.zeros_like(signal), torch.zeros_like(local)], dim=1)
    for dy in range(-radius, radius + 1):  # one compiled row serves all rows, and compiles in a tenth of the time
        rows = slice(radius + dy, radius + dy + depth.shape[-2])
        sums = _add_row(
            sums, values[..., rows, :], guide[..., rows, :], local, geometry.guide, geometry.scaled(1, dy),
            falloff, torch.exp(falloff * dy * dy), tolerance, radius, *edge,
        )  # fmt: skip
    return torch.where(hit, sums[:, :-1] / sums[:, -1:].clamp_min(1e-6), signal)


@fusible
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
            center,
            guide,
            plane,
            dx,
            1,
            perspective=perspective,
            depth_sensitivity=depth_sensitivity,
            normal_power=normal_power,
        )
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
                guide,
                tap,
                plane,
                dx,
                dy,
                perspective=perspective,
                depth_sensitivity=depth_sensitivity,
                normal_power=normal_power,
            )
    return total[:, None] / 4


class Bilateral(Pass):
    """Denoise one signal, or several with one set of weights. See `bilateral`.

    Reads ``<signal>_variance`` where a pass has left it. The confidence of a reflection is filtered with it.

    Args:
        signal: name of a signal, or several; the first leads.
        radius: see `bilateral`, as the rest.
        demodulate: divide albedo out first; by default for ``gi``.
    """

    def __init__(
        self,
        *,
        signal: str | tuple[str, ...] = "ao",
        radius: int = 4,
        sigma: float = 4.0,
        depth_sensitivity: float = 1.0,
        normal_power: float = 32.0,
        variance_sensitivity: float = 5.0,
        phi_color: float = 2.5,
        demodulate: bool | None = None,
    ) -> None:
        super().__init__()
        self.signal = signal
        self.radius = radius
        self.sigma = sigma
        self.depth_sensitivity = depth_sensitivity
        self.normal_power = normal_power
        self.variance_sensitivity = variance_sensitivity
        self.phi_color = phi_color
        self.demodulate = demodulate
        names = signal_names(signal)
        self.reads = frozenset({"depth", "normal", "hit", names[0]})
        self.optional = frozenset({*names[1:], f"{names[0]}_variance", "albedo", "roughness"})
        if names[0] == "reflection":
            self.optional |= {"reflection_distance"}
        self.writes = frozenset(names)

    def forward(self, frame: Frame) -> Frame:
        g, names = frame.gbuffer, signal_names(self.signal)
        divide = wants_albedo(names, self.demodulate)
        filtered = bilateral(
            stack(frame, names, demodulate=divide), g.depth, g.normal, hit=g.hit, camera=g.camera,
            radius=self.radius, sigma=self.sigma, depth_sensitivity=self.depth_sensitivity,
            normal_power=self.normal_power, variance_sensitivity=self.variance_sensitivity,
            phi_color=self.phi_color, distance=frame.reflection_distance if names[0] == "reflection" else None,
            **guides(frame, names),
        )  # fmt: skip
        return unstack(frame, names, filtered, demodulate=divide)
