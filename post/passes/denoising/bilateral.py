"""Joint bilateral denoise: one edge-aware kernel whose width follows the noise."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from gbufrt import Camera, Frame, Pass
from gbufrt.demands.pictures import check_sizes
from gbufrt.mending import finite
from gbufrt.numeric import check_between, check_counts, check_kind, check_numbers
from gbufrt.specular import BROAD_ROUGHNESS
from post.filters.op import bilateral_limits, joint_bilateral, spatial_moments
from post.filters.signals import check_lead, guides, signal_names, stack, unstack, wants_albedo
from post.filters.surfaces import surface

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
        depth_sensitivity: s of the depth weight, per pixel footprint.
        normal_power: p of the normal weight.
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
        TypeError: what must be a tensor or a number is none, or kinds of floats are mixed.
        ValueError: radius is below 1, sigma not positive or another number negative, or sizes disagree.

    Source: Tomasi and Manduchi 1998; Petschnigg et al. 2004 (joint bilateral); plane distance as in Schied et al. 2017;
    blur by the lobe and the distance of the reflected hit as in NVIDIA's ReBLUR (Zhdan 2021).
    """
    check_counts(radius=radius)
    check_numbers(sigma=sigma)
    if radius < 1 or not sigma > 0:
        raise ValueError(f"radius must be at least 1 and sigma positive, got radius={radius}, sigma={sigma}")
    powers = {"normal_power": normal_power, "variance_sensitivity": variance_sensitivity, "phi_color": phi_color}
    check_between(0, math.inf, depth_sensitivity=depth_sensitivity, **powers)
    check_kind(Tensor, "normal", normal)
    check_kind(Tensor, "hit", hit)
    check_sizes(camera, depth=depth, signal=signal, variance=variance, confidence=confidence, distance=distance)
    check_lead(lead, signal)
    signal, variance = finite(signal), None if variance is None else finite(variance)
    geometry = surface(depth, normal, hit, camera, roughness)
    local, spread = spatial_moments(signal, geometry, lead=lead, depth_sensitivity=depth_sensitivity)
    variance = spread if variance is None else variance
    values = torch.cat([signal, local], dim=1)
    del signal, spread  # what is let go of here and below is a third of what the kernel needs at once
    width, tolerance = bilateral_limits(
        local, variance, sigma=sigma, sensitivity=variance_sensitivity, phi_color=phi_color
    )
    del local, variance
    if roughness is not None:
        width = width * (roughness / BROAD_ROUGHNESS).clamp(1e-3, 1.0)
    if confidence is not None:
        width = width * (1.5 - 0.5 * confidence.clamp(0.0, 1.0))
    if roughness is not None and distance is not None:
        lobe = LOBE * roughness.square() * distance * camera.pixels_per_unit(depth + distance)
        width = torch.minimum(width, lobe.clamp_min(1e-3))
        del lobe
    return joint_bilateral(
        values, geometry, width, tolerance,
        radius=radius, depth_sensitivity=depth_sensitivity, normal_power=normal_power,
    )  # fmt: skip


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
        divide, known = wants_albedo(names, self.demodulate), guides(frame, names)
        filtered = bilateral(  # without **, which would keep the signals as they are stacked
            stack(frame, names, demodulate=divide), g.depth, g.normal, hit=g.hit, camera=g.camera,
            radius=self.radius, sigma=self.sigma, depth_sensitivity=self.depth_sensitivity,
            normal_power=self.normal_power, variance_sensitivity=self.variance_sensitivity,
            phi_color=self.phi_color, distance=frame.reflection_distance if names[0] == "reflection" else None,
            lead=known["lead"], variance=known["variance"], roughness=known["roughness"],
            confidence=known["confidence"],
        )  # fmt: skip
        return unstack(frame, names, filtered, demodulate=divide)
