"""What is looked up while light is gathered along a ray: transmittance to space, and light scattered many times.

Source: Bruneton and Neyret 2008, for both tables.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from gbufrt.atmosphere.medium import Atmosphere
from gbufrt.atmosphere.scales import SUN_RADIUS, azimuth_place, rise_place, sun_place
from gbufrt.sampling import sample_table

DTYPE = torch.float64


@dataclass(frozen=True, eq=False)
class Tables:
    """Of an atmosphere, on one device, for a sun of unit irradiance.

    Args:
        atmosphere: whose.
        transmittance: ``(heights, directions, 3)`` from a height, in a direction, to space.
        again: ``(suns, heights, cosines, azimuths, 6)`` logarithms of the radiance that molecules, and aerosols, send
            in a direction, of the light that is scattered already; None while it is made.
        arriving: ``(suns, 3)`` logarithms of the irradiance of the ground by the sky; likewise.
    """

    atmosphere: Atmosphere
    transmittance: Tensor
    again: Tensor | None = None
    arriving: Tensor | None = None

    def to_space(self, height: Tensor, cosine: Tensor) -> Tensor:
        """``(..., 3)`` transmittance of rays that do not meet the ground."""
        air = self.atmosphere
        rho, whole = to_horizon(air, height), to_horizon(air, height.new_tensor(air.thickness))
        least = air.thickness - height
        column = (air.to_top(height, cosine) - least) / (rho + whole - least)
        return sample_table(self.transmittance, [rho / whole, column])

    def to_sun(self, height: Tensor, cosine: Tensor) -> Tensor:
        """``(..., 3)`` share of the sun's light that arrives, 0 where the ground hides its disc."""
        horizon = -to_horizon(self.atmosphere, height) / (self.atmosphere.radius + height)
        shown = ((cosine - horizon) / (2 * SUN_RADIUS) + 0.5).clamp(0.0, 1.0)
        shown = shown * shown * (3 - 2 * shown)
        return self.to_space(height, torch.maximum(cosine, horizon)) * shown[..., None]

    def to_ground(self, sun: Tensor) -> Tensor:
        """``(..., 3)`` irradiance of the ground."""
        direct = self.to_sun(torch.zeros_like(sun), sun) * sun.clamp_min(0.0)[..., None]
        return direct if self.arriving is None else direct + sample_table(self.arriving, [sun_place(sun)]).exp()

    def scattered_again(self, height: Tensor, sun: Tensor, up: Tensor, between: Tensor) -> tuple[Tensor, Tensor]:
        """Radiance, ``(..., 3)`` each, that molecules and aerosols send back along a ray, out of light from all sides.

        Args:
            height: ``(...)`` kilometres.
            sun: cosine between the sun and the zenith.
            up: between the ray and the zenith.
            between: between the ray and the sun.
        """
        assert self.again is not None
        flat = ((1 - up * up) * (1 - sun * sun)).clamp_min(1e-12).sqrt()
        azimuth = azimuth_place(((between - up * sun) / flat).clamp(-1.0, 1.0))
        row = (height / self.atmosphere.thickness).clamp(0.0, 1.0).sqrt()
        sent = sample_table(self.again, [sun_place(sun), row, rise_place(up), azimuth]).exp()
        return sent[..., :3], sent[..., 3:]


def to_horizon(air: Atmosphere, height: Tensor) -> Tensor:
    """Distance to the horizon, kilometres."""
    return (height * (2 * air.radius + height)).clamp_min(0.0).sqrt()
