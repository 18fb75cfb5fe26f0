"""What reflected rays bring in torch: the picture's light where they ended, or what lies beyond it; with gradients."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from gbufrt import Camera
from gbufrt.environment import lookup_environment
from gbufrt.sampling import gather, sample
from post.march.rays import Hits
from post.shading.constants import BORDER, CONTINUED_SHARE, HIDDEN_SHARE, OPEN, ROW_SLOPE
from post.shading.lobes import dot


class Picture(NamedTuple):
    """What the camera sees that reflects, and what it reflects; see `post.ssr` for the fields."""

    depth: Tensor
    hit: Tensor
    normal: Tensor
    normal_geo: Tensor | None
    roughness: Tensor
    f0: Tensor
    light: Tensor
    environment: Tensor | None
    visibility: Tensor | None
    bent_normal: Tensor | None
    metallic: Tensor | None = None
    around: Tensor | None = None
    """What lies beyond it, see `post.shading.surroundings`: ``(B, 4, h, w)``; by default nothing but the sky."""


def border_width(camera: Camera) -> float:
    """Pixels from the picture's border over which hits fade."""
    return max(BORDER * camera.height, 1.0)


def border_fade(px: Tensor, camera: Camera) -> Tensor:
    """1 inside the picture, falling to 0 at its border."""
    x, y = px[:, 0:1], px[:, 1:2]
    to_edge = torch.minimum(torch.minimum(x, camera.width - x), torch.minimum(y, camera.height - y))
    return (to_edge / border_width(camera)).clamp(0.0, 1.0)


def sky_share(
    world: Tensor,
    hits: Hits,
    hit: Tensor,
    everywhere: Tensor | None,
    visibility: Tensor | None,
    bent: Tensor | None,
    at: Tensor,
) -> Tensor:
    """Visibility of the sky to a ray without a hit.

    The ray takes the visibility of the surface it was last in front of, or 1 if that was the sky itself: its end is as
    open as that surface, whatever surrounds its origin. Only a ray that leaves the picture over nothing more open than
    its origin, or is hidden from its beginning, tells no more than the origin does. Then the open part of the origin's
    hemisphere is taken for a cone around the bent normal, see `open_share`.
    """
    share = open_share(visibility, bent, world)
    if everywhere is None or visibility is None:
        return share
    last = gather(torch.where(hit, everywhere, 1.0), hits.px[:, 0].floor(), hits.px[:, 1].floor())
    went = ((hits.px - at).abs() > 0.5).any(1, keepdim=True)
    return torch.where(hits.spent & went | (last > visibility), last, share)


def open_share(visibility: Tensor | None, bent: Tensor | None, world: Tensor) -> Tensor:
    """Visibility of the sky along directions, as far as the openness of a surface tells.

    Cosine-weighted visibility v leaves open a half angle whose sine is sqrt(v) (Jimenez et al. 2016, section 5). A
    surface that is nearly open is taken as open, else rays that leave over a plain would be dark or not by a hair.
    """
    if visibility is None:
        return torch.ones_like(world[:, :1])
    if bent is None:
        return visibility
    edge = (1 - visibility / OPEN).clamp(1e-30, 1.0).sqrt()  # not of 0, where its slope is infinite
    soft = (0.3 * visibility.clamp(1e-30, 1.0).sqrt()).clamp_min(1e-3)
    ramp = ((dot(bent, world) - edge) / soft + 1).clamp(0.0, 1.0)
    return ramp * ramp * (3 - 2 * ramp) * (visibility * 20).clamp(0.0, 1.0)


def beyond(g: Picture, world: Tensor, share: Tensor, over_sky: Tensor | None = None) -> Tensor:
    """What rays meet that leave the picture: a share of the sky, the rest surfaces.

    A ray that ends over the sky, going away from the camera, meets it. Others find it as far up as the surroundings
    leave it open.
    """
    sky = torch.zeros_like(world) if g.environment is None else lookup_environment(g.environment, world)
    if g.around is None:
        return share * sky
    surface, left = lookup_environment(g.around, off_horizon(world)).split((3, 1), dim=1)
    share = share * (left if over_sky is None else torch.where(over_sky, 1.0, left))
    return torch.lerp(surface, sky, share)


def off_horizon(world: Tensor) -> Tensor:
    """Directions that the rows of a guess next to the horizon lie in, where they would lie between these.

    What is over the horizon is not to be mixed with what is below it.
    """
    x, y, z = world.unbind(dim=1)
    least = ROW_SLOPE * (x * x + z * z).clamp_min(1e-12).sqrt()
    return torch.stack([x, torch.where(y > 0, torch.maximum(y, least), torch.minimum(y, -least)), z], dim=1)


def incoming(light: Tensor, hits: Hits, confidence: Tensor, guess: Tensor) -> Tensor:
    """Radiance of each ray: light from the screen as far as it is trusted, else a guess."""
    visible = sample(light, hits.px)
    guess = torch.where(hits.blocked, hidden_share(hits) * visible, guess)
    return guess + (visible - guess) * confidence


def hidden_share(hits: Hits) -> Tensor:
    """Share of the light next to hidden geometry that it is taken to send: all, where the same surface goes on."""
    return torch.where(hits.agreement > 0, HIDDEN_SHARE, torch.full_like(hits.agreement, CONTINUED_SHARE))
