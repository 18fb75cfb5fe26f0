"""The surface of water from below: what it reflects, where light through it comes from, and how waves tilt it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt.compute.resident import places
from gbufrt.tree import map_tensors
from tracer.scene.scene import MASK_PRIMARY, Scene
from tracer.texture import facing
from tracer.traversal.hits import Hits
from tracer.traversal.rays import trace
from tracer.underwater.medium import Medium
from tracer.weather.water import Water

INDEX = 4 / 3  # refractive index of water
LIFT = 2e-3  # world units over a surface at which rays begin
BORDERS = 6  # between waters of two kinds, as of two biomes, that a ray crosses without a trace


@dataclass(frozen=True, eq=False, kw_only=True)
class Below:
    """Where cameras see the surface of the water that they are in.

    Args:
        shows: ``(B, H, W)`` bool.
        normal: ``(B, H, W, 3)`` world space, facing down to the eye; elsewhere without a meaning.
        reflects: ``(B, H, W)`` share of light.
        lets: ``(B, H, W)`` share of the rest that passes.
    """

    shows: Tensor
    normal: Tensor
    reflects: Tensor
    lets: Tensor

    def over(self, channels: Mapping[str, Tensor]) -> dict[str, Tensor]:
        """The channels of a G-buffer where the surface shows.

        It scatters nothing, and passes find no reflection in it: what it mirrors is seldom on screen, and Schlick's
        Fresnel is that of surfaces from the outside. `tracer.underwater.frames` traces it.
        """
        here, one = self.shows[:, None], torch.ones_like(self.reflects[:, None])
        passes = (1 - self.reflects) * self.lets
        changed = {
            "normal": self.normal.permute(0, 3, 1, 2).to(channels["normal"]),
            "albedo": torch.zeros_like(channels["albedo"]),
            "metallic": one,
            "roughness": one,
            "transmittance": passes[:, None].expand_as(channels["transmittance"]),
        }
        return {name: torch.where(here, value, channels[name]) for name, value in changed.items()}


def below(
    scene: Scene, medium: Medium, origins: Tensor, directions: Tensor, hits: Hits, times: Sequence[float], eyes: Tensor
) -> Below:
    """The surface of the water where rays ``(B, H, W, 3)`` of cameras leave it.

    Args:
        scene: what is there; its waves tilt the surface, which stays where still water has it.
        medium: round the cameras.
        origins: of the rays, world space.
        directions: likewise, unit length.
        hits: of the rays.
        times: B, seconds.
        eyes: ``(B, 3)`` of the cameras.
    """
    shows = leaves(scene, hits) & medium.wet[:, None, None]
    normal = hits.normal
    if scene.waves is not None:
        points = origins + directions * torch.where(shows, hits.t, 0.0)[..., None]
        tilted = []
        for b, time in enumerate(times):
            slopes = Water.of(scene.waves, time, eyes[b]).slopes(points[b][..., ::2])
            down = torch.stack([slopes[..., 0], -torch.ones_like(slopes[..., 0]), slopes[..., 1]], dim=-1)
            tilted.append(facing(F.normalize(down, dim=-1), hits.normal[b], directions[b]))
        normal = torch.where((hits.normal[..., 1:2] < -0.5), torch.stack(tilted), normal)
    cosine = -(normal * directions).sum(-1)
    share = torch.where(shows, reflectance(cosine), 0.0)
    return Below(shows=shows, normal=normal, reflects=share, lets=medium.lets[:, None, None].expand_as(share))


def leaves(scene: Scene, hits: Hits) -> Tensor:
    """``(...)`` bool: where rays leave water into air."""
    return hits.hit & hits.back_face & scene.materials.water[hits.material.long()]


def past_borders(
    scene: Scene, origins: Tensor, directions: Tensor, hits: Hits, within: Tensor, *, poses: Tensor, t_max: Tensor
) -> Hits:
    """The hits ``(B, ...)`` of rays from inside water, none of which is a border between two kinds of water.

    Args:
        scene: what is there.
        origins: ``(B, ..., 3)`` of the rays, world space.
        directions: likewise, unit length.
        hits: what they hit first.
        within: ``(B, ...)`` bool, or of a shape that broadcasts, which of the rays begin in water.
        poses: ``(B, I, 4, 4)`` of the instances.
        t_max: ``(B, ...)`` where the rays end.
    """
    hits = map_tensors(torch.clone, hits)
    for b in range(len(origins)):
        for _ in range(BORDERS):
            other = within[b] & hits.hit[b] & ~hits.back_face[b] & scene.materials.water[hits.material[b].long()]
            rows = places(other)
            if not len(rows[0]):
                break
            here = (b, *rows)
            crossed, far = hits.at(here), torch.where(other[rows], t_max[here], 0.0)
            begin = torch.where(crossed.hit, crossed.t + LIFT, 0.0)  # within the other water, whose surface is next
            rays = origins[here], directions[here]
            beyond = trace(scene, *rays, poses=poses[b], mask=MASK_PRIMARY, t_min=begin, t_max=far)
            hits.put(here, beyond.where(other[rows], crossed))
    return hits


def reflectance(cosine: Tensor) -> Tensor:
    """Share of light in water that its surface reflects, at cosines from the normal; 1 beyond the critical angle.

    Source: Fresnel's equations.
    """
    cosine = cosine.clamp(1e-6, 1)
    other = outside(cosine)
    across = (INDEX * cosine - other) / (INDEX * cosine + other)
    along = (cosine - INDEX * other) / (cosine + INDEX * other)
    return (across.square() + along.square()) / 2


def outside(cosine: Tensor) -> Tensor:
    """Cosine in the air of rays that leave water at a cosine; 0 where none does. Source: Snell's law."""
    return (1 - INDEX**2 * (1 - cosine.square())).clamp_min(0).sqrt()


def refracted(directions: Tensor, normals: Tensor) -> Tensor:
    """``(..., 3)`` where rays go on that leave water through a surface whose normal faces them, unit length."""
    cosine = -(directions * normals).sum(-1, keepdim=True)
    return F.normalize(INDEX * directions + (INDEX * cosine - outside(cosine)) * normals, dim=-1)
