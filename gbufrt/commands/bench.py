"""`gbufrt bench`: time and memory of the passes."""

from __future__ import annotations

import json as jsonlib
from pathlib import Path
from shutil import which
from typing import Annotated

from cyclopts import Parameter

from gbufrt.commands.arguments.checks import PRESETS, check_file, check_name
from gbufrt.commands.arguments.values import MOST_COUNT, Flag, Whole, at_least, check_device, parse_names, parse_size


def bench(
    *,
    presets: Annotated[tuple[str, ...], Parameter(negative="")] = ("high",),
    size: str = "960x540",
    repeats: Whole = 5,
    device: str = "cpu",
    busy: Whole = 0,
    peers: Flag = False,
    blender: str | None = None,
    scaling: Flag = False,
    chart: Path | None = None,
    json: Path | None = None,
) -> None:
    """Time every pass of a preset and the tracing of primary rays, and measure the peak memory.

    Each preset runs in a process of its own, over one frame of the built-in world read from an EXR file, so that its
    peak memory is its own: interpreter, libraries, frame and passes together. With --peers or --scaling, a run on the
    CPU ends with a table of bars: what the speed of the whole must reach, what was measured, and whether it is reached.

    Args:
        presets: Presets to time; may be repeated, or name several with commas.
        size: Width x height of the frame in pixels.
        repeats: Runs that each median is taken over; one run before them does not count.
        device: cpu, or cuda where there is a CUDA device.
        busy: Also run the passes beside this many busy processes, and report how their time compares with the fair
            share of the machine's cores: 1 is fair, more means that threads wait for one another.
        peers: Also denoise ambient occlusion of one ray a pixel with our spatial filters, kornia's joint bilateral, and
            Intel Open Image Denoise where pyoidn is installed: time and PSNR of each. And blur one frame by our lens
            passes and by Blender's Vector Blur and Defocus, where there is bpy.
        blender: With --peers: the Python that has bpy. [default: this one]
        scaling: Also measure how time grows with pixels, samples, lamps, the size of the world, and threads, and rays
            through an octree beside those through bricks.
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
    if blender is not None:
        _check_blender(blender, peers)
    if chart is not None:
        _check_chart(chart, scaling)
    if json is not None:
        check_file("--json", json)

    from gbufrt.commands.benchmark import report
    from gbufrt.commands.benchmark.blender import blender_python
    from gbufrt.commands.benchmark.run import Plan, measure
    from gbufrt.commands.session import open_device
    from gbufrt.files.output import write_text

    open_device(device)
    plan = Plan(
        presets=names, size=shape, repeats=repeats, device=device, busy=busy, peers=peers,
        blender=blender or blender_python(), scaling=scaling,
    )  # fmt: skip
    found = measure(plan)
    report.show(found)
    if json is not None:  # first: it holds all that the chart draws
        write_text(json, jsonlib.dumps(found.to_json(), indent=2) + "\n")
    if chart is not None:
        write_text(chart, report.chart_of(found.series))


def _check_blender(python: str, peers: bool) -> None:
    if not peers:
        raise ValueError("--blender says where --peers finds bpy; add --peers")
    if which(python) is None:
        raise ValueError(f"--blender must be a Python that has bpy, such as VENV/bin/python; there is no {python!r}")


def _check_chart(chart: Path, scaling: bool) -> None:
    if not scaling:
        raise ValueError("--chart draws what --scaling measures; add --scaling")
    if chart.suffix.lower() != ".svg":
        raise ValueError(f"--chart must be a file that ends in .svg, got {str(chart)!r}")
    check_file("--chart", chart)
