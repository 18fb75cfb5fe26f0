"""Frames of the built-in world: tracing them, and the passes over them."""

from __future__ import annotations

import time
from collections import defaultdict
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

from gbufrt.commands.benchmark.process import peak_memory, timed, wait
from gbufrt.commands.busy import beside, cores, fair_slowdown

if TYPE_CHECKING:
    from gbufrt.frame import Frame
    from gbufrt.pipeline import Pipeline

HD = (1080, 1920)
HD_REPEATS = 2  # frames with a history
SMALL = (270, 480)  # what Minecraft RTX's frame is traced at, and ME1's beside it has


def make_frame(path: Path, size: tuple[int, int], device: str) -> None:
    """Write one frame of the built-in world as an EXR file."""
    from gbufrt.files.exr import write_exr
    from tracer.frames import render
    from tracer.worlds import builtin

    scene = builtin()
    camera = next(iter(scene.views.values())).camera(0.0, size=size).to(device)
    write_exr(path, render(scene.to(device), camera, previous_camera=camera, light_samples=1))


def time_tracing(size: tuple[int, int], repeats: int) -> float:
    """Milliseconds of tracing that frame with as many light samples as `tracer.render` takes by itself, on the CPU."""
    from tracer.frames import render
    from tracer.worlds import builtin

    scene = builtin()
    camera = next(iter(scene.views.values())).camera(0.0, size=size)
    return timed(lambda: render(scene, camera, previous_camera=camera), repeats)


def compare_rtx(repeats: int) -> dict[str, float]:
    """Milliseconds of steady frames on the CPU: ``ms`` of `minecraft_rtx` high, which makes `SMALL` twice as large, and
    ``me1_ms`` of `me1` high at `SMALL`.
    """
    import torch

    from gbufrt.commands.flights.job import without_ambient
    from post import me1, minecraft_rtx
    from tracer.frames import render
    from tracer.paths.sampled import sampled
    from tracer.worlds import builtin

    scene = builtin()
    camera = next(iter(scene.views.values())).camera(0.0, size=SMALL)
    first, lit = (render(scene, camera, previous_camera=camera, light_samples=1, index=index) for index in (0, 1))
    noisy = without_ambient(sampled(scene, lit, before=first))

    def steady(pipeline: Any, frame: Any) -> float:
        frames = pipeline.stream(frame.replace(index=index) for index in range(repeats + 2))
        next(frames)
        return timed(lambda: next(frames), repeats)

    with torch.no_grad():
        return {"ms": steady(minecraft_rtx("high"), noisy), "me1_ms": steady(me1("high"), lit)}


def time_passes(path: Path, preset: str, repeats: int, device: str, busy: int = 0) -> dict[str, Any]:
    """Milliseconds of each pass and the peak memory of this process, over the frame in an EXR file; on a GPU also those
    of the frame as a CUDA graph, ``captured_ms``."""
    import torch

    from gbufrt.commands.profile import around_passes
    from gbufrt.commands.recipe import Recipe
    from gbufrt.commands.session import bare
    from gbufrt.files.exr import read_exr
    from gbufrt.specimen import specimen

    pipeline = Recipe(preset=preset).build()
    pipeline.compile(specimen().to(device))  # first: a compiler's memory would lie between the frame's planes
    frame = bare(read_exr(path)).to(device)
    spent: dict[str, list[float]] = defaultdict(list)

    def now(_: str) -> float:
        wait(device)
        return time.perf_counter()

    def end(name: str, begun: float) -> None:
        spent[name].append((now(name) - begun) * 1e3)

    def total() -> float:
        results, totals = pipeline.stream(frame.replace(index=index) for index in range(repeats + 1)), []
        for _ in range(repeats + 1):
            start = time.perf_counter()
            next(results)
            wait(device)
            totals.append((time.perf_counter() - start) * 1e3)
        return median(totals[1:])

    with torch.no_grad():
        with around_passes(pipeline, now, end):
            alone = total()
        passes = {name: median(times[1:]) for name, times in spent.items()}
        figures: dict[str, Any] = {"passes_ms": passes, "total_ms": alone, "peak_mb": peak_memory()}
        if device != "cpu":
            figures["captured_ms"] = time_captured(pipeline, frame, repeats)
        if busy:
            with beside(busy):
                crowded = total()
            share = crowded / (alone * fair_slowdown(torch.get_num_threads(), busy, cores()))
            figures["busy"] = {"processes": busy, "total_ms": crowded, "over_fair_share": share}
    return figures


def time_captured(pipeline: Pipeline, frame: Frame, repeats: int) -> float:
    """Milliseconds of a steady frame, its inputs copied to where the CUDA graph of a pipeline reads them."""
    from gbufrt.captured import Captured

    graph = Captured(pipeline, frame)
    graph(frame)  # the first frame runs without the graph
    return timed(lambda: graph(frame), repeats, frame.gbuffer.depth.device.type)
