"""Floors looked down on, and the irradiance that direct light gives them."""

from __future__ import annotations

import math

import torch
from voxels import STONE

from gbufrt import Camera, GBuffer
from tracer.direct.lighting import light
from tracer.scene.scene import Scene

FLOOR = (STONE, (0, 0, 0), (48, 1, 48))


def above(size: tuple[int, int] = (48, 48), *, span: float = 24.0, height: float = 30.0) -> Camera:
    """Looks straight down on the middle of `FLOOR`; picture right is +x, picture down is +z."""
    return Camera.look_at(
        (24.0, height, 24.0), (24.0, 0.0, 24.0), size=size, up=(0.0, 0.0, -1.0), orthographic_height=span
    )


def irradiance(scene: Scene, g: GBuffer, **kw) -> torch.Tensor:
    """Irradiance: the result with albedo and emission taken out."""
    radiance, _ = light(scene, g, **kw)
    assert g.albedo is not None
    assert g.emission is not None
    return (radiance - g.emission) * math.pi / g.albedo.clamp_min(1e-9)
