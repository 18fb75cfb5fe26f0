"""What bench found, on the terminal and as a chart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import cycle
from typing import Any

from gbufrt.commands.benchmark.bars import Row
from gbufrt.commands.benchmark.run import Results
from gbufrt.commands.benchmark.scaling import Series


def show(found: Results) -> None:
    """All that was measured, as tables; the bars last."""
    show_figures(found.figures)
    show_series(found.series)
    if found.rows:
        show_bars(found.rows)


def show_figures(figures: dict[str, Any]) -> None:
    """Rays, passes and other denoisers."""
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
    if all("captured_ms" in found for found in presets.values()):
        table.add_row("all passes, captured", *(f"{found['captured_ms']:.1f}" for found in presets.values()))
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
    if "version" in figures.get("blender", {}):
        _show_blender(figures["blender"], console)
    if "octree" in figures:
        _show_octree(figures["octree"], console)


def _show_peers(rows: list[dict[str, Any]], console: Any) -> None:
    from rich import box
    from rich.table import Table

    table = Table("ambient occlusion of one ray a pixel, denoised by", box=box.SIMPLE_HEAD)
    for title in ("median ms", "PSNR, dB"):
        table.add_column(title, justify="right")
    for row in rows:
        table.add_row(row["name"], f"{row['ms']:.1f}" if row["ms"] else "", f"{row['psnr']:.1f}")
    console.print(table)


def _show_blender(found: dict[str, Any], console: Any) -> None:
    from rich import box
    from rich.table import Table

    table = Table("lens, 1920x1080; PSNR at 480x270", box=box.SIMPLE_HEAD)
    for title in ("median ms", "PSNR, dB"):
        table.add_column(title, justify="right")
    for name, theirs in (("motion_blur", "Vector Blur"), ("depth_of_field", "Defocus")):
        one = found[name]
        table.add_row(f"post.{name}", f"{one['ms']:.0f}", f"{one['psnr']:.1f}")
        table.add_row(f"Blender {found['version']}, {theirs}", f"{one['blender_ms']:.0f}", f"{one['blender_psnr']:.1f}")
        table.add_row("  without either", "", f"{one['sharp_psnr']:.1f}", end_section=True)
    console.print(table)


def _show_octree(found: dict[str, dict[str, float]], console: Any) -> None:
    from rich import box
    from rich.table import Table

    table = Table("terrain, 854x480", box=box.SIMPLE_HEAD)
    titles = {"horizon": "to the horizon, Mrays/s", "grazing": "grazing, Mrays/s", "voxels": "bytes a voxel"}
    for title in titles.values():
        table.add_column(title, justify="right")
    for form in found["voxels"]:
        table.add_row(form, *(f"{found[name][form]:.2f}" for name in titles))
    console.print(table)


def show_series(found: Mapping[str, list[Series]]) -> None:
    """A table for each quantity: what it was across, what was timed down, and the fitted exponent."""
    from rich import box
    from rich.console import Console
    from rich.table import Table

    for axis, series in found.items():
        table = Table(f"median ms, by {axis}", box=box.SIMPLE_HEAD)
        for x, _ in series[0].points:
            table.add_column(f"{x:g}", justify="right")
        table.add_column("growth", justify="right")
        for one in series:
            table.add_row(one.name, *(f"{ms:.1f}" for _, ms in one.points), growth(one))
        Console().print(table)


def chart_of(found: Mapping[str, list[Series]]) -> str:
    """The series as a sheet of charts with logarithmic axes, an SVG file."""
    from gbufrt.commands.charts.drawing import NARROW, lines
    from gbufrt.commands.charts.sheet import sheet
    from gbufrt.commands.charts.style import HUES

    charts = {}
    names = dict.fromkeys(one.name for series in found.values() for one in series)
    hue_of = dict(zip(names, cycle(HUES), strict=False))  # the same on every chart
    for axis, series in found.items():
        labels = {one.name: f"{one.name}: {growth(one)}".removesuffix(": ") for one in series}
        named = {labels[one.name]: one.points for one in series}
        hues = {label: hue_of[name] for name, label in labels.items()}
        charts[f"Time by {axis}"] = lines(named, x_label=axis, y_label="median ms", width=NARROW, hues=hues)
    return sheet(charts)


def growth(series: Series) -> str:
    """The fitted power, such as ``n^0.94``; empty where there is none."""
    return "" if series.exponent is None else f"n^{series.exponent:.2f}"


def show_bars(rows: Sequence[Row]) -> None:
    """The bars, what was measured of each, and whether it is reached."""
    from rich import box
    from rich.console import Console
    from rich.table import Table

    table = Table("bars", "measured", "bar", "reached", box=box.SIMPLE_HEAD)
    for row in rows:
        table.add_row(row.name, row.measured, row.bar, row.verdict)
    Console().print(table)
