"""What an atmosphere is made of, and where a ray in it goes. Lengths are kilometres, heights are above the ground."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import torch
from torch import Tensor

RGB = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class Atmosphere:
    """A layer of air around a ball of ground. The defaults are Earth's, in linear sRGB.

    Args:
        rayleigh: scattering by molecules at the ground, per kilometre.
        rayleigh_height: over which it falls to 1/e, kilometres.
        mie: scattering by aerosols (haze) at the ground, per kilometre.
        mie_absorption: absorption by aerosols, likewise.
        mie_height: over which aerosols fall to 1/e, kilometres.
        mie_asymmetry: Henyey-Greenstein's g of aerosols; toward 1 the glow round the sun is narrow.
        ozone: absorption in the middle of the ozone layer, per kilometre.
        ozone_height: of the middle of that layer, kilometres; it thins out linearly over ``ozone_width`` either way.
        ozone_width: see there.
        ground_albedo: share of light that the ground sends back.
        radius: of the ground, kilometres.
        thickness: height at which the air ends, kilometres.

    Raises:
        ValueError: a number is not finite, negative, or of no possible atmosphere.

    Source: Bruneton and Neyret 2008 for the model; Hillaire 2020, table 1, for the numbers.
    """

    rayleigh: RGB = (0.005802, 0.013558, 0.033100)
    rayleigh_height: float = 8.0
    mie: float = 0.003996
    mie_absorption: float = 0.000444
    mie_height: float = 1.2
    mie_asymmetry: float = 0.8
    ozone: RGB = (0.000650, 0.001881, 0.000085)
    ozone_height: float = 25.0
    ozone_width: float = 15.0
    ground_albedo: float = 0.3
    radius: float = 6360.0
    thickness: float = 100.0

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            numbers = value if isinstance(value, tuple) else (value,)
            if not all(math.isfinite(x) and x >= 0 for x in numbers):
                raise ValueError(f"{field.name} must be finite and not negative, got {value}")
        for name in ("rayleigh_height", "mie_height", "ozone_width", "radius", "thickness"):
            if getattr(self, name) == 0:
                raise ValueError(f"{name} must be above 0 kilometres, got 0")
        for name in ("ground_albedo", "mie_asymmetry"):
            if getattr(self, name) > 1:
                raise ValueError(f"{name} must lie in 0..1, got {getattr(self, name)}")

    def numbers(self) -> tuple[float, ...]:
        """As `gbufrt.atmosphere.kernel` names them."""
        return (
            self.radius, self.thickness, *self.rayleigh, self.rayleigh_height, self.mie, self.mie_absorption,
            self.mie_height, self.mie_asymmetry, *self.ozone, self.ozone_height, self.ozone_width,
        )  # fmt: skip

    def scattering(self, height: Tensor) -> tuple[Tensor, Tensor]:
        """``(..., 3)`` of molecules and ``(..., 1)`` of aerosols, per kilometre, at heights ``(...)``."""
        height = height[..., None]
        molecules = height.new_tensor(self.rayleigh) * torch.exp(-height / self.rayleigh_height)
        return molecules, self.mie * torch.exp(-height / self.mie_height)

    def extinction(self, height: Tensor) -> Tensor:
        """``(..., 3)`` per kilometre, at heights ``(...)``: what a beam loses to scattering and absorption."""
        molecules, aerosols = self.scattering(height)
        layer = (1 - (height[..., None] - self.ozone_height).abs() / self.ozone_width).clamp_min(0.0)
        haze = 1 + self.mie_absorption / self.mie if self.mie > 0 else 1.0
        return molecules + haze * aerosols + layer * height.new_tensor(self.ozone)

    def height_after(self, height: Tensor, cosine: Tensor, distance: Tensor) -> Tensor:
        """Height on a ray, ``distance`` from where it begins at ``height`` with ``cosine`` to the zenith.

        Differences of squares of radii are written out: radii themselves leave no digits for the air near the ground.
        """
        radius = self.radius + height
        over = height * (2 * self.radius + height) + distance * (2 * radius * cosine + distance)
        return over / ((self.radius**2 + over).clamp_min(0.0).sqrt() + self.radius)

    def ends(self, height: Tensor, cosine: Tensor) -> tuple[Tensor, Tensor]:
        """Where a ray leaves the air or meets the ground, in kilometres, and whether it meets the ground."""
        along = (self.radius + height) * cosine
        below = height * (2 * self.radius + height)
        square = along * along - below
        grounded = (square >= 0) & (cosine < 0)
        ground = below / (square.clamp_min(0.0).sqrt() - along)  # the nearer root, without cancellation
        return torch.where(grounded, ground, self.to_top(height, cosine)), grounded

    def to_top(self, height: Tensor, cosine: Tensor) -> Tensor:
        """Kilometres to where a ray that does not meet the ground leaves the air."""
        along = (self.radius + height) * cosine
        above = (self.thickness - height).clamp_min(0.0) * (2 * self.radius + self.thickness + height)
        root = (along * along + above).sqrt()
        return torch.where(along > 0, above / (root + along).clamp_min(1e-9), root - along)


def rayleigh_phase(cosine: Tensor) -> Tensor:
    """Share of light that molecules scatter through an angle, per steradian."""
    return 3 / (16 * math.pi) * (1 + cosine * cosine)


def mie_phase(cosine: Tensor, asymmetry: float) -> Tensor:
    """Likewise aerosols. Source: Cornette and Shanks 1992, as Hillaire 2020 uses it."""
    g = asymmetry
    shape = (1 + cosine * cosine) / (1 + g * g - 2 * g * cosine) ** 1.5
    return 3 / (8 * math.pi) * (1 - g * g) / (2 + g * g) * shape
