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
BEND = 1e-2  # largest relative change of a derivative when the step is halved; above it the function is not smooth


def waves(channels: int, size: tuple[int, int], seed: int, low: float = 0.2, high: float = 0.8) -> Tensor:
    """``(1, C, H, W)`` float64: a smooth random picture between two values."""
    generator = torch.Generator().manual_seed(seed)
    y, x = torch.meshgrid(*(torch.arange(n, dtype=torch.float64) for n in size), indexing="ij")
    kx, ky, phase = (torch.rand(channels, 4, 1, 1, generator=generator, dtype=torch.float64) for _ in range(3))
    wave = (kx * x * 0.7 + ky * y * 0.7 + 2 * math.pi * phase).sin().mean(1)
    return (low + (high - low) * (0.5 + 0.5 * wave))[None]


def corner(size: tuple[int, int] = (10, 14), *, uneven: bool = True) -> Frame:
    """A floor and a wall that fill the picture, with smooth random channels, in float64.

    ``uneven`` bends surfaces a little: filters have a kink where neighbours lie in exactly one plane. Ray marching
    needs flat ones: bent surfaces have cracks between their pieces, where hits stay at the border of a pixel.
    """
    camera = Camera.look_at((0.3, 2.5, 5.0), (0.0, 1.0, -4.0), size=size, fov_y=50.0, far=100.0)
    moved = Camera.look_at((0.35, 2.5, 5.02), (0.03, 1.0, -4.0), size=size, fov_y=50.0, far=100.0)
    frame = boxes.frame(camera, previous=moved, boxes=CORNER).to(torch.float64)
    g = frame.gbuffer
    tilted = torch.nn.functional.normalize(g.normal + waves(3, size, 1, -0.3, 0.3), dim=1)
    if uneven:
        bent = torch.nn.functional.normalize(g.normal + waves(3, size, 8, -0.1, 0.1), dim=1)
        g = g.replace(depth=g.depth * waves(1, size, 2, 0.995, 1.005), normal=bent)
    channels = {"motion": 2, "albedo": 3, "roughness": 1, "metallic": 1, "thickness": 1}
    values = {name: waves(count, size, 3 + i, 0.25, 0.75) for i, (name, count) in enumerate(channels.items())}
    absent = dict.fromkeys(("normal_geo", "motion_z", "emission", "transmittance", "opacity", "object_id"))
    g = g.replace(**values, **absent)
    signals = {"radiance": 3, "ambient": 3, "gi": 3, "reflection": 3, "composite": 3, "color": 3, "image": 3}
    signals |= {"ao": 1, "sky_visibility": 1, "reflection_confidence": 1, "reflection_distance": 1}
    signals |= {"diffuse": 3, "specular": 3, "replayed_diffuse": 3, "replayed_specular": 3, "replayed": 1}
    lit = {name: waves(count, size, 10 + i) for i, (name, count) in enumerate(signals.items())}
    few = (-(-size[0] // 2), -(-size[1] // 2))
    lit |= {"fog_light": waves(3, few, 31), "fog_transmittance": waves(1, size, 32)}
    return frame.replace(gbuffer=g, bent_normal=tilted, environment=waves(3, (8, 16), 30), **lit)


def derivative(function: Callable[[Tensor], Tensor], at: Tensor, way: Tensor, step: float) -> Tensor:
    """Central difference of every element of ``function(at)`` along ``way``, with gradients enabled."""
    ahead, behind = (function((at + s * way).requires_grad_()).detach() for s in (step, -step))
    return (ahead - behind) / (2 * step)


def compare(
    function: Callable[[Tensor], Tensor], at: Tensor, *, step: float = STEP, groups: int = 3, seed: int = 0
) -> tuple[Tensor, Tensor]:
    """Gradient against central differences, along a random direction, where the function is smooth.

    Elements whose difference changes when the step is halved are left out: there the function jumps or bends within a
    step (a ray goes to another pixel, a tap rounds to another, a clamp begins), which a gradient cannot tell.

    Returns:
        For each group of smooth elements, added up at random, the derivative by the gradient and by differences, over
        the size of what is added up: ``(groups,)`` each.
    """
    generator = torch.Generator().manual_seed(seed)
    way = torch.randn(at.shape, generator=generator, dtype=torch.float64)
    leaf = at.detach().clone().requires_grad_()
    result = function(leaf)
    coarse, fine = (derivative(function, at, way, s) for s in (step, step / 2))
    smooth = (coarse - fine).abs() <= BEND * (coarse.abs() + 0.1 * coarse.abs().mean())
    assert float(smooth.double().mean()) > 0.8, "most of the function must be smooth, or nothing is tested"
    which = torch.randint(groups, result.shape, generator=generator)
    found = []
    for group in range(groups):
        weight = torch.randn(result.shape, generator=generator, dtype=torch.float64) * smooth * (which == group)
        gradient = torch.autograd.grad((weight * result).sum(), leaf, retain_graph=True)[0]
        assert bool(torch.isfinite(gradient).all())
        size = (weight * fine).norm().clamp_min(1e-12)
        found.append(torch.stack([(gradient * way).sum(), (weight * fine).sum()]) / size)
    return torch.stack([a for a, _ in found]), torch.stack([b for _, b in found])
