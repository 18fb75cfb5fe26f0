"""For tests of gradients: frames with smooth pictures, and central differences."""

from __future__ import annotations

import math
from collections.abc import Callable

import boxes
import torch
from torch import Tensor

from gbufrt import Camera, Frame

CORNER = torch.tensor([[[-40.0, -1.0, -40.0], [40.0, 0.0, 40.0]], [[-40.0, -1.0, -9.0], [40.0, 40.0, -4.0]]])
STEP = 1e-4
BEND = 1e-2  # by how much a derivative may change, relative, when the step is halved: more is no smooth place


def waves(channels: int, size: tuple[int, int], seed: int, low: float = 0.2, high: float = 0.8) -> Tensor:
    """``(1, C, H, W)`` float64: a smooth random picture between two values."""
    generator = torch.Generator().manual_seed(seed)
    y, x = torch.meshgrid(*(torch.arange(n, dtype=torch.float64) for n in size), indexing="ij")
    kx, ky, phase = (torch.rand(channels, 4, 1, 1, generator=generator, dtype=torch.float64) for _ in range(3))
    wave = (kx * x * 0.7 + ky * y * 0.7 + 2 * math.pi * phase).sin().mean(1)
    return (low + (high - low) * (0.5 + 0.5 * wave))[None]


def corner(size: tuple[int, int] = (10, 14)) -> Frame:
    """A floor and a wall that fill the picture, with smooth random channels, in float64."""
    camera = Camera.look_at((0.3, 2.5, 5.0), (0.0, 1.0, -4.0), size=size, fov_y=50.0, far=100.0)
    moved = Camera.look_at((0.35, 2.5, 5.02), (0.03, 1.0, -4.0), size=size, fov_y=50.0, far=100.0)
    frame = boxes.frame(camera, previous=moved, boxes=CORNER).to(torch.float64)
    g = frame.gbuffer
    tilted = torch.nn.functional.normalize(g.normal + waves(3, size, 1, -0.3, 0.3), dim=1)
    g = g.replace(
        normal_geo=None,
        motion=waves(2, size, 3, -0.4, 0.4),
        motion_z=None,
        albedo=waves(3, size, 4),
        roughness=waves(1, size, 5, 0.25, 0.6),
        metallic=waves(1, size, 6, 0.3, 0.7),
        emission=None,
        transmittance=None,
        opacity=None,
        object_id=None,
        thickness=waves(1, size, 7, 0.5, 1.0),
    )
    assert bool(g.hit.all())
    signals = {"radiance": 3, "ambient": 3, "gi": 3, "reflection": 3, "composite": 3, "color": 3, "image": 3}
    signals |= {"ao": 1, "sky_visibility": 1, "reflection_confidence": 1, "reflection_distance": 1}
    lit = {name: waves(channels, size, 10 + i) for i, (name, channels) in enumerate(signals.items())}
    return frame.replace(gbuffer=g, bent_normal=tilted, environment=waves(3, (8, 16), 30), **lit)


def derivative(function: Callable[[Tensor], Tensor], at: Tensor, way: Tensor, step: float) -> Tensor:
    """Central difference of every element of ``function(at)`` along ``way``."""
    with torch.no_grad():
        return (function(at + step * way) - function(at - step * way)) / (2 * step)


def compare(function: Callable[[Tensor], Tensor], at: Tensor, *, step: float = STEP, seed: int = 0) -> tuple:
    """Gradient against central differences, along a random direction, where the function is smooth.

    Left out are elements whose difference changes when the step is halved: there the function jumps or bends within a
    step (a ray goes to another pixel, a tap rounds to another, a clamp begins). The gradient has no say in that.

    Returns:
        The derivative by the gradient, by differences (both of one random sum of the smooth elements), the mean size
        of what is summed, the share of elements left in, and the gradient.
    """
    generator = torch.Generator().manual_seed(seed)
    way = torch.randn(at.shape, generator=generator, dtype=torch.float64)
    leaf = at.detach().clone().requires_grad_()
    result = function(leaf)
    coarse, fine = (derivative(function, at, way, s) for s in (step, step / 2))
    scale = coarse.abs().mean()
    smooth = (coarse - fine).abs() <= BEND * (coarse.abs() + 0.1 * scale)
    weight = torch.randn(result.shape, generator=generator, dtype=torch.float64) * smooth
    gradient = (
        torch.autograd.grad((weight * result).sum(), leaf, allow_unused=True)[0] if result.requires_grad else None
    )
    by_gradient = 0.0 if gradient is None else float((gradient * way).sum())
    return (
        by_gradient,
        float((weight * fine).sum()),
        float((weight * fine).norm()),
        float(smooth.double().mean()),
        gradient,
    )
