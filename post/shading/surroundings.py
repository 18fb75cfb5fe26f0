"""What lies beyond the picture, guessed from the picture: its own light by direction, and how far up it hides the sky.

What is off screen resembles what is on screen at the same height over the horizon, more so in directions that are near:
a square has walls on all its sides, a valley has hills behind the camera too.
"""

from __future__ import annotations

import math

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt import Camera
from gbufrt.environment import environment_directions
from gbufrt.luminance import luminance
from post.shading.constants import ROWS

SIZE = (ROWS, 24)  # pixels of the lat-long picture of a guess
BLOCKS = (12, 20)  # of the picture, whose means speak for it
LINES = 135  # of the picture that are enough for those means
ELEVATION, AZIMUTH = 0.08, 0.35  # standard deviations in radians: how far light is taken to be alike
ANYWHERE = 0.1  # what the same elevation in any other azimuth says, of what the same azimuth does
ACROSS = 0.02  # likewise what lies on the other side of the horizon: the sea hides nothing of the sky over it
REMOTE, FADING = 1e-3, 0.12  # likewise what other elevations say, and its decay; counts where nothing else is known
SKYLINE = 0.3  # elevation in radians from which nothing hides the sky, where the picture does not tell
UNTOLD = 0.004  # of the picture's blocks: what that is worth beside what the picture tells
HIDDEN = 0.5  # share of an elevation from which it is worth that; over an open sea it is worth nothing
BRIGHT = 4.0  # times the picture's mean luminance: lamps and noise are no surroundings
TINY = 1e-12


def look_around(light: Tensor, hit: Tensor, camera: Camera, depth: Tensor | None = None) -> tuple[Tensor, Tensor]:
    """Guess what lies in each direction, beyond the picture's border and behind the camera.

    Each direction gets a mean of the picture, weighted by how near its parts lie in elevation and azimuth: a heuristic
    of our own, which README measures under Limits. Differentiable in ``light``.

    Args:
        light: ``(B, 3, H, W)`` linear radiance that each pixel sends, the sky's where there is no surface.
        hit: ``(B, 1, H, W)`` bool: where there is a surface.
        camera: of the picture.
        depth: ``(B, 1, H, W)`` planar view z, world units. Orthographic cameras look one way in all pixels: there
            surfaces lie where they are seen from the middle of them.

    Returns:
        Two lat-long pictures, see `gbufrt.environment`: ``(B, 4, h, w)`` linear radiance of surfaces and the share of
        the sky that they leave open, in [0, 1]; and ``(B, 3, h, w)`` the sky's linear radiance, where the picture shows
        no sky that of surfaces.
    """
    step = max(camera.height // LINES, 1)
    thin = lambda picture: picture[..., step // 2 :: step, step // 2 :: step]
    light, hit = thin(light), thin(hit)
    aside = None if depth is None or not camera.orthographic else _from_middle(thin(depth.detach()), hit, camera)
    ways = _ways(camera, light) if aside is None else aside
    solid, over = hit.to(light), (ways[:, 1:2] > 0).to(light)
    mean = luminance(light).mean((2, 3), keepdim=True)
    light = light * (BRIGHT * mean / luminance(light).clamp_min(TINY)).clamp_max(1.0)
    planes = torch.cat([light * solid, solid, light * (1 - solid), 1 - solid], dim=1)
    parts = F.adaptive_avg_pool2d(torch.cat([planes * over, planes * (1 - over)], dim=1), BLOCKS)
    surface, covered, sky, free = torch.cat(parts.flatten(2).mT.chunk(2, dim=2), dim=1).split((3, 1, 3, 1), dim=2)
    shown = _ways(camera, light, BLOCKS) if aside is None else F.normalize(F.adaptive_avg_pool2d(aside, BLOCKS), dim=1)
    weight, up = _alike(shown, light)
    told = weight @ covered
    colour = weight @ surface / told.clamp_min(TINY)
    clear = weight @ free + TINY
    above = (weight @ sky + TINY * colour) / clear
    count = math.prod(BLOCKS)
    hides, opens = (weight[..., :count] @ part[:, :count] + TINY for part in (covered, free))  # over the horizon
    untold = UNTOLD * count * (hides / (hides + opens) / HIDDEN).clamp_max(1.0)
    share = (clear + untold * (up / SKYLINE).clamp(0.0, 1.0)) / (clear + told + untold)
    around = torch.cat([colour, share], dim=2)
    return around.mT.unflatten(2, SIZE), above.mT.unflatten(2, SIZE)


def _alike(ways: Tensor, like: Tensor) -> tuple[Tensor, Tensor]:
    """``(B, cells, 2 * blocks)`` how much a block of the picture says of a direction, by its part over the horizon and
    by that below it; ``(cells, 1)`` the direction's elevation."""
    shown = _angles(ways)
    cells = _angles(environment_directions(SIZE, dtype=like.dtype, device=like.device))
    elevation, azimuth = (angle.unflatten(2, SIZE) for angle in cells)
    up, aside = elevation[..., :1].flatten(1)[..., None] - shown[0], azimuth[..., 0, :].mT - shown[1]
    aside = torch.remainder(aside + math.pi, 2 * math.pi) - math.pi
    rows = torch.exp(-0.5 * (up / ELEVATION) ** 2) + REMOTE * torch.exp(-up.abs() / FADING)
    columns = ANYWHERE + torch.exp(-0.5 * (aside / AZIMUTH) ** 2)
    alike, up = (rows[:, :, None] * columns[:, None]).flatten(1, 2), cells[0][0].mT
    over = torch.where(up > 0, torch.ones_like(up), ACROSS)
    return torch.cat([alike * over, alike * (1 + ACROSS - over)], dim=2), up


def _ways(camera: Camera, like: Tensor, size: tuple[int, int] | None = None) -> Tensor:
    """``(B, 3, H, W)`` where the pixels look, world space, if the picture had as many as ``like`` or ``size``."""
    height, width = like.shape[-2:] if size is None else size
    return camera.resized((height, width)).rays()[1].movedim(-1, 1).to(like)


def _from_middle(depth: Tensor, hit: Tensor, camera: Camera) -> Tensor:
    """``(B, 3, H, W)`` where surfaces lie from the middle of all, world space; elsewhere as the camera looks."""
    view, solid = camera.resized((depth.shape[-2], depth.shape[-1])), hit.to(depth)
    points = view.to_world(view.unproject(depth))
    middle = (points * solid).sum((2, 3), keepdim=True) / solid.sum((2, 3), keepdim=True).clamp_min(1.0)
    return torch.where(hit, F.normalize(points - middle, dim=1), _ways(camera, depth))


def _angles(directions: Tensor) -> tuple[Tensor, Tensor]:
    """``(B, 1, N)`` elevation and azimuth, radians, of unit vectors ``(B, 3, h, w)``."""
    x, y, z = directions.flatten(2).split(1, dim=1)
    return torch.asin(y.clamp(-1.0, 1.0)), torch.atan2(x, -z)
