"""The sky: its radiance along rays that hit nothing, and its unoccluded irradiance."""

from __future__ import annotations

import math
from weakref import WeakKeyDictionary

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt.compute.resident import numbers
from gbufrt.directions import length
from gbufrt.environment import environment_directions, environment_solid_angles, lookup_environment
from tracer.scene.scene import Scene, Sky, Sun

GRADIENT = 0.45  # exponent of elevation between horizon and zenith: the pale band is narrow
HAZE = 0.12  # sine of the depression over which the horizon fades into the ground
GLOW = ((0.010, 0.55), (0.004, 0.86))  # share of the sun's irradiance and Henyey-Greenstein g of each lobe
INTEGRATION = (64, 128)  # pixels of the lat-long picture that irradiance is summed over
TABLE = (32, 64)  # pixels of the irradiance table: irradiance is a smooth function of the normal
_tables: WeakKeyDictionary[Sky, tuple[Sun | None, Tensor]] = WeakKeyDictionary()  # skies do not change; worlds may


def sky_radiance(scene: Scene, directions: Tensor) -> Tensor:
    """Radiance of the sky without the sun's disc.

    It is looked up in the sky's picture. Where there is none it goes from zenith to horizon by elevation, with the
    ground below, and a glow round the sun is proportional to the sun's irradiance.

    Args:
        scene: whose ``sky`` and ``sun``.
        directions: ``(B, 3, ...)`` world space, unit length.

    Returns:
        ``(B, 3, ...)`` linear radiance.

    Source: Henyey and Greenstein 1941 for the lobes of the glow.
    """
    if scene.sky.picture is not None:
        picture = scene.sky.picture.to(directions)
        return lookup_environment(picture, directions.flatten(2)[..., None]).view_as(directions)
    zenith, horizon, ground = (_triple(c, directions) for c in (scene.sky.zenith, scene.sky.horizon, scene.sky.ground))
    up = directions[:, 1:2]
    height = up.clamp(0.0, 1.0)
    # the power law without its infinite slope at the horizon
    lift = ((height + 0.01) ** GRADIENT - 0.01**GRADIENT) / (1.01**GRADIENT - 0.01**GRADIENT)
    below = (-up / HAZE).clamp(0.0, 1.0)
    below = below * below * (3 - 2 * below)
    radiance = torch.lerp(torch.lerp(horizon, zenith, lift), ground.expand_as(directions), below)
    if scene.sun is None:
        return radiance
    cosine = _toward_sun(scene.sun, directions)
    lobes = sum(share * (1 - g * g) / (1 + g * g - 2 * g * cosine) ** 1.5 for share, g in GLOW)
    return radiance + _triple(scene.sun.irradiance, directions) * lobes * (1 - below)


def sun_radiance(sun: Sun, directions: Tensor) -> Tensor:
    """Radiance of the sun's disc, zero beside it; its integral over the disc is the sun's irradiance.

    Args:
        sun: the disc.
        directions: ``(B, 3, ...)`` world space, unit length.

    Returns:
        ``(B, 3, ...)`` linear radiance.
    """
    sine = math.sin(math.radians(sun.angular_radius))
    if sine == 0.0:
        return torch.zeros_like(directions)
    toward = F.normalize(_triple(sun.direction, directions), dim=1)
    (x, y, z), (a, b, c) = directions.split(1, dim=1), toward.split(1, dim=1)
    # in single precision the sine separates directions this close, the cosine does not; and on
    # planes torch.linalg.cross takes ten times as long
    off = length(torch.cat([y * c - z * b, z * a - x * c, x * b - y * a], dim=1))
    visible = (off < sine) & (x * a + y * b + z * c > 0)
    return torch.where(visible, _triple(sun.irradiance, directions) / (math.pi * sine * sine), 0.0)


def sky_along(scene: Scene, directions: Tensor) -> Tensor:
    """``(N, 3)`` radiance of the sky, without the sun's disc, in ``directions`` ``(N, 3)``."""
    return sky_radiance(scene, directions.T[None])[0].T


def beyond(scene: Scene, directions: Tensor, sees_sun: Tensor, share: Tensor) -> Tensor:
    """Radiance of a ``share`` ``(N,)`` of the sky, and of the sun where it is visible."""
    light = sky_along(scene, directions) * share[:, None]
    if scene.sun is not None:
        light = light + sun_radiance(scene.sun, directions.T[None])[0].T * sees_sun[:, None]
    return light


def environment(scene: Scene, *, size: tuple[int, int] = (64, 128)) -> Tensor:
    """A lat-long picture of the sky, oriented as `gbufrt.environment` says.

    The sun's disc is left out, because the sun is sampled as direct light.

    Args:
        scene: whose ``sky`` and ``sun``.
        size: ``(h, w)``.

    Returns:
        ``(1, 3, h, w)`` linear radiance, each pixel the mean over its area.
    """
    fine = sky_radiance(scene, environment_directions((2 * size[0], 2 * size[1]), device=scene.world.device))
    return F.avg_pool2d(fine, 2)


def sky_irradiance(scene: Scene, normals: Tensor) -> Tensor:
    """Irradiance of the unoccluded sky (without the sun's disc).

    Args:
        scene: whose ``sky`` and ``sun``.
        normals: ``(B, 3, H, W)`` world space; where zero (the sky) the result has no meaning.

    Returns:
        ``(B, 3, H, W)``, exact to 0.3 %.

    Source: Ramamoorthi and Hanrahan 2001: irradiance low-passes the environment, so a small table holds it.
    """
    return lookup_environment(irradiance_table(scene).to(normals.dtype), normals)


def irradiance_table(scene: Scene) -> Tensor:
    """``(1, 3, h, w)`` irradiance of the unoccluded sky on surfaces that face each direction, lat-long."""
    sun, table = _tables.get(scene.sky, (None, None))
    if table is None or sun is not scene.sun or table.device != scene.world.device:
        table = _integrated(scene)
        _tables[scene.sky] = scene.sun, table
    return table


def _integrated(scene: Scene) -> Tensor:
    sky = environment(scene, size=INTEGRATION).flatten(2)[0]
    way = environment_directions(INTEGRATION, device=sky.device).flatten(2)[0]
    angles = environment_solid_angles(INTEGRATION, device=sky.device).expand(1, 1, *INTEGRATION).flatten()
    faces = environment_directions(TABLE, device=sky.device).flatten(2)[0]
    cosine = (faces.T @ way).clamp_min(0.0) * angles
    cosine = cosine * (math.pi / cosine.sum(dim=1, keepdim=True))  # a uniform sky gives pi times its radiance exactly
    return (sky @ cosine.T).view(1, 3, *TABLE)


def _triple(values: tuple[float, float, float], like: Tensor) -> Tensor:
    return numbers((values,), like).view(1, 3, *(1,) * (like.ndim - 2))


def _toward_sun(sun: Sun, directions: Tensor) -> Tensor:
    toward = F.normalize(numbers((sun.direction,), directions)[0], dim=0)
    return torch.einsum("i,bi...->b...", toward, directions)[:, None]
