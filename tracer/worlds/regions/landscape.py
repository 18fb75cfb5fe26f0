"""Scenes of landscapes from files: their sky, their views, and what lies where the file ends."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import torch

from tracer.scene.grids import BRICK
from tracer.scene.material import MaterialTable
from tracer.scene.placement import framing_views
from tracer.scene.scene import Haze, Instance, Plain, Scene, Sky
from tracer.scene.weather import Waves
from tracer.scene.world import World
from tracer.worlds.regions.beyond import LAND, ends_of, in_open_land, in_open_sea, shore_of, span_of
from tracer.worlds.regions.depths import view_within
from tracer.worlds.regions.height_map import HeightMap, caverns_of, heights_of, raise_to
from tracer.worlds.regions.outlooks import SUN, best_view, panorama, views_over

MEADOW = Plain((0.17, 0.21, 0.10))  # where the border is not known
SEA = MEADOW._replace(water=1.0)
SKY = Sky(zenith=(0.13, 0.32, 0.82), horizon=(0.62, 0.76, 0.96), ground=(0.52, 0.60, 0.68), plain=MEADOW)
EMBERS = Sky(zenith=(0.045, 0.009, 0.0055), horizon=(0.08, 0.015, 0.009), ground=(0.045, 0.009, 0.0055), dayless=True)
SMOKE = Haze(begin=40.0, end=192.0)
DISTANCE = Haze(begin=0.4 * LAND * BRICK, end=(LAND - 1.0) * BRICK)  # which hides where mirrored land ends
NIGHT, GLOW = (0.0018, 0.0011, 0.0025), (0.05, 0.044, 0.056)  # of the End: what is round it, and light from overhead
OVERHEAD = 0.4  # sine of the elevation at which that light begins, where few pictures show it
ENDLESS = 0.5  # of the land is end stone, where it floats in the End
ROOFED = 0.9  # of the land lies under a roof of bedrock, where all of it does
ROOMY = 100.0  # blocks: half of the land that is gone round where it goes on in haze
SWELL = Waves(amplitude=0.08)  # an open sea that lies still shows nothing but sky


def landscape(world: World, instances: tuple[Instance, ...] = (), *, bare: bool = False) -> Scene:
    """A scene of a piece of land under the sky.

    Args:
        world: the land. What lies under a roof of bedrock, as the Nether does, has smoke lit by embers in place of sun
            and sky. What is of end stone has a night lit from overhead.
        instances: what else there is.
        bare: it ends where the file does: there is empty space, and below the horizon a plain of the border's mean
            colour. Otherwise it goes on, see `tracer.worlds.regions.beyond`: in waves as the sea if it has a coast
            there, in haze as its mirror image if it is large.

    Returns:
        A scene with the views ``landscape`` (over the ground, from where most is to be seen), ``orbit`` (once round in
        36 s) and ``flight`` (a round over the land, 48 s); under a roof ``landscape`` and ``panorama`` (once round on
        the spot, 36 s).
    """
    ground = heights_of(world)
    if _topped(ground, world.materials, "bedrock") > ROOFED and np.isfinite((caverns := caverns_of(world)).top).any():
        view = best_view(caverns)
        views = {"landscape": view, "panorama": panorama(view)}
        return Scene(world=world, instances=instances, sun=None, sky=EMBERS, haze=SMOKE, views=views)
    for instance in instances:
        raise_to(ground, instance)
    if instances and not np.isfinite(ground.top).any():  # nothing but plants and the like
        ends = [np.array(instance.model.bounds()) * instance.scale for instance in instances]
        points = np.array([[end[i, 0], end[j, 1], end[k, 2]] for end in ends for i, j, k in np.ndindex(2, 2, 2)])
        return Scene(world=world, instances=instances, sun=SUN, sky=SKY, views=framing_views(points))
    if _topped(ground, world.materials, "end_stone") > ENDLESS:
        sky = Sky(picture=night(), dayless=True)
        return Scene(world=world, instances=instances, sun=None, sky=sky, views=views_over(ground))
    sky = replace(SKY, plain=_plain(ground, world.materials))
    found = Scene(world=world, instances=instances, sun=SUN, sky=sky)
    if not bare and (shore := shore_of(ground.top, ground.kind, world.materials.water.cpu().numpy())) is not None:
        sky, sea = replace(SKY, plain=SEA), in_open_sea(world, shore)
        ground = replace(ground, beyond=(shore.level, shore.water))
        views = views_over(ground)
        if bool(world.materials.water.cpu()[torch.from_numpy(ground.kind[np.isfinite(ground.top)])].all()):
            within = view_within(world, instances, shore.level)
            views = views if within is None else {"underwater": within, **views}
        return replace(found, world=sea, sky=sky, waves=SWELL, views=views)
    if not bare and (span := span_of(ground.top)) is not None:
        wider = in_open_land(world, instances, span, ground.top)
        return replace(found, world=wider, haze=DISTANCE, views=views_over(ground.going_on(), widest=ROOMY))
    return replace(found, views=views_over(ground))


def _topped(ground: HeightMap, materials: MaterialTable, name: str) -> float:
    """The share of the land that has a material on top."""
    of_it = np.array([material.startswith(name) for material in materials.names])
    on_top = of_it[ground.kind[np.isfinite(ground.top)]]
    return float(on_top.mean()) if on_top.size else 0.0


def night() -> torch.Tensor:
    """``(1, 3, 64, 128)``: the sky of the End: dark all round, with light from overhead, as it has no sun."""
    up = torch.cos((torch.arange(64) + 0.5) / 64 * math.pi)
    share = ((up - OVERHEAD) / (1 - OVERHEAD)).clamp(0, 1).square()
    return torch.lerp(torch.tensor(NIGHT)[:, None], torch.tensor(GLOW)[:, None], share)[None, :, :, None].repeat(
        1, 1, 1, 128
    )


def plain_of(world: World) -> Plain:
    """What goes on below the horizon where a land ends: the mean of its border."""
    return _plain(heights_of(world), world.materials)


def _plain(ground: HeightMap, materials: MaterialTable) -> Plain:
    kinds = torch.from_numpy(ground.kind[ends_of(np.isfinite(ground.top))])
    albedo, water = materials.albedo.cpu()[kinds], materials.water.cpu()[kinds]
    r, g, b = albedo[~water].mean(dim=0).tolist() if not water.all() else MEADOW.albedo
    return Plain((r, g, b), float(water.float().mean()))
