"""`gbufrt bench`: time and memory of the passes."""

from __future__ import annotations

import json as jsonlib
import platform
import sys
import tempfile
import time
from collections import defaultdict
from pathlib import Path
from statistics import median
from typing import Annotated, Any

from cyclopts import Parameter

from gbufrt.commands.busy import beside, cores, fair_slowdown
from gbufrt.commands.checks import PRESETS, check_file, check_name
from gbufrt.commands.options import MOST_COUNT, Flag, Whole, at_least, check_device, parse_names, parse_size

TRACE_SIZE = (480, 854)
MEGA = 1e6


def bench(
    *,
    presets: Annotated[tuple[str, ...], Parameter(negative="")] = ("high",),
    size: str = "960x540",
    repeats: Whole = 5,
    device: str = "cpu",
    busy: Whole = 0,
    peers: Flag = False,
    scaling: Flag = False,
    chart: Path | None = None,
    json: Path | None = None,
) -> None:
    """Time every pass of a preset and the tracing of primary rays, and measure the peak memory.

    Each preset runs in a process of its own, over one frame of the built-in world read from an EXR file, so that its
    peak memory is its own: interpreter, libraries, frame and passes together.

    Args:
        presets: Presets to time; may be repeated, or name several with commas.
        size: Width x height of the frame in pixels.
        repeats: Runs that each median is taken over; one run before them does not count.
        device: cpu, or cuda where there is a CUDA device.
        busy: Also run the passes beside this many busy processes, and report how their time compares with the fair
            share of the machine's cores: 1 is fair, more means that threads wait for one another.
        peers: Also denoise ambient occlusion of one ray a pixel with our spatial filters, kornia's joint bilateral, and
            Intel Open Image Denoise where pyoidn is installed: time and PSNR of each.
        scaling: Also measure how time grows with pixels, samples, lamps, the size of the world, and threads.
        chart: Also draw what --scaling finds, into this SVG file.
        json: Also write the figures to this file.
    """
    shape = parse_size(size)
    at_least("--repeats", repeats, 1, MOST_COUNT)
    at_least("--busy", busy, 0, MOST_COUNT)
    check_device(device)
    names = parse_names(presets)
    for name in names:
        check_name("--presets", name, PRESETS)
    if chart is not None:
        _check_chart(chart, scaling)
    if json is not None:
        check_file("--json", json)

    from gbufrt.commands.progress import progress
    from gbufrt.commands.scaling import axes_of, chart_of, show_series
    from gbufrt.commands.session import open_device
    from gbufrt.files.output import write_text

    open_device(device)
    figures: dict[str, Any] = {"machine": machine(), "size": [shape[1], shape[0]], "device": device, "presets": {}}
    axes = axes_of(device) if scaling else {}
    with progress("bench", 1 + len(names) + peers + len(axes)) as doing, tempfile.TemporaryDirectory() as folder:
        tick = doing("tracing")
        figures["rays"] = time_rays(repeats, device)
        frame = make_frame(Path(folder), shape, device)
        tick()
        for name in names:
            tick = doing(f"preset {name}")
            figures["presets"][name] = _in_own_process(frame, name, repeats, device, busy)
            tick()
        if peers:
            from gbufrt.commands.peers import compare_peers

            tick = doing("denoisers")
            figures["peers"] = compare_peers(shape, repeats)
            tick()
        found = {}
        for axis, measure in axes.items():
            tick = doing(f"time by {axis}")
            found[axis] = measure(repeats, device)
            tick()
    _show(figures)
    if found:
        show_series(found)
        figures["scaling"] = {axis: [one.to_json() for one in series] for axis, series in found.items()}
    if json is not None:  # first: it holds all that the chart draws
        write_text(json, jsonlib.dumps(figures, indent=2) + "\n")
    if chart is not None:
        write_text(chart, chart_of(found))


def machine() -> str:
    """One line that says what the figures were measured on."""
    import os

    import torch

    model = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        lines = [line for line in info.read_text().splitlines() if line.startswith("model name")]
        model = lines[0].partition(":")[2].strip() if lines else model
    gpu = f", {torch.cuda.get_device_name()}" if torch.cuda.is_available() else ""
    return (
        f"{model}, {os.cpu_count()} cores, {torch.get_num_threads()} threads{gpu}; {platform.system()}, "
        f"Python {platform.python_version()}, torch {torch.__version__}"
    )


def time_rays(repeats: int, device: str = "cpu", size: tuple[int, int] = TRACE_SIZE) -> dict[str, float]:
    """Primary rays through 256x128x256 voxels of terrain, looking along it to the horizon."""
    from tracer.traversal.rays import trace
    from tracer.worlds import terrain

    scene = terrain()
    origins, directions = next(iter(scene.views.values())).camera(0.0, size=size).rays()
    scene, origins, directions = scene.to(device), origins.to(device), directions.to(device)
    seconds = []
    for _ in range(repeats + 1):
        start = time.perf_counter()
        trace(scene, origins, directions)
        _wait(device)
        seconds.append(time.perf_counter() - start)
    middle = median(seconds[1:])
    return {"ms": middle * 1e3, "mrays_per_s": size[0] * size[1] / middle / MEGA}


def time_passes(path: Path, preset: str, repeats: int, device: str, busy: int = 0) -> dict[str, Any]:
    """Milliseconds of each pass and the peak memory of this process, over the frame in an EXR file."""
    import torch

    from gbufrt.commands.profile import around_passes
    from gbufrt.commands.session import Recipe, bare
    from gbufrt.files.exr import read_exr

    pipeline, frame = Recipe(preset=preset).build(), bare(read_exr(path)).to(device)
    spent: dict[str, list[float]] = defaultdict(list)

    def now(_: str) -> float:
        _wait(device)
        return time.perf_counter()

    def end(name: str, begun: float) -> None:
        spent[name].append((now(name) - begun) * 1e3)

    def total() -> float:
        state, totals = None, []
        for index in range(repeats + 1):
            start = time.perf_counter()
            _, state = pipeline(frame.replace(index=index), state)
            _wait(device)
            totals.append((time.perf_counter() - start) * 1e3)
        return median(totals[1:])

    with torch.no_grad():
        with around_passes(pipeline, now, end):
            alone = total()
        passes = {name: median(times[1:]) for name, times in spent.items()}
        figures: dict[str, Any] = {"passes_ms": passes, "total_ms": alone, "peak_mb": peak_memory()}
        if busy:
            with beside(busy):
                crowded = total()
            share = crowded / (alone * fair_slowdown(torch.get_num_threads(), busy, cores()))
            figures["busy"] = {"processes": busy, "total_ms": crowded, "over_fair_share": share}
    return figures


def peak_memory() -> float | None:
    """Peak memory of this process, in megabytes; None where the system does not report it."""
    try:
        import resource
    except ImportError:
        return None
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / MEGA


def make_frame(folder: Path, size: tuple[int, int], device: str) -> Path:
    """One frame of the built-in world as an EXR file."""
    from gbufrt.files.exr import write_exr
    from tracer.frames import render
    from tracer.worlds import builtin

    scene = builtin()
    camera = next(iter(scene.views.values())).camera(0.0, size=size).to(device)
    frame = render(scene.to(device), camera, previous_camera=camera, light_samples=1)
    write_exr(folder / "frame.exr", frame)
    return folder / "frame.exr"


def _in_own_process(*arguments: Any) -> dict[str, Any]:
    import signal
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    quiet = (signal.SIGINT, signal.SIG_DFL)  # Ctrl-C ends the child without a traceback
    with ProcessPoolExecutor(1, get_context("spawn"), initializer=signal.signal, initargs=quiet) as pool:
        return pool.submit(time_passes, *arguments).result()


def _check_chart(chart: Path, scaling: bool) -> None:
    if not scaling:
        raise ValueError("--chart draws what --scaling measures; add --scaling")
    if chart.suffix.lower() != ".svg":
        raise ValueError(f"--chart must be a file that ends in .svg, got {str(chart)!r}")
    check_file("--chart", chart)


def _wait(device: str) -> None:
    if device != "cpu":
        import torch

        torch.cuda.synchronize(device)


def _show(figures: dict[str, Any]) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table

    table = Table("pass, median ms", box=box.SIMPLE_HEAD)
    presets = figures["presets"]
    for name in presets:
        table.add_column(name, justify="right")
    for stage in dict.fromkeys(stage for found in presets.values() for stage in found["passes_ms"]):
        times = [found["passes_ms"].get(stage) for found in presets.values()]
        table.add_row(stage, *("" if ms is None else f"{ms:.1f}" for ms in times))
    table.add_section()
    table.add_row("all passes", *(f"{found['total_ms']:.1f}" for found in presets.values()))
    table.add_row("peak memory, MB", *(f"{found['peak_mb'] or 0:.0f}" for found in presets.values()))
    crowded = [found["busy"] for found in presets.values() if "busy" in found]
    if crowded:
        title = f"beside {crowded[0]['processes']} busy processes"
        table.add_row(title, *(f"{found['total_ms']:.1f}" for found in crowded))
        table.add_row("  over its fair share", *(f"{found['over_fair_share']:.2f}" for found in crowded))
    console, rays = Console(), figures["rays"]
    console.print(figures["machine"], markup=False, highlight=False)
    width, height = figures["size"]
    console.print(f"passes at {width}x{height}; primary rays over terrain, 854x480: ", end="", markup=False)
    console.print(f"{rays['mrays_per_s']:.2f} Mrays/s ({rays['ms']:.0f} ms)", markup=False)
    console.print(table)
    if "peers" in figures:
        _show_peers(figures["peers"], console)


def _show_peers(rows: list[dict[str, Any]], console: Any) -> None:
    from rich import box
    from rich.table import Table

    table = Table("ambient occlusion of one ray a pixel, denoised by", box=box.SIMPLE_HEAD)
    for title in ("median ms", "PSNR, dB"):
        table.add_column(title, justify="right")
    for row in rows:
        table.add_row(row["name"], f"{row['ms']:.1f}" if row["ms"] else "", f"{row['psnr']:.1f}")
    console.print(table)
