"""Edge-avoiding wavelets guided by variance: the spatial half of SVGF."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from gbufrt import Camera, Frame, Pass
from gbufrt.demands.pictures import check_sizes
from gbufrt.mending import finite
from gbufrt.numeric import check_between, check_counts, check_kind
from gbufrt.specular import BROAD_ROUGHNESS
from post.filters.op import spatial_moments, wavelet
from post.filters.regression import fitted, with_places
from post.filters.signals import check_lead, guides, signal_names, stack, unstack, wants_albedo
from post.filters.surfaces import surface

REACH = 16.0  # pixels: widest blur of a reflection


def atrous(
    signal: Tensor,
    depth: Tensor,
    normal: Tensor,
    *,
    hit: Tensor,
    camera: Camera,
    iterations: int = 5,
    phi_color: float = 4.0,
    growth: float = 1.0,
    phi_normal: float = 128.0,
    phi_depth: float = 1.0,
    variance: Tensor | None = None,
    roughness: Tensor | None = None,
    confidence: Tensor | None = None,
    lead: int | None = None,
    linear: bool = False,
    unlike: Tensor | None = None,
) -> tuple[Tensor, Tensor]:
    """Denoise by repeated 5x5 B-spline kernels with holes, each twice as wide as the one before.

    A tap counts by its normal, its distance from the pixel's tangent plane, and its difference in luminance measured
    in standard deviations of the noise: noise is averaged, lighting edges are kept. Unlike in SVGF the luminances
    compared are 3x3 means over the surface: single pixels are too noisy to show an edge. So phi_color can be smaller.

    Args:
        signal: ``(B, C, H, W)``, any unit; several signals stacked share one set of weights.
        depth: ``(B, 1, H, W)`` planar view z, world units.
        normal: ``(B, 3, H, W)`` world space, unit length.
        hit: ``(B, 1, H, W)`` bool; pixels without a hit keep their value and are left out of other pixels' kernels.
        camera: the camera of depth.
        iterations: how many kernels; the last has taps 2^(iterations - 1) pixels apart.
        phi_color: difference between 3x3 means of luminance, in their standard deviations, at which a tap counts 1/e.
        growth: of phi_color from kernel to kernel. Neighbours that are filtered share their noise, and their 3x3 mean
            keeps up to three times as much of it as that of the samples does.
        phi_normal: exponent of the cosine between normals.
        phi_depth: sensitivity to plane distance, per pixel footprint.
        variance: ``(B, 1, H, W)`` of the luminance of ``signal``; estimated from 5x5 neighbours where absent.
        roughness: ``(B, 1, H, W)`` for reflections: mirrors stay sharp, different roughnesses do not mix.
        confidence: ``(B, 1, H, W)`` in [0, 1] for reflections: blur more where it is low.
        lead: how many of the first channels make the luminance; all by default.
        linear: fit a plane to the signal instead of taking its mean: gradients of light survive where surfaces end, at
            the price of more noise there. See `post.filters.regression`.
        unlike: ``(B, 1, H, W)`` in [0, 1]: tells surfaces apart as roughness does, a tap counts 1/e for each 0.1, but
            limits no blur; unused where roughness is given.

    Returns:
        The signal ``(B, C, H, W)`` and the variance that is left in it ``(B, 1, H, W)``.

    Raises:
        TypeError: what must be a tensor or a number is none, or kinds of floats are mixed.
        ValueError: iterations lies outside 1 to 8, another number is negative, or sizes disagree.

    Source: Dammertz et al. 2010; Schied et al. 2017 (SVGF), section 4.3 and 4.4.
    """
    check_counts(iterations=iterations)
    check_between(1, 8, iterations=iterations)
    check_between(0, math.inf, phi_color=phi_color, growth=growth, phi_normal=phi_normal, phi_depth=phi_depth)
    check_kind(Tensor, "normal", normal)
    check_kind(Tensor, "hit", hit)
    check_sizes(camera, depth=depth, signal=signal, variance=variance, confidence=confidence)
    check_lead(lead, signal)
    signal, variance = finite(signal), None if variance is None else finite(variance)
    geometry = surface(depth, normal, hit, camera, unlike if roughness is None else roughness)
    if variance is None:
        variance = spatial_moments(signal, geometry, radius=2, lead=lead, depth_sensitivity=phi_depth)[1].clone()
    light = spatial_moments(signal, geometry, lead=lead, depth_sensitivity=phi_depth)[0]  # no view of it is kept
    values = torch.cat([with_places(signal) if linear else signal, light, variance], dim=1)
    before = signal if linear else None
    del signal, light, variance  # a quarter of what the kernels need at once
    reach = reach_of(roughness, confidence)
    for iteration in range(iterations):
        values = wavelet(
            values, geometry, reach, step=2**iteration,
            phi_color=phi_color * growth**iteration, phi_depth=phi_depth, phi_normal=phi_normal,
        )  # fmt: skip
    smooth, left = values[:, :-2], values[:, -1:].clone()  # a view that is kept would keep all channels
    if before is not None:
        smooth = torch.where(hit, fitted(smooth, left, lead), before)
    return smooth, left


def reach_of(roughness: Tensor | None, confidence: Tensor | None) -> Tensor | None:
    """``(B, 1, H, W)`` 1 / (2 sigma^2) of the widest blur in pixels; None, no limit, for all but reflections."""
    if roughness is None:
        return None
    sigma = REACH * (roughness / BROAD_ROUGHNESS).clamp(1e-3, 1.0)
    if confidence is not None:
        sigma = sigma * (1.5 - 0.5 * confidence.clamp(0.0, 1.0))
    return 0.5 / (sigma * sigma)


class Atrous(Pass):
    """Denoise one signal, or several with one set of weights. See `atrous`.

    Reads ``<signal>_variance``, which `post.Temporal` leaves, and writes what is left of it.

    Args:
        signal: name of a signal, or several; the first leads.
        iterations: see `atrous`, as the rest.
        demodulate: divide albedo out first; by default for ``gi``.
    """

    def __init__(
        self,
        *,
        signal: str | tuple[str, ...] = "gi",
        iterations: int = 5,
        phi_color: float = 4.0,
        phi_normal: float = 128.0,
        phi_depth: float = 1.0,
        demodulate: bool | None = None,
    ) -> None:
        super().__init__()
        self.signal = signal
        self.iterations = iterations
        self.phi_color = phi_color
        self.phi_normal = phi_normal
        self.phi_depth = phi_depth
        self.demodulate = demodulate
        names = signal_names(signal)
        self.reads = frozenset({"depth", "normal", "hit", names[0]})
        self.optional = frozenset({*names[1:], f"{names[0]}_variance", "albedo", "roughness"})
        self.writes = frozenset({*names, f"{names[0]}_variance"})

    def forward(self, frame: Frame) -> Frame:
        g, names = frame.gbuffer, signal_names(self.signal)
        divide, known = wants_albedo(names, self.demodulate), guides(frame, names)
        filtered, left = atrous(  # without **, which would keep the signals as they are stacked
            stack(frame, names, demodulate=divide), g.depth, g.normal, hit=g.hit, camera=g.camera,
            iterations=self.iterations, phi_color=self.phi_color, phi_normal=self.phi_normal,
            phi_depth=self.phi_depth, lead=known["lead"], variance=known["variance"], roughness=known["roughness"],
            confidence=known["confidence"],
        )  # fmt: skip
        return unstack(frame, names, filtered, demodulate=divide).write(f"{names[0]}_variance", left)
