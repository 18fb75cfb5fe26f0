"""Sunlight that waves reflect onto a wall, against photons that the same waves reflect one by one."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt.commands.ablation.place import Place
from gbufrt.commands.ablation.subjects import Outcome
from gbufrt.commands.ablation.world.pictures import compared

if TYPE_CHECKING:
    from tracer.scene.scene import Scene

SUNS = {  # by the names that stand for views: direction, seconds, amplitude of the waves
    "high sun": ((0.25, 0.6, 0.75), 2.0, 0.1),
    "low sun": ((0.1, 0.4, 0.9), 5.0, 0.1),
    "small waves": ((-0.3, 0.6, 0.7), 3.5, 0.05),
}
IRRADIANCE, SIZE, TOP, FRONT = 3.0, (48, 24, 40), 4, 8  # of the pool: voxels, its water's level, where its wall is
EYE = (24.0, 8.0, 30.0)
LOW, HIGH = (18.0, 4.6), (28.0, 9.6)  # of the part of the wall that is measured: x, y
NONE = (0.0, 0.0, 0.0)
BINS, FINE = 20, 3  # rows of light, half as many as columns; points along each side of a bin
FALL = ((8.0, 8.0), (40.0, 26.0))  # of the water on which photons fall: x, z
PHOTONS = 2_000_000


def judge(place: Place) -> Outcome:
    """Energy over the truth's, and how alike the patterns are, on a wall at the end of a pool."""
    scene, time = pool(place.view)
    truth = place.kept(
        "photons", (LOW, HIGH), [time], (place.view, PHOTONS, BINS), lambda: {"light": photons(place.view)}
    )
    wanted = truth["light"]
    found, flat = arrived(scene, time), arrived(*pool(place.view, still=True))
    energy = float(found.mean() / wanted.mean())
    result = Outcome(figures={"caustics.energy": abs(energy - 1), "caustics.alike": correlation(found, wanted)})
    result.figures |= {"caustics.ratio": energy, "caustics.none": 1.0, "caustics.none_alike": 0.0}
    result.figures["caustics.still"] = abs(float(flat.mean() / wanted.mean()) - 1)
    result.figures["caustics.contrast"] = float((found.std() / found.mean()) / (wanted.std() / wanted.mean()))
    shown = {"ours": found, "still water": flat}
    picture = lambda light: light.flip(0).expand(1, 3, -1, -1)  # the first row is the lowest
    result.pictures = compared("caustics", {name: picture(light) for name, light in shown.items()}, picture(wanted))
    return result


def pool(name: str, *, still: bool = False) -> tuple[Scene, float]:
    """A wall along x at the end of a pool, both under the sun; and the time."""
    from tracer import Material, MaterialTable, Scene, Sky, Sun, Waves, World

    direction, time, amplitude = SUNS[name]
    table = MaterialTable.of([Material(name="stone"), Material(name="water", opacity=0.5, tint=(0.4, 0.8, 0.9))])
    voxels = torch.zeros(SIZE, dtype=torch.int16)
    voxels[:, :2], voxels[:, 2:TOP, FRONT:], voxels[:, :14, :FRONT] = 1, 2, 1
    dark = Sky(zenith=NONE, horizon=NONE, ground=NONE)
    waves = Waves(amplitude=0.0 if still else amplitude)
    sun = Sun(direction=direction, irradiance=(IRRADIANCE, IRRADIANCE, IRRADIANCE))
    return Scene(world=World.from_dense(voxels, table), sun=sun, sky=dark, waves=waves), time


def arrived(scene: Scene, time: float) -> Tensor:
    """``(BINS, 2 BINS)`` irradiance by way of the waves on the measured part of the wall, the lowest row first."""
    from tracer.weather.caustics import caustics

    count = BINS * FINE
    y = LOW[1] + (torch.arange(count) + 0.5) * (HIGH[1] - LOW[1]) / count
    x = LOW[0] + (torch.arange(2 * count) + 0.5) * (HIGH[0] - LOW[0]) / (2 * count)
    grid = torch.stack(torch.meshgrid(y, x, indexing="ij"), dim=-1).view(-1, 2)
    points = torch.stack([grid[:, 1], grid[:, 0], torch.full_like(grid[:, 0], FRONT + 1e-3)], dim=-1)
    normals, lit = torch.tensor([[0.0, 0.0, 1.0]]).expand_as(points), torch.ones(len(points), dtype=torch.bool)
    given: dict[str, Any] = {"poses": torch.zeros(0, 4, 4), "time": time, "eye": torch.tensor(EYE)}
    light = caustics(scene, points, normals, lit, **given)[:, 0]
    return F.avg_pool2d(light.view(1, 1, count, 2 * count), FINE)[0, 0]


def photons(name: str) -> Tensor:
    """The same by light tracing: photons fall evenly on the water, are reflected by its waves, and land."""
    from gbufrt.specular import DIELECTRIC_F0, schlick
    from tracer.weather.water import Water

    scene, time = pool(name)
    assert scene.waves is not None
    toward = F.normalize(torch.tensor(SUNS[name][0]), dim=0)
    low, high = (torch.tensor(corner) for corner in FALL)
    places = low + torch.rand(PHOTONS, 2, generator=torch.Generator().manual_seed(3)) * (high - low)
    power = IRRADIANCE * float(toward[1]) * float((high - low).prod()) / PHOTONS  # of each: the sun's on level ground
    water = Water.of(scene.waves, time, torch.tensor(EYE))
    slopes, heights = water.slopes(places), water.height(places) + TOP - scene.waves.amplitude
    normal = F.normalize(torch.stack([-slopes[:, 0], torch.ones(PHOTONS), -slopes[:, 1]], dim=-1), dim=-1)
    cosine = normal @ toward
    way = 2 * cosine[:, None] * normal - toward
    far = (FRONT - places[:, 1]) / way[:, 2]
    x, y = places[:, 0] + far * way[:, 0], heights + far * way[:, 1]
    size = (HIGH[1] - LOW[1]) / BINS
    row, column = ((y - LOW[1]) / size).floor(), ((x - LOW[0]) / size).floor()
    lands = (far > 0) & (row >= 0) & (row < BINS) & (column >= 0) & (column < 2 * BINS)
    place = (row * 2 * BINS + column)[lands].long()
    energy = (power * schlick(cosine, DIELECTRIC_F0))[lands]
    return torch.zeros(2 * BINS * BINS).index_add(0, place, energy).view(BINS, 2 * BINS) / size**2


def correlation(a: Tensor, b: Tensor) -> float:
    """Pearson's."""
    return float(torch.corrcoef(torch.stack([a.flatten(), b.flatten()]))[0, 1])
