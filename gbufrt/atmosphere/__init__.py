"""The atmosphere of a planet: what it scatters and absorbs, and the light of its sky."""

from gbufrt.atmosphere.aerial import air_before
from gbufrt.atmosphere.medium import Atmosphere
from gbufrt.atmosphere.sky import sky_picture, sun_transmittance

__all__ = ["Atmosphere", "air_before", "sky_picture", "sun_transmittance"]
