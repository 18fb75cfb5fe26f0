"""Aerial perspective: far surfaces fade into the light of the air before them."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from gbufrt import Camera, Frame, Pass
from gbufrt.atmosphere import Atmosphere, air_before
from gbufrt.demands.pictures import check_pictures
from gbufrt.directions import length
from gbufrt.numeric import check_kind, check_numbers, check_three


def aerial_perspective(
    color: Tensor,
    depth: Tensor,
    hit: Tensor,
    camera: Camera,
    *,
    sun: Sequence[float] = (0.45, 0.65, 0.35),
    irradiance: Sequence[float] = (3.4, 3.4, 3.4),
    unit: float | Tensor = 0.001,
    height: float = 0.05,
    atmosphere: Atmosphere | None = None,
) -> Tensor:
    """Put lit air between the camera and surfaces; the sky, which holds its air already, stays.

    Args:
        color: ``(B, 3, H, W)`` linear radiance.
        depth: ``(B, 1, H, W)`` planar view z, world units.
        hit: ``(B, 1, H, W)`` bool.
        camera: of the picture.
        sun: direction toward the sun, world space.
        irradiance: of the sun above the air, linear RGB.
        unit: kilometres a world unit; with more than there are, a small world looks large.
        height: of the camera above sea level, kilometres.
        atmosphere: the air; Earth's by default.

    Returns:
        ``(B, 3, H, W)``.

    Raises:
        TypeError: what must be a tensor or a number is none, or kinds of floats are mixed.
        ValueError: a picture has another shape, ``sun`` has no length, ``unit`` is negative, or ``height`` is outside
            the air.

    Source: Hillaire 2020, 5.4. No shadows fall through the air.
    """
    check_pictures(camera, color=color, depth=depth, hit=hit)
    check_numbers(unit=unit, height=height)
    check_three("sun", sun, "the air")
    check_three("irradiance", irradiance, "the air")
    if atmosphere is not None:
        check_kind(Atmosphere, "atmosphere", atmosphere)
    kilometres = float(unit.detach() if isinstance(unit, Tensor) else unit)
    if not kilometres >= 0:
        raise ValueError(f"unit must be at least 0 kilometres, got {kilometres}")
    origins, directions = (part.permute(0, 3, 1, 2) for part in camera.rays())
    points = camera.to_world(camera.unproject(torch.where(hit, depth, 1.0)))
    distance = torch.where(hit, length(points - origins), 0.0) * unit
    light, clear = air_before(atmosphere or Atmosphere(), sun, directions, distance, height=height)
    lit = light * light.new_tensor(list(irradiance)).view(1, 3, 1, 1)
    return torch.where(hit, color * clear + lit, color)


class AerialPerspective(Pass):
    """See `aerial_perspective`."""

    reads = frozenset({"color", "depth", "hit"})
    writes = frozenset({"color"})

    def __init__(
        self,
        *,
        sun: Sequence[float] = (0.45, 0.65, 0.35),
        irradiance: Sequence[float] = (3.4, 3.4, 3.4),
        unit: float | Tensor = 0.001,
        height: float = 0.05,
        atmosphere: Atmosphere | None = None,
    ) -> None:
        super().__init__()
        self.sun, self.irradiance, self.unit, self.height = sun, irradiance, unit, height
        self.atmosphere = atmosphere

    def forward(self, frame: Frame) -> Frame:
        g = frame.gbuffer
        changed = aerial_perspective(frame.read("color"), g.depth, g.hit, g.camera, **self.tunables())
        return frame.replace(color=changed)
