"""`gbufrt bench --scaling`: how time grows with pixels, samples, lamps, the size of the world, and threads.

Every series is measured in one run, on small pictures, and fitted by a power law: time ~ x^exponent.
"""

from __future__ import annotations

import math
import time
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from statistics import fmean, median
from typing import TYPE_CHECKING, Any

import torch

from gbufrt.commands.benchmark.process import timed, wait
from gbufrt.commands.busy import cores
from gbufrt.commands.profile import around_passes
from gbufrt.frame import Frame
from gbufrt.pipeline import Pipeline

if TYPE_CHECKING:
    from tracer.scene.scene import Scene

Size = tuple[int, int]
"""``(H, W)``."""
SIZES: tuple[Size, ...] = ((68, 120), (135, 240), (203, 360), (270, 480))
SMALL: Size = (135, 240)
COUNTS = (1, 2, 4, 8)  # of directions, or of samples
LAMPS = (10, 100, 1000)
SIDES = (64, 128, 256, 384)  # voxels
FLOOR, APART, HEIGHT = 128, 4, 32  # of the world of lamps, voxels: its sides, the pitch of the lamps, and its height
PRESET = "high"
BRANCHES = {"ao": "AO", "gi": "GI", "reflection": "reflections"}
ESTIMATES = {"ao": "directions", "gi": "directions", "reflection": "samples"}
"""Branches of the pipeline, and the tunable of their estimate that counts samples."""


@dataclass(frozen=True, kw_only=True)
class Series:
    """Time against one quantity."""

    name: str
    """What is timed."""
    points: Sequence[tuple[float, float]]
    """The quantity, and median milliseconds."""

    @property
    def exponent(self) -> float | None:
        """Slope of the line through the points in logarithmic axes; None for fewer than two quantities."""
        return slope(self.points)

    def to_json(self) -> dict[str, Any]:
        """The series as JSON values."""
        return {"name": self.name, "points": [list(point) for point in self.points], "exponent": self.exponent}


def slope(points: Sequence[tuple[float, float]]) -> float | None:
    """Least-squares slope of log y over log x; None unless there are two x, all of them and y positive."""
    if len({x for x, _ in points}) < 2 or min(min(point) for point in points) <= 0:
        return None
    xs, ys = [math.log(x) for x, _ in points], [math.log(y) for _, y in points]
    middle, level = fmean(xs), fmean(ys)
    spread = sum((x - middle) ** 2 for x in xs)
    return sum((x - middle) * (y - level) for x, y in zip(xs, ys, strict=True)) / spread


def by_pixels(repeats: int, device: str) -> list[Series]:
    """A frame of the preset, its branches, and the traced G-buffer, by the pixels of the picture."""
    from tracer.gbuffers import gbuffer
    from tracer.worlds import builtin

    scene, found = builtin().to(device), defaultdict(list)
    for size in SIZES:
        frame = _frame(scene, size)
        for name, ms in time_frames(frame, repeats, device).items():
            found[name].append((size[0] * size[1], ms))
        camera = frame.gbuffer.camera
        found["G-buffer"].append((size[0] * size[1], timed(lambda: gbuffer(scene, camera), repeats, device)))  # noqa: B023
    return [Series(name=name, points=points) for name, points in found.items()]


def by_samples(repeats: int, device: str) -> list[Series]:
    """The estimates of AO, GI and reflections, by directions or samples a pixel."""
    from post.presets import me1
    from tracer.worlds import builtin

    frame, found = _frame(builtin().to(device), SMALL), []
    for branch, tunable in ESTIMATES.items():
        points = []
        for count in COUNTS:
            pipeline = me1(PRESET, tunables={f"{branch}.estimate.{tunable}": count, "gi.estimate.bounces": 1})
            estimate: Any = pipeline.stages[branch]
            alone = Pipeline(estimate=estimate.stages["estimate"])
            points.append((count, timed(lambda: alone(frame), repeats, device)))  # noqa: B023
        found.append(Series(name=BRANCHES[branch], points=points))
    return found


def by_lamps(repeats: int, device: str) -> list[Series]:
    """Direct light, by the number of lamps over a floor."""
    from tracer.direct.lighting import light
    from tracer.gbuffers import gbuffer

    points = []
    for count in LAMPS:
        scene = lamps_over_a_floor(count).to(device)
        g = gbuffer(scene, _camera(scene, SMALL).to(device))
        points.append((count, timed(lambda: light(scene, g, samples=1), repeats, device)))  # noqa: B023
    return [Series(name="direct light", points=points)]


def by_side(repeats: int, device: str) -> list[Series]:
    """The traced G-buffer and the light of the sun, by the sides of a world of hills."""
    from tracer.direct.lighting import light
    from tracer.gbuffers import gbuffer
    from tracer.worlds import terrain

    found = defaultdict(list)
    for side in SIDES:
        scene = terrain((side, side // 2, side)).to(device)
        camera = _camera(scene, SMALL).to(device)
        g = gbuffer(scene, camera)
        found["G-buffer"].append((side, timed(lambda: gbuffer(scene, camera), repeats, device)))  # noqa: B023
        found["sunlight"].append((side, timed(lambda: light(scene, g, samples=1), repeats, device)))  # noqa: B023
    return [Series(name=name, points=points) for name, points in found.items()]


def by_threads(repeats: int, device: str) -> list[Series]:
    """A frame of the preset and its branches, by threads of the CPU."""
    import numba

    from tracer.worlds import builtin

    before, found = torch.get_num_threads(), defaultdict(list)
    most = min(cores(), numba.config.NUMBA_NUM_THREADS)  # pyright: ignore
    frame = _frame(builtin().to(device), SMALL)
    try:
        for count in sorted({*(2**n for n in range(most.bit_length())), most}):
            torch.set_num_threads(count)
            for name, ms in time_frames(frame, repeats, device).items():
                found[name].append((count, ms))
    finally:
        torch.set_num_threads(before)
    return [Series(name=name, points=points) for name, points in found.items()]


AXES: Mapping[str, Callable[[int, str], list[Series]]] = {
    "pixels": by_pixels,
    "directions or samples": by_samples,
    "lamps": by_lamps,
    "voxels on a side": by_side,
    "threads": by_threads,
}
"""What time is measured against, by its name."""


def axes_of(device: str) -> dict[str, Callable[[int, str], list[Series]]]:
    """Those of `AXES` that say something about a device: threads are the CPU's."""
    return {name: measure for name, measure in AXES.items() if device == "cpu" or measure is not by_threads}


def time_frames(frame: Frame, repeats: int, device: str) -> dict[str, float]:
    """Median milliseconds of all passes of the preset, and of each branch, over frames with a history."""
    from post.presets import me1

    pipeline, state, spent = me1(PRESET), None, defaultdict(float)

    def now(_: str) -> float:
        wait(device)
        return time.perf_counter()

    def end(name: str, begun: float) -> None:
        seconds = now(name) - begun
        spent["all passes"] += seconds
        head = name.partition(".")[0]
        if head in BRANCHES:
            spent[BRANCHES[head]] += seconds

    frames = []
    with torch.no_grad(), around_passes(pipeline, now, end):
        for index in range(repeats + 1):
            spent.clear()
            _, state = pipeline(frame.replace(index=index), state)
            frames.append(dict(spent))
    return {name: median(times[name] for times in frames[1:]) * 1e3 for name in frames[0]}


def lamps_over_a_floor(count: int) -> Scene:
    """A floor under so many lamps of one voxel each, alike and nowhere next to one another, at night.

    Raises:
        ValueError: there is no room for so many.
    """
    from tracer.scene.material import Material, MaterialTable
    from tracer.scene.scene import Scene
    from tracer.scene.view import View
    from tracer.scene.world import World

    pitch = FLOOR // APART
    if not 0 < count <= pitch * pitch:
        raise ValueError(f"count must be 1 to {pitch * pitch}, got {count}")
    materials = MaterialTable.of([Material(name="stone"), Material(name="lamp", emission=(20.0, 16.0, 10.0))])
    voxels = torch.zeros(FLOOR, HEIGHT, FLOOR, dtype=torch.int16)
    voxels[:, 0] = materials.names.index("stone")
    places = torch.randperm(pitch * pitch, generator=torch.Generator().manual_seed(0))[:count]
    voxels[places // pitch * APART, HEIGHT // 4, places % pitch * APART] = materials.names.index("lamp")
    view = View(eye=lambda _: (8.0, 20.0, 8.0), target=lambda _: (FLOOR / 2, 0.0, FLOOR / 2))
    return Scene(world=World.from_dense(voxels, materials), sun=None, views={"across": view})


def _frame(scene: Scene, size: Size) -> Frame:
    from tracer.frames import render

    camera = _camera(scene, size).to(scene.world.device)
    return render(scene, camera, previous_camera=camera, light_samples=1)


def _camera(scene: Scene, size: Size) -> Any:
    return next(iter(scene.views.values())).camera(0.0, size=size)
