"""Light that fog scatters toward the eye: sun, sky and lamps, scattered once.

Places along a ray are drawn in proportion to the light that fog takes there, so that the mean over them is the source
term's; lamps are drawn apart, see `tracer.fog.along`. The steps are `tracer.fog.reference`'s, or compiled.

Most noise lies in a few pixels: at shafts of light, thin openings and lamps. All take a few steps of each light, and
those around which these differ most take many more.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt.compute.dispatch import Form, form_of
from gbufrt.compute.resident import numbers, places
from tracer.fog.reference import NOTHING, WIDE, March
from tracer.fog.segments import Segments, passes
from tracer.lights.emitters import lamps_of
from tracer.lights.lamp_table import LampTable
from tracer.lights.samples import Lights
from tracer.lights.sky_table import SkyTable
from tracer.scene.scene import Scene


class Steps(NamedTuple):
    """Places on a ray through the fog, a frame: at every pixel, and at most at those that need more."""

    first: int
    most: int


SUN, SKY, LAMPS = Steps(5, 64), Steps(3, 20), Steps(4, 32)
UNEVEN = 0.1  # share of pixels that take most steps
NEIGHBOURS = 7  # pixels across
SHARED = 4  # pixels both ways that weigh lamps together for their first steps


def scattered(
    scene: Scene, segments: Segments, noise: Tensor, *, poses: Tensor, index: int = 0, coherent: bool = True
) -> Tensor:
    """Mean light that fog scatters toward the eye, over the share of light that it takes.

    Times ``1 - passes(...)`` it is what fog adds before a surface. It hardly depends on where the segment ends, so it
    can be filtered across edges of depth.

    Args:
        scene: with fog. Sun and sky reach it undimmed, as they reach surfaces; light of lamps is dimmed on its way.
        segments: of H x W pixels, row by row.
        noise: ``(10, H, W)`` in [0, 1).
        poses: ``(I, 4, 4)`` of the scene's instances.
        index: frame number: others draw other places, well spread over time.
        coherent: whether neighbouring rays run side by side.

    Returns:
        ``(H * W, 3)`` linear radiance; 0 where fog takes nothing.

    Source: Kulla and Fajardo 2012 (importance sampling in participating media); Veach and Guibas 1995 for the sky.
    """
    assert scene.fog is not None
    size, u = noise.shape[1:], noise.flatten(1)
    light = segments.origins.new_zeros(len(segments.begin), 3)
    taken = 1 - passes(scene.fog, segments)
    blocks = _blocks(size, SHARED if coherent else 1, taken.device)
    order = blocks.argsort(stable=True)
    order = order[places(taken[order] > NOTHING)]
    if not len(order):
        return light
    rays = _march(scene, segments, taken, poses)

    def march(add: Callable[[March, Tensor, range, Tensor | None], Tensor], steps: Steps, dims: slice) -> Tensor:
        """Mean of the first steps, or of all of them where those around differ most."""
        found, more = torch.zeros_like(light), steps.most - steps.first
        for part in order.split(WIDE):
            first = range(index * steps.first, (index + 1) * steps.first)
            some = add(rays.of(part), u[dims, part], first, blocks[part])
            found[part] = torch.where(taken[part, None] > NOTHING, some, 0.0)
        uneven, differ = _uneven(found.mean(dim=1).view(size), taken.view(size))
        for part in uneven.split(WIDE) if len(uneven) else ():
            rest = add(rays.of(part), u[dims, part], range(-(index + 1) * more, -index * more), None)
            found[part] = torch.where(differ[part, None], torch.lerp(found[part], rest, more / steps.most), found[part])
        return found

    if rays.lights.sun is not None:
        light += march(lambda some, u, steps, _: some.sun(u, steps), SUN, slice(0, 3))
    if rays.lights.sky is not None:
        light += march(lambda some, u, steps, _: some.sky(u, steps), SKY, slice(3, 6))
    if rays.lights.lamps is not None:
        light += march(lambda some, u, steps, alike: some.lamps(u, steps, alike), LAMPS, slice(6, 10))
    return light * numbers((scene.fog.albedo,), light)[0]


def _march(scene: Scene, segments: Segments, taken: Tensor, poses: Tensor) -> March:
    assert scene.fog is not None
    table = LampTable.of(lamps_of(scene, poses), (0, 0, 0), (1, 1, 1))
    lights = Lights(sun=scene.sun, lamps=table if len(table) else None, sky=SkyTable.of(scene))
    given: dict[str, Any] = {"scene": scene, "fog": scene.fog, "lights": lights, "poses": poses, "taken": taken}
    if form_of(taken, *scene.grids.tensors, cuda=True) is Form.REFERENCE:
        return March(segments=segments, **given)
    from tracer.fog import drivers

    return drivers.March.made(segments=segments, **given)


def _blocks(size: tuple[int, ...], side: int, device: torch.device) -> Tensor:
    """``(H * W,)`` the number of the square that each pixel lies in."""
    rows, columns = (torch.arange(n, device=device) // side for n in size)
    return (rows[:, None] * -(-size[1] // side) + columns).flatten()


def _uneven(light: Tensor, taken: Tensor) -> tuple[Tensor, Tensor]:
    """Pixels around which light differs most, by what fog takes at each; and ``(H * W,)`` bool, where it does.

    A pixel's own light has no part in that: were more steps taken where the first saw something, the mean would be off.
    """
    reach, each = NEIGHBOURS // 2, torch.stack([torch.ones_like(light), light, light * light])[:, None]
    around = F.conv2d(each, _ring(light), padding=reach)[:, 0]
    mean, square = around[1:] / around[0].clamp_min(1)
    spread = ((square - mean * mean).clamp_min(0).sqrt() * taken).flatten()
    worst, where = spread.topk(math.ceil(len(spread) * UNEVEN))
    return where[places(worst > 0)], spread > 0


def _ring(like: Tensor) -> Tensor:
    ring = like.new_ones(1, 1, NEIGHBOURS, NEIGHBOURS)
    ring[..., NEIGHBOURS // 2, NEIGHBOURS // 2] = 0
    return ring
