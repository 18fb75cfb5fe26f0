"""Directions of reflected rays: GGX visible normals or a cone, and reuse of neighbours' rays."""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import Tensor

from gbufrt import Camera
from gbufrt.directions import length, tangent_frame
from gbufrt.sampling import shifted
from gbufrt.specular import MIRROR_ROUGHNESS, ggx_distribution, masking_ratio, sample_visible_normal, smith_lambda
from post.shading.constants import FILTERED, FULL_SHARE
from post.shading.ggx import grazing, reflection_pdf

CONE_DEGREES = 45.0  # half angle of ME1's cone at roughness 1
SHARP_ALPHA = 1e-2  # below this roughness squared neighbours' rays are not reused
NEIGHBORS = ((1, -2), (-2, -1), (2, 1), (-1, 2), (3, -1), (-1, -3), (1, 3), (-3, 1))


class Surface(NamedTuple):
    """Reflecting surfaces, in view space."""

    points: Tensor
    """``(B, 3, H, W)`` world units."""
    normal: Tensor
    """``(B, 3, H, W)`` unit, facing the eye."""
    geometric: Tensor
    """``(B, 3, H, W)`` unit: no ray may go below it."""
    eye: Tensor
    """``(B, 3, H, W)`` unit, toward the eye."""
    alpha: Tensor
    """``(B, 1, H, W)`` perceptual roughness squared."""
    hit: Tensor
    """``(B, 1, H, W)`` bool."""


class Lobe(NamedTuple):
    """One reflected ray per pixel."""

    direction: Tensor
    """``(B, 3, H, W)`` view space, unit; zero where there is no ray."""
    cosine: Tensor
    """``(B, 1, H, W)`` between light and microfacet, for Fresnel."""
    weight: Tensor
    """``(B, 1, H, W)`` factor on the ray's radiance, without Fresnel."""
    share: Tensor
    """``(B, 1, H, W)`` by which the sum of all samples is divided."""
    pdf: Tensor
    """``(B, 1, H, W)`` per steradian."""
    taken: Tensor
    """``(B, 1, H, W)`` 1 where this sample counts, else 0."""


def dot(a: Tensor, b: Tensor) -> Tensor:
    """``(B, 1, H, W)``."""
    return a[:, 0:1] * b[:, 0:1] + a[:, 1:2] * b[:, 1:2] + a[:, 2:3] * b[:, 2:3]


def unit(a: Tensor) -> Tensor:
    """``a`` at length 1; zero stays zero."""
    return a / length(a)


def surface_of(
    depth: Tensor, hit: Tensor, normal: Tensor, normal_geo: Tensor | None, roughness: Tensor, camera: Camera
) -> Surface:
    """The reflecting surface from G-buffer channels; normals that face away from the eye are bent until edge-on."""
    points = camera.unproject(depth)
    eye = camera.to_eye(points)
    facing = camera.rotate_to_view(normal)
    facing = torch.where(hit, unit(facing + eye * (1e-3 - dot(facing, eye)).clamp_min(0.0)), eye)
    geometric = facing if normal_geo is None else torch.where(hit, camera.rotate_to_view(normal_geo), eye)
    return Surface(points, facing, geometric, eye, roughness * roughness, hit)


def ggx_ray(surface: Surface, u: Tensor, taken: Tensor) -> Lobe:
    """Reflect the eye at a visible microfacet. ``u`` is ``(B, 2, H, W)`` in [0, 1). Source: Heitz 2018."""
    normal, eye, alpha = surface.normal, surface.eye, surface.alpha
    tangent, bitangent = tangent_frame(normal)
    local = torch.cat([dot(eye, tangent), dot(eye, bitangent), dot(eye, normal)], dim=1)
    half = torch.cat(sample_visible_normal(local.split(1, dim=1), alpha, u.split(1, dim=1)), dim=1)
    cosine = dot(local, half).clamp(0.0, 1.0)
    light = 2 * cosine * half - local
    direction = tangent * light[:, 0:1] + bitangent * light[:, 1:2] + normal * light[:, 2:3]
    weight = masking_ratio(local[:, 2:], light[:, 2:], alpha)
    pdf = reflection_pdf(local[:, 2:], half[:, 2:], alpha.clamp_min(1e-3))
    return _above(surface, Lobe(unit(direction), cosine, weight, torch.ones_like(weight), pdf, taken))


def cone_ray(surface: Surface, u: Tensor, taken: Tensor) -> Lobe:
    """A ray within roughness x 45 degrees of the mirror direction, cosine-distributed, weighted by nearness to it.

    Source: ME1 Path Tracing technical overview, reflections.
    """
    cosine = dot(surface.eye, surface.normal)
    axis = unit(2 * cosine * surface.normal - surface.eye)
    tangent, bitangent = tangent_frame(axis)
    widest = (surface.alpha.clamp_min(1e-20).sqrt() * math.radians(CONE_DEGREES)).sin()
    sine, azimuth = u[:, 0:1].sqrt() * widest, 2 * math.pi * u[:, 1:2]
    along = (1 - sine * sine).clamp_min(0.0).sqrt()
    direction = tangent * (sine * azimuth.cos()) + bitangent * (sine * azimuth.sin()) + axis * along
    weight = 1 - u[:, 0:1].sqrt() + 1e-3
    pdf = along / (math.pi * (widest * widest).clamp_min(1e-6))
    lobe = _above(surface, Lobe(unit(direction), cosine.clamp(0, 1), weight, weight, pdf, taken))
    return lobe._replace(share=lobe.weight)


def _above(surface: Surface, lobe: Lobe) -> Lobe:
    """Drop rays that start on the sky, go below the surface, or belong to samples not taken."""
    flies = (lobe.taken > 0) & (dot(lobe.direction, surface.geometric) > 1e-4) & (lobe.weight > 0)
    weight, share = torch.where(flies, lobe.weight, 0.0), lobe.share * lobe.taken
    return lobe._replace(direction=torch.where(flies, lobe.direction, 0.0), weight=weight, share=share)


@torch.no_grad()
def rays_of(surface: Surface, f0: Tensor, roughness: Tensor, samples: int) -> Tensor:
    """``(B, 1, H, W)`` how many rays a pixel takes: one for a mirror, fewer where lobes are broad or reflect little.

    The noise of a pixel is in proportion to the share of light that it reflects, so that rays bring less where that is
    small. What broad lobes show changes little from pixel to pixel: filters take their noise, where they must keep
    edges that nearly smooth surfaces mirror. The number depends on the surface alone: means stay as they are.

    Args:
        surface: the reflecting pixels.
        f0: ``(B, 3, H, W)`` reflectance at normal incidence.
        roughness: ``(B, 1, H, W)`` perceptual.
        samples: where `FULL_SHARE` or more is reflected by a surface smoother than `FILTERED`.

    Source: Lagarde 2011 (Schlick's approximation for rough surfaces).
    """
    highest = f0.amax(1, keepdim=True)
    share = highest + (torch.maximum(1 - roughness, highest) - highest) * grazing(dot(surface.eye, surface.normal))
    part = (share / FULL_SHARE).clamp_max(1.0) * torch.where(roughness < FILTERED, 1.0, torch.full_like(roughness, 0.5))
    rays = (samples * part).ceil().nan_to_num(1.0).clamp_min(1.0)
    return torch.where(roughness < MIRROR_ROUGHNESS, 1.0, rays)


def throughput(lobe: Lobe) -> Tensor:
    """``(B, 3, H, W)``: the share of light reflected is (f0 times the first plus the second) over the third."""
    edge = grazing(lobe.cosine)
    return torch.cat([lobe.weight * (1 - edge), lobe.weight * edge, lobe.share], dim=1)


def reuse_neighbors(surface: Surface, lobe: Lobe, ends: Tensor, incoming: Tensor, count: int) -> tuple[Tensor, Tensor]:
    """Average radiance of a pixel's ray and its neighbours' rays, each weighted by the pixel's BRDF over the ray's pdf.

    Throughput is averaged separately, so that a pixel whose own ray was lost below the surface takes part.

    Args:
        surface: the reflecting pixels.
        lobe: one ray of each.
        ends: ``(B, 4, H, W)`` where rays ended: a view-space point and 1, or for endless rays a direction and 0.
        incoming: ``(B, 3, H, W)`` radiance along the rays.
        count: number of neighbours, up to 8.

    Returns:
        ``(B, 3, H, W)`` incoming radiance and ``(B, 3, H, W)`` `throughput`, as if from ``count + 1`` rays.

    Source: Stachowiak 2015 (ray reuse by ratio estimator).
    """
    total, weights = incoming * lobe.weight, lobe.weight
    alpha, cos_view = surface.alpha.clamp_min(SHARP_ALPHA), dot(surface.normal, surface.eye).clamp(1e-3, 1.0)
    masked = 1 + smith_lambda(cos_view, alpha)
    reflected, members = throughput(lobe), lobe.taken
    near = 0.01 * dot(surface.points, surface.points).sqrt()
    packed = [surface.points, surface.normal, surface.alpha, ends, lobe.pdf, lobe.weight, lobe.taken, reflected]
    packed = torch.cat(packed, dim=1)
    for dx, dy in NEIGHBORS[:count]:
        parts = shifted(packed, dx, dy).split([3, 3, 1, 3, 1, 1, 1, 1, 3], dim=1)
        points, normal, other, end, found, pdf, flies, taken, reflects = parts
        alike = (taken > 0) & (surface.alpha >= SHARP_ALPHA) & ((other - surface.alpha).abs() < 0.1)
        alike &= (dot(surface.normal, normal) > 0.9) & (dot(points - surface.points, surface.normal).abs() < near)
        light = torch.where(found > 0, unit(end - surface.points), end)
        cos_light, half = dot(surface.normal, light), unit(light + surface.eye)
        value = ggx_distribution(dot(surface.normal, half), alpha)
        value = value / (4 * cos_view * (masked + smith_lambda(cos_light, alpha)))
        weight = torch.where(alike & (flies > 0) & (cos_light > 0), value / pdf.clamp_min(1e-6), 0.0)
        reflected, members = reflected + reflects * alike, members + alike
        total, weights = total + weight * shifted(incoming, dx, dy), weights + weight
    return total / weights.clamp_min(1e-9), reflected / members.clamp_min(1)
