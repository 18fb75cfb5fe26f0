"""The sky by tables, against brute-force paths of light through the same air."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence

import torch
from torch import Tensor

from gbufrt.commands.ablation.figures.display import display, exposure_of
from gbufrt.commands.ablation.figures.errors import Pair, rms_error
from gbufrt.commands.ablation.place import Place
from gbufrt.commands.ablation.subjects import Outcome
from gbufrt.commands.ablation.world.pictures import compared

HOURS = {"noon": 12.0, "morning": 8.0, "sunrise": 6.25, "dawn": 5.75, "dusk": 18.5}
"""By the names that stand for views: sun at 60, 26, 3, -3 and -6.5 degrees."""
PATHS = {"noon": 192, "morning": 192, "sunrise": 256, "dawn": 1024, "dusk": 2048}
"""A direction and colour, of each half of the truth."""
GRID = (8, 16)  # directions over the upper hemisphere, each of the same solid angle: by height, and round
ROWS = 540  # from zenith to horizon: a picture of 1080 rows that shows 180 degrees
LEVELS = 255
RUNS = 3


def judge(place: Place) -> Outcome:
    """RMS error over directions relative to the mean, the largest step between rows in 8 bits, time of the tables."""
    from gbufrt.atmosphere import Atmosphere, sky_picture
    from gbufrt.environment import lookup_environment
    from tracer import SunPath

    sun = SunPath().sun(HOURS[place.view])
    sky = sky_picture(Atmosphere(), sun)
    ways = directions()
    ours, halves = lookup_environment(sky, ways.T.view(1, 3, *GRID)), truth(place, ways, PATHS[place.view])
    level = (halves[0] + halves[1]).mean() / 2
    whole = torch.ones_like(ours[:, :1], dtype=torch.bool)
    relative = lambda light: float(rms_error(light, halves, whole) / level)
    result = Outcome(figures={"sky.error": relative(ours), "sky.if_even": relative(level.expand_as(ours))})
    result.figures["sky.truth_error"] = float((halves[0] - halves[1]).square().mean().sqrt() / 2 / level)
    noise = (halves[0] - halves[1]).square() / 4
    result.figures["sky.resolved"] = float(noise.square().sum().sqrt() / noise.numel()) ** 0.5 / float(level)
    result.figures["sky.mean"] = float(ours.mean() / level)
    result.figures |= {"sky.step": step(sky, sun, smooth=True), "sky.step_nearest": step(sky, sun, smooth=False)}
    result.figures["sky.tables_s"] = seconds_of_tables()
    result.pictures = compared("sky", {"ours": ours}, (halves[0] + halves[1]) / 2)
    return result


def directions() -> Tensor:
    """``(N, 3)`` unit vectors over the upper hemisphere, the zenith first, row by row of `GRID`."""
    up = 1 - (torch.arange(GRID[0]) + 0.5) / GRID[0]
    angle = (torch.arange(GRID[1]) + 0.5) * (2 * math.pi / GRID[1])
    up, angle = torch.meshgrid(up, angle, indexing="ij")
    ring = (1 - up * up).sqrt()
    return torch.stack([ring * angle.sin(), up, -ring * angle.cos()], dim=-1).view(-1, 3)


def truth(place: Place, ways: Tensor, paths: int) -> Pair:
    """``(1, 3, *GRID)`` radiance along directions, in two halves."""
    from gbufrt.atmosphere import Atmosphere
    from tracer import SunPath
    from tracer.truth.atmosphere import sky_truth

    sun = SunPath().sun(HOURS[place.view])

    def make() -> dict[str, Tensor]:
        place.say(f"sky at {place.view}, paths of light")
        return {name: sky_truth(Atmosphere(), sun, ways, paths=paths, seed=seed) for seed, name in enumerate("ab")}

    kept = place.kept("sky", (Atmosphere(), sun), [0.0], (ways, paths), make)
    first, second = (kept[name].T.view(1, 3, *GRID) for name in "ab")
    return first, second


def step(sky: Tensor, sun: Sequence[float], *, smooth: bool) -> float:
    """The most that a row from zenith to horizon differs from the mean of its neighbours, in levels of 8 bits.

    A gradient has no such steps, bands have. The row lies at a right angle to the sun, whose glow is no gradient.
    Without ``smooth`` the sky is read without interpolation.
    """
    from gbufrt.environment import lookup_environment

    angle = (torch.arange(ROWS) + 0.5) * (math.pi / 2 / ROWS)
    angle = angle[angle < math.pi / 2 - math.pi / sky.shape[2]]  # the texel at the horizon holds the ground too
    if not smooth:
        rows = sky.shape[2] / math.pi
        angle = ((angle * rows).floor() + 0.5) / rows
    x, _, z = torch.nn.functional.normalize(torch.tensor([-sun[2], 0.0, sun[0]]), dim=0).tolist()
    column = lookup_environment(sky, torch.stack([x * angle.sin(), angle.cos(), z * angle.sin()])[None, :, :, None])
    exposure = exposure_of(column, torch.ones_like(column[:, :1], dtype=torch.bool))
    shown = display(column, exposure)[..., 0] * LEVELS
    return float((shown[..., 1:-1] - (shown[..., :-2] + shown[..., 2:]) / 2).abs().max())


def seconds_of_tables() -> float:
    """Processor time of making the tables, the least of a few runs."""
    from gbufrt.atmosphere import Atmosphere
    from gbufrt.atmosphere.scattering import tables_of

    took = []
    for _ in range(RUNS):
        begun = time.process_time()
        tables_of.__wrapped__(Atmosphere())
        took.append(time.process_time() - begun)
    return min(took)
