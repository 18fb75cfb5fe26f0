"""The page: one HTML file with everything in it, and the same table for a terminal."""

from __future__ import annotations

import base64
import io
from collections.abc import Mapping, Sequence
from datetime import timedelta
from functools import cache
from pathlib import Path
from typing import Any

from gbufrt.commands.ablation.front import EFFECTS, Effect, Setting, front, settings_of
from gbufrt.commands.ablation.records import Record
from gbufrt.commands.ablation.sections import SECTIONS, Section
from gbufrt.commands.ablation.table import Results
from gbufrt.commands.ablation.variants import FULL
from gbufrt.commands.ablation.world import SECTIONS as WORLD
from gbufrt.commands.charts.drawing import NARROW, WIDTH, Point, dots, scatter
from gbufrt.commands.charts.sheet import sheet
from gbufrt.commands.charts.style import COLOURS, STYLE
from gbufrt.files.output import write_text

JPEG_QUALITY = 88
MAIN = ("rmse", "psnr", "ssim", "flip", "loss", "flicker", "ghosting", "ao.rmse", "gi.error", "reflection.mirror")


def write_page(out: Path, results: Results) -> Path:
    """``report.html``, which loads nothing."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    ink = Environment(
        loader=PackageLoader("gbufrt.commands.ablation", "."), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    ink.filters["number"] = number
    text = ink.get_template("page.html").render(
        colours=COLOURS.strip(), style=STYLE.strip(),
        about=results.about, rows=[row for row in results.rows if row.part == "passes"],
        world_rows=[row for row in results.rows if row.part == "world"],
        sections=[_section(out, s, results.records) for s in (*SECTIONS, *WORLD)],
        fronts=fronts(results.records),
        earned=earned(results.records), worth=worth(results.records), costs=costs(results.records),
        failures=results.failures, records=results.records, main=[m for m in MAIN if _any(results.records, m)],
        beside=max((r.beside for r in results.records), default=1),
        took=str(timedelta(seconds=round(results.about["seconds"]))),
    )  # fmt: skip
    write_text(out / "report.html", text)
    return out / "report.html"


def show(results: Results) -> None:
    """The table on the terminal."""
    from rich import box
    from rich.console import Console
    from rich.table import Table

    table = Table("pass", "figure", "worst view", "trivial answers", box=box.SIMPLE_HEAD)
    for name in ("found", "must reach"):
        table.add_column(name, justify="right")
    for row in results.rows:
        known = {label: value for label, value in row.trivial.items() if value is not None}
        trivial = ", ".join(f"{label} {number(value)}" for label, value in known.items())
        found = "–" if row.value is None else number(row.value)
        mark = "" if row.reached is None else " ✓" if row.reached else " ✗"
        bound = f"{'≤' if row.better == 'lower' else '≥'} {row.bound:g}"
        table.add_row(row.name, row.what, row.view or "–", trivial or row.note, found + mark, bound)
    Console().print(table)


def number(value: Any) -> str:
    """A number in three digits, or a dash."""
    if value is None:
        return "–"
    return f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"


def earned(records: Sequence[Record]) -> str:
    """The loss from leaving each stage out, by view."""
    rows: dict[str, dict[str, float]] = {}
    for record in records:
        if record.subject == "frame" and record.group == "passes" and "loss" in record.figures:
            rows.setdefault(record.variant.replace("without=", "without "), {})[record.view] = record.figures["loss"]
    return dots(list(rows.items()), label="dB of PSNR lost on the pixels that it changes, a dot for each view")


def worth(records: Sequence[Record]) -> str:
    """Quality against cost of whole frames."""
    return _cost_chart([r for r in records if r.subject == "frame"], "psnr", "PSNR to the path-traced frame, dB")


def costs(records: Sequence[Record]) -> list[tuple[str, float, float]]:
    """Milliseconds and megabytes of each pass of the full pipeline, means over views."""
    found: dict[str, list[Mapping[str, float]]] = {}
    for record in records:
        if record.variant == FULL and record.subject in ("frame", "taa", "motion_blur", "depth_of_field"):
            for name, cost in record.passes.items():
                name = name.replace("_small", "").replace("_large", "").replace("_centred", "").replace("_trailing", "")
                if record.subject != "taa" or name == "taa":
                    found.setdefault(name, []).append(cost)
    return [(name, _mean(c["ms"] for c in all_), _mean(c["peak_mb"] for c in all_)) for name, all_ in found.items()]


def fronts(records: Sequence[Record], width: int = WIDTH) -> dict[str, str]:
    """Error against time of each effect's settings, by title: presets named, the front joined.

    Where there are several places, each has charts of its own, with the place in their titles.
    """
    own = [r for r in records if r.subject == "front" and r.figures]
    charts = {}
    for record in own:
        for effect in EFFECTS:
            title = effect.title if len(own) == 1 else f"{effect.title}, {record.world}: {record.view}"
            charts[title] = _front_chart(effect, settings_of(record.figures, effect.signal), width)
    return {title: chart for title, chart in charts.items() if chart}


def write_front(out: Path, records: Sequence[Record]) -> Path | None:
    """``front.svg``, the charts of `fronts` on one sheet; None where there are none, and that of a run before goes."""
    charts = fronts(records, NARROW)
    if not charts:
        (out / "front.svg").unlink(missing_ok=True)
        return None
    write_text(out / "front.svg", sheet(charts))
    return out / "front.svg"


def _front_chart(effect: Effect, settings: Sequence[Setting], width: int) -> str:
    best = front(settings)
    points = {
        s.name: Point(
            x=s.ms, y=s.error, label=s.name if s.preset or s in best else "", title=s.name, minor=not s.preset,
            group="presets" if s.preset else "own",
        )
        for s in settings
    }  # fmt: skip
    x_label = f"ms a frame of processor time; small: {' x '.join(effect.grid)}"
    joined = [points[s.name] for s in best]
    shown = list(points.values())
    return scatter(shown, x_label=x_label, y_label=effect.error, front=joined, log="x", width=width)


def _section(out: Path, section: Section, records: Sequence[Record]) -> dict[str, Any]:
    """What a section of the page shows."""
    own = [r for r in records if r.subject == section.subject and any(k in r.figures for k in section.figures)]
    pictures: dict[str, dict[str, str]] = {}
    for record in own:
        views = pictures.setdefault(record.view, {})
        for name, path in record.pictures.items():
            label = section.label(name, record.variant)
            if label is not None and (out / path).exists():
                views.setdefault(label, _data_uri(out / path))
    sweeps: dict[str, list[Record]] = {}
    for record in own:
        if record.axis is not None:
            sweeps.setdefault(record.axis[0], []).append(record)
    lines = [_line_chart(name, steps, section.figures[0], section) for name, steps in sweeps.items()]
    others = len({r.variant for r in own}) > 1
    key = section.figures[0]
    chart = _cost_chart(own, key, section.names.get(key, key)) if others and section.subject != "frame" else ""
    return {
        "section": section, "records": own, "pictures": pictures, "charts": [c for c in (chart, *lines) if c],
        "figures": [key for key in section.figures if _any(own, key)],
    }  # fmt: skip


def _cost_chart(records: Sequence[Record], key: str, label: str) -> str:
    variants = list(dict.fromkeys(r.variant for r in records if key in r.figures))
    points = []
    for name in variants:
        some = [r for r in records if r.variant == name and key in r.figures]
        ms, value = _mean(r.ms for r in some), _mean(r.figures[key] for r in some)
        points.append(Point(x=ms, y=value, label=name.replace("without=", "without "), group=some[0].group))
    return scatter(points, x_label="ms a frame, mean over views", y_label=label)


def _line_chart(name: str, steps: Sequence[Record], key: str, section: Section) -> str:
    values: dict[float, list[float]] = {}
    for record in steps:
        if record.axis is not None and key in record.figures:
            values.setdefault(record.axis[1], []).append(record.figures[key])
    points = [Point(x=x, y=_mean(ys), label="", group="sweep") for x, ys in values.items()]
    return scatter(points, x_label=name, y_label=section.names.get(key, key), line=True)


@cache
def _data_uri(path: Path) -> str:
    from PIL import Image

    data = io.BytesIO()
    Image.open(path).convert("RGB").save(data, "JPEG", quality=JPEG_QUALITY)
    return "data:image/jpeg;base64," + base64.b64encode(data.getvalue()).decode()


def _mean(values: Any) -> float:
    values = list(values)
    return sum(values) / len(values) if values else float("nan")


def _any(records: Sequence[Record], key: str) -> bool:
    return any(key in record.figures for record in records)
