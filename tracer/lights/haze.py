"""Haze: what is far off takes on the colour of the sky behind it, as a property of its surface."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor

from tracer.lights.sky import sky_radiance
from tracer.scene.scene import Haze, Scene
from tracer.traversal.hits import Hits

HORIZON = 0.03  # sine of the elevation whose sky is the haze's: a little more than a pixel of the sky's picture


@dataclass(frozen=True, eq=False, kw_only=True)
class Air:
    """The air, or the water, between a camera and what it sees.

    Args:
        share: ``(B, 1, H, W)`` or ``(B, 3, H, W)`` of the light that comes from the air, 0 to 1.
        light: ``(B, 3, H, W)`` radiance of so much of it that nothing is seen through it.
        rougher: ``(B, 1, H, W)`` in [0, 1], how far reflections fade.
    """

    share: Tensor
    light: Tensor
    rougher: Tensor

    def over(self, channels: Mapping[str, Tensor]) -> dict[str, Tensor]:
        """The channels of a G-buffer that it changes: surfaces give less of their own, and the air's light instead.

        So every pass dims its part of the light, as it would dim it on a darker surface. Reflections fade with
        roughness.
        """
        share, rough = self.share, channels["roughness"]
        return {
            "albedo": channels["albedo"] * (1 - share),
            "transmittance": channels["transmittance"] * (1 - share),
            "emission": torch.lerp(channels["emission"], self.light, share),
            "roughness": torch.lerp(rough, torch.ones_like(rough), self.rougher),
        }


def range_of(haze: Haze, directions: Tensor) -> Tensor:
    """``(...)`` how far along rays ``(..., 3)`` from the camera anything is seen through haze, in their length."""
    return haze.end / _along_ground(directions).clamp_min(1e-6)


def haze_before(scene: Scene, directions: Tensor, hits: Hits) -> Air:
    """The air before what rays ``(B, H, W, 3)`` of a scene with haze hit."""
    assert scene.haze is not None
    share = _share(scene.haze, hits.t * _along_ground(directions))
    share = torch.where(hits.hit, share, 0.0)[:, None]
    return Air(share=share, light=sky_behind(scene, directions.permute(0, 3, 1, 2)), rougher=share)


def haze_beyond(haze: Haze, first: Tensor, second: Tensor) -> Tensor:
    """``(N,)`` share of what comes along a second way ``(N, 3)`` that is the air's, where a first leads from the eye.

    Before both ways together lies as much air as before what is as far away.
    """
    near, far = _along_ground(first), _along_ground(second)
    before = _share(haze, near)
    return (_share(haze, near + far) - before) / (1 - before).clamp_min(1e-6)


def sky_behind(scene: Scene, directions: Tensor) -> Tensor:
    """``(B, 3, ...)`` radiance of the sky as cameras see it along ``directions`` ``(B, 3, ...)``, unit length.

    In a scene with haze there is none below the horizon: where land ends, haze goes on.
    """
    if scene.haze is not None:
        height = directions[:, 1:2].clamp_min(HORIZON)
        directions = F.normalize(torch.cat([directions[:, :1], height, directions[:, 2:]], dim=1), dim=1)
    return sky_radiance(scene, directions)


def _share(haze: Haze, far: Tensor) -> Tensor:
    """Of light, what comes from the air before what is so far along the ground."""
    share = ((far - haze.begin) / (haze.end - haze.begin)).clamp(0.0, 1.0)
    return share * share * (3 - 2 * share)


def _along_ground(directions: Tensor) -> Tensor:
    return directions[..., ::2].norm(dim=-1)
