"""The water that eyes are in: it absorbs light over distance, and scatters a little of what comes from above."""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from gbufrt.compute.resident import resident, waits
from gbufrt.noise.noise import PLASTIC
from gbufrt.specular import DIELECTRIC_F0, schlick
from tracer.lights.sky import sky_irradiance
from tracer.sampling.scatter import cosine_direction
from tracer.sampling.sequence import disc
from tracer.scene.scene import MASK_SECONDARY, MASK_SHADOW, Scene
from tracer.traversal.rays import transmission

RAYS, ROUND = 64, 6.0  # that find how open the surface is, and the world units round the eye in which they begin
ENTERS = 0.934  # share of light from a whole even sky that a smooth surface of water lets in
BACK = 8.0  # an even half space lit from overhead sends back an eighth of what it scatters
LEAST = 1e-4  # extinction of the clearest water, per world unit
SERIES = 1e-3  # exponents below which a series is exact in float32
UNSEEN = 1e-3  # share of light below which it ends
MOST = 1e4  # world units: no water is clear so far


@dataclass(frozen=True, eq=False, kw_only=True)
class Medium:
    """The water round B eyes. Eyes in the air have water that does nothing.

    Args:
        wet: ``(B,)`` bool, which eyes are in water.
        extinction: ``(B, 3)`` share of light lost over a short way, per world unit, linear RGB; 0 in the air.
        light: ``(B, 3)`` irradiance just below the surface, on what faces up.
        albedo: ``(B, 3)`` share of the lost light that is scattered, to all sides alike.
        level: ``(B,)`` height of the surface, world y.
        lets: ``(B,)`` share of light that passes the surface of water besides what it reflects: 1 - opacity.
        height: ``(B,)`` of the eyes, world y.
    """

    wet: Tensor
    extinction: Tensor
    light: Tensor
    albedo: Tensor
    level: Tensor
    lets: Tensor
    height: Tensor

    @staticmethod
    def of(scene: Scene, eyes: Tensor, poses: Tensor) -> Medium | None:
        """The water round eyes ``(B, 3)`` in a scene whose instances are at ``poses`` ``(B, I, 4, 4)``.

        None where none of them is in any, as far as the host can tell without waiting for a GPU.
        """
        if not scene.materials.has_water:
            return None
        eyes, table = eyes.float(), scene.materials
        cells = eyes.floor().long()
        which = scene.world.at(cells).long()
        wet = table.water[which] & (table.opacity[which] < 1)
        if not waits(wet) and not bool(wet.any()):
            return None
        level = _level(scene, cells)
        above = torch.stack([eyes[:, 0], torch.where(wet, level + 0.01, eyes[:, 1]), eyes[:, 2]], dim=1)
        opacity = table.opacity[which]
        extinction = -table.tint[which].clamp_min(1e-6).log().clamp_max(-LEAST)
        return Medium(
            wet=wet,
            extinction=torch.where(wet[:, None], extinction, 0.0),
            light=_arriving(scene, above, poses) * (1 - opacity)[:, None],
            albedo=(BACK * opacity[:, None] * table.albedo[which]).clamp_max(1.0),
            level=level,
            lets=1 - opacity,
            height=eyes[:, 1],
        )

    def at(self, b: int) -> Medium:
        """That of one eye."""
        return Medium(**{name: value[b : b + 1] for name, value in vars(self).items()})

    @property
    def reach(self) -> Tensor:
        """``(B,)`` world units beyond which nothing is seen; inf in the air."""
        return torch.where(self.wet, -math.log(UNSEEN) / self.extinction.amin(dim=1).clamp_min(1e-9), torch.inf)

    def clear(self, distances: Tensor) -> Tensor:
        """``(B, 3, ...)`` share of light left after distances ``(B, ...)``.

        Source: Beer-Lambert.
        """
        return (-self._rows(self.extinction, distances) * distances.clamp_max(MOST)[:, None]).exp()

    def scattered(self, rises: Tensor, distances: Tensor, heights: Tensor | None = None) -> Tensor:
        """``(B, 3, ...)`` radiance that the water adds along rays, of light that it scatters once.

        The light from above falls off with depth as that along rays does with distance, so that the integral along a
        ray has a closed form.

        Args:
            rises: ``(B, ...)`` world y of the rays' directions, unit length.
            distances: ``(B, ...)`` how long they are.
            heights: ``(B, ...)`` world y at which they begin; by default that of the eyes.
        """
        spread = (-1,) + (1,) * (rises.ndim - 1)
        level = self.level.view(spread)
        depth = (level - (self.height.view(spread) if heights is None else heights)).clamp_min(0).expand_as(rises)
        distances = torch.minimum(distances.clamp_max(MOST), depth / rises.clamp_min(1e-6))  # to the surface
        lost = self._rows(self.extinction, rises)
        x = lost * ((1 - rises) * distances)[:, None]
        way = torch.where(x < SERIES, 1 - x / 2, -torch.expm1(-x) / x.clamp_min(SERIES))
        begun = self._rows(self.light * self.albedo / (4 * math.pi), rises) * (-lost * depth[:, None]).exp()
        return begun * lost * distances[:, None] * way

    def lit(self, heights: Tensor) -> Tensor:
        """``(B, 3, ...)`` share of the open sky's light that arrives under water at world y ``(B, ...)``."""
        depth = (self.level.view((-1,) + (1,) * (heights.ndim - 1)) - heights).clamp_min(0)
        share = self.clear(depth) * (ENTERS * self.lets).view((-1,) + (1,) * heights.ndim)
        return torch.where(self.wet.view((-1,) + (1,) * heights.ndim), share, 1.0)

    def _rows(self, values: Tensor, like: Tensor) -> Tensor:
        return values.view(*values.shape, *(1,) * (like.ndim - 1))


def _level(scene: Scene, cells: Tensor) -> Tensor:
    """``(B,)`` height of the first air over cells ``(B, 3)``."""
    low, high = scene.world.bounds()
    steps = torch.arange(high[1] - low[1] + 1, device=cells.device)
    column = cells[:, None].repeat(1, len(steps), 1)
    column[..., 1] += steps
    return cells[:, 1] + (scene.world.at(column) == 0).byte().argmax(dim=1).float()


def _arriving(scene: Scene, above: Tensor, poses: Tensor) -> Tensor:
    """``(B, 3)`` irradiance that enters the water under places ``(B, 3)`` just over it, of sky and sun."""
    turns = resident(tuple(((n + 0.5) / PLASTIC % 1, (n + 0.5) / PLASTIC**2 % 1) for n in range(RAYS)), above).T
    up = resident(((0.0, 1.0, 0.0),), above)
    x, z = disc(turns) * ROUND
    begin = above[:, None] + torch.stack([x, torch.zeros_like(x), z], dim=1)
    ways = cosine_direction(up.expand(RAYS, 3), turns.roll(RAYS // 2, dims=1)).expand_as(begin)
    open_sky = transmission(scene, begin, ways, poses=poses, mask=MASK_SECONDARY).mean(dim=1)
    light = ENTERS * open_sky * sky_irradiance(scene, up[:, :, None, None])[0, :, 0, 0]
    if scene.sun is None:
        return light
    toward = torch.nn.functional.normalize(resident(scene.sun.direction, above), dim=0)
    sees = transmission(scene, begin, toward.expand_as(begin), poses=poses, mask=MASK_SHADOW).mean(dim=1)
    cosine = toward[1].clamp_min(0.0)
    return light + sees * resident(scene.sun.irradiance, above) * cosine * (1 - schlick(cosine, DIELECTRIC_F0))
