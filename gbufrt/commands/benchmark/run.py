"""A run of bench: what it measures, in order."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from gbufrt.commands.benchmark import bars, blender, frames, peers, process, rays, scaling
from gbufrt.commands.benchmark.bars import Row
from gbufrt.commands.benchmark.scaling import Series
from gbufrt.commands.progress import progress


@dataclass(frozen=True, kw_only=True)
class Plan:
    """What to measure."""

    presets: Sequence[str]
    size: tuple[int, int]
    """``(H, W)``."""
    repeats: int
    device: str = "cpu"
    busy: int = 0
    peers: bool = False
    blender: str | None = None
    """A Python that has bpy."""
    scaling: bool = False

    @property
    def judged(self) -> bool:
        """Whether the run ends with the bars, which are the CPU's."""
        return self.device == "cpu" and (self.peers or self.scaling)


@dataclass(frozen=True, kw_only=True)
class Results:
    """What was found."""

    figures: dict[str, Any]
    """By the names that they have in the file of --json, without the two below."""
    series: dict[str, list[Series]]
    rows: list[Row]

    def to_json(self) -> dict[str, Any]:
        """All of it as JSON values."""
        found = {**self.figures}
        if self.series:
            found["scaling"] = {axis: [one.to_json() for one in series] for axis, series in self.series.items()}
        if self.rows:
            found["bars"] = [row.to_json() for row in self.rows]
        return found


@dataclass(frozen=True)
class _Step:
    key: str
    name: str
    """Of one of several with the same key; empty for the only one."""
    doing: str
    run: Callable[[], Any]


def measure(plan: Plan) -> Results:
    """Measure all that is planned, with progress."""
    figures: dict[str, Any] = {"machine": process.machine(), "size": [*reversed(plan.size)], "device": plan.device}
    figures["presets"] = {}
    with tempfile.TemporaryDirectory() as folder:
        steps = list(_steps(plan, Path(folder)))
        with progress("bench", len(steps)) as doing:
            for step in steps:
                tick = doing(step.doing)
                found = step.run()
                if step.name:
                    figures.setdefault(step.key, {})[step.name] = found
                elif step.key:
                    figures[step.key] = found
                tick()
    results = Results(figures=figures, series=figures.pop("scaling", {}), rows=[])
    if plan.judged:
        results.rows.extend(bars.table(results.to_json()))
    return results


def _steps(plan: Plan, folder: Path) -> Iterator[_Step]:
    size, repeats, device = plan.size, plan.repeats, plan.device
    frame, hd = folder / "frame.exr", folder / "hd.exr"
    yield _Step("rays", "", "primary rays", partial(rays.time_rays, repeats, device))
    yield _Step("", "", "a frame", partial(frames.make_frame, frame, size, device))
    for name in plan.presets:
        arguments = (frames.time_passes, frame, name, repeats, device, plan.busy)
        yield _Step("presets", name, f"preset {name}", partial(process.in_own_process, *arguments))
    if plan.peers:
        yield _Step("peers", "", "denoisers", partial(peers.compare_peers, size, repeats))
    for axis, by in scaling.axes_of(device).items() if plan.scaling else ():
        yield _Step("scaling", axis, f"time by {axis}", partial(by, repeats, device))
    if not plan.judged:
        return
    yield _Step("tracing_ms", "", "tracing a frame", partial(frames.time_tracing, size, repeats))
    yield _Step("rtx", "", "Minecraft RTX", partial(frames.compare_rtx, repeats))
    yield _Step("rates", "", "other rays", partial(rays.time_other_rays, repeats))
    if plan.peers:
        yield _Step("oidn_ms", "", "OIDN", partial(peers.time_oidn, frame, repeats))
        yield _Step("filters_ms", "", "denoisers at 1080p", partial(peers.time_filters, repeats))
        yield _Step("blender", "", "Blender", partial(blender.compare_blender, plan.blender, repeats))
    if plan.scaling:
        yield _Step("worlds", "", "a large world", partial(rays.compare_worlds, repeats))
        yield _Step("octree", "", "an octree", partial(rays.compare_octree, repeats))
    yield _Step("", "", "a frame at 1080p", partial(frames.make_frame, hd, frames.HD, device))
    arguments = (frames.time_passes, hd, "high", frames.HD_REPEATS, device)
    yield _Step("hd", "", "preset high at 1080p", partial(process.in_own_process, *arguments))
    yield _Step("import_s", "", "importing", process.import_seconds)
