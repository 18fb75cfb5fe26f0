"""Small charts as SVG: in a page, which gives them its colours by `STYLE`, or as a file with colours of its own."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from itertools import cycle

from gbufrt.commands.axes import Axis, short

WIDTH, LEFT, RIGHT, ROW = 760, 190, 24, 24
HEIGHT, TOP, BOTTOM = 340, 16, 44
AXIS_LEFT, AXIS_RIGHT = 64, WIDTH - 150  # of charts with two axes: names stand right of their points
LABEL = 13  # pixels between labels that would overlap
MOST_TICKS = 7  # places of a series that each get a tick
GROUPS = ("full", "passes", "presets", "methods", "sweep", "own")
HUES = ("mark", "other", "third", "bad")
COLOURS = """
:root { color-scheme: light dark; --ink: #1c1e21; --soft: #6a6f76; --paper: #fdfdfc; --line: #e2e3e0; --fill: #f3f4f1;
  --good: #1a7f4b; --bad: #c2410c; --mark: #3b5bdb; --other: #0f8b8d; --third: #b5840a; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e6e7e9; --soft: #989ea6; --paper: #15171a; --line: #2e3238; --fill: #1d2024;
    --good: #4cc38a; --bad: #ff8a5b; --mark: #8ea6ff; --other: #58c9cb; --third: #e5b84b; } }
"""
STYLE = """
svg { font: 12px system-ui, -apple-system, "Segoe UI", Roboto, sans-serif; }
svg text { fill: var(--ink); } svg .tick, svg .axis, svg .minor { fill: var(--soft); } svg .minor { font-size: 11px; }
svg .title { font-size: 14px; font-weight: 600; }
svg .grid { stroke: var(--line); } svg .zero { stroke: var(--ink); }
svg .reach { stroke: var(--line); stroke-width: 2; }
svg .dot { fill: var(--paper); stroke: var(--mark); stroke-width: 1.5; } svg .worst { fill: var(--mark); }
svg .worst.bad { fill: var(--bad); } svg .line { fill: none; stroke: var(--mark); stroke-width: 1.5; }
svg .point { fill: var(--soft); } svg .full { fill: var(--good); } svg .passes { fill: var(--mark); }
svg .presets { fill: var(--third); } svg .methods { fill: var(--other); } svg .sweep { fill: var(--mark); }
svg .line.other { stroke: var(--other); } svg .line.third { stroke: var(--third); }
svg .line.bad { stroke: var(--bad); }
svg .mark { fill: var(--mark); } svg .other { fill: var(--other); } svg .third { fill: var(--third); }
svg .bad { fill: var(--bad); } svg polyline.line { fill: none; } svg .paper { fill: var(--paper); }
"""


@dataclass(frozen=True, kw_only=True)
class Point:
    """One point of a scatter chart."""

    x: float
    y: float
    label: str
    group: str = "own"
    title: str = ""
    """Shown under the pointer; by default the label."""
    minor: bool = False
    """Whether it is drawn small."""


def scatter(
    points: Sequence[Point],
    *,
    x_label: str,
    y_label: str,
    line: bool = False,
    front: Sequence[Point] = (),
    log: str = "",
) -> str:
    """Points with their names. Empty without points.

    Args:
        points: what to draw.
        x_label: under the axis.
        y_label: beside the axis.
        line: join all points from left to right.
        front: points to join from left to right by a line, which need not be drawn themselves.
        log: the axes that are logarithmic: ``""``, ``"x"``, ``"y"`` or ``"xy"``.
    """
    points = [p for p in points if math.isfinite(p.x) and math.isfinite(p.y)]
    if not points:
        return ""
    x, y = Axis.of([p.x for p in points], log="x" in log), Axis.of([p.y for p in points], log="y" in log)
    parts = _axes(x, y, x_label, y_label)
    for joined in (points if line else (), front):
        if joined:
            parts.append(_polyline([_place(x, y, p.x, p.y) for p in sorted(joined, key=lambda p: p.x)]))
    parts += _named(points, [_place(x, y, p.x, p.y) for p in points])
    return _svg(HEIGHT, parts, f"{y_label} against {x_label}")


def lines(series: Mapping[str, Sequence[tuple[float, float]]], *, x_label: str, y_label: str) -> str:
    """Lines through positive points, each named at its right end, on logarithmic axes. Empty without points."""
    series = {name: sorted(points) for name, points in series.items() if points}
    if not series:
        return ""
    xs, ys = zip(*(point for points in series.values() for point in points), strict=True)
    x, y = Axis.of(xs, log=True), Axis.of(ys, log=True)
    if len(set(xs)) <= MOST_TICKS:
        x = Axis(low=x.low, high=x.high, ticks=sorted(set(xs)), log=True)
    parts, ends = _axes(x, y, x_label, y_label), []
    for (name, points), hue in zip(series.items(), cycle(HUES), strict=False):
        places = [_place(x, y, *point) for point in points]
        parts.append(_polyline(places, hue))
        for (px, py), (at, value) in zip(places, points, strict=True):
            title = f"<title>{escape(name)}: {at:.6g}, {value:.4g}</title>"
            parts.append(f'<circle class="{hue}" cx="{px:.1f}" cy="{py:.1f}" r="3.5">{title}</circle>')
        ends.append((places[-1], name, hue))
    taken: list[float] = []
    for (px, py), name, hue in sorted(ends, key=lambda end: end[0][1]):
        height = max(py, taken[-1] + LABEL + 1) if taken else py
        taken.append(height)
        parts.append(f'<text class="name {hue}" x="{px + 9:.1f}" y="{height + 4:.1f}">{escape(name)}</text>')
    return _svg(HEIGHT, parts, f"{y_label} against {x_label}")


def sheet(charts: Mapping[str, str], *, columns: int = 2) -> str:
    """Charts under their titles on one sheet, as a file with colours of its own, for light and for dark."""
    drawn = [(title, chart) for title, chart in charts.items() if chart]
    gap, head = 24, 30
    parts, rows = [], math.ceil(len(drawn) / columns)
    width, height = columns * (WIDTH + gap) + gap, rows * (HEIGHT + head + gap) + gap
    for number, (title, chart) in enumerate(drawn):
        left = gap + number % columns * (WIDTH + gap)
        top = gap + number // columns * (HEIGHT + head + gap)
        parts.append(f'<text class="title" x="{left + 8}" y="{top + 14}">{escape(title)}</text>')
        placed = f'<svg x="{left}" y="{top + head}" width="{WIDTH}" height="{HEIGHT}" '
        parts.append(chart.replace("<svg ", placed, 1))
    size = f'width="{width}" height="{height}"'
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" {size}><style>{COLOURS}{STYLE}</style>'
        f'<rect class="paper" {size}/>{"".join(parts)}</svg>\n'
    )


def dots(rows: Sequence[tuple[str, Mapping[str, float]]], *, label: str) -> str:
    """One line for each row, with a dot for each value; the least is filled. Empty without rows."""
    rows = [(name, values) for name, values in rows if values]
    if not rows:
        return ""
    axis = Axis.of([0.0, *(v for _, values in rows for v in values.values())])
    height = TOP + ROW * len(rows) + BOTTOM

    def at(value: float) -> float:
        return LEFT + axis.share(value) * (WIDTH - LEFT - RIGHT)

    parts = []
    for tick in axis.ticks:
        kind = "zero" if tick == 0 else "grid"
        parts.append(f'<line class="{kind}" x1="{at(tick):.1f}" x2="{at(tick):.1f}" y1="{TOP}" '
                     f'y2="{height - BOTTOM}"/>')  # fmt: skip
        parts.append(f'<text class="tick" x="{at(tick):.1f}" y="{height - BOTTOM + 18}" text-anchor="middle">'
                     f"{tick:g}</text>")  # fmt: skip
    for number, (name, values) in enumerate(rows):
        y, least = TOP + ROW * (number + 0.5), min(values.values())
        parts.append(f'<text class="name" x="{LEFT - 12}" y="{y + 4}" text-anchor="end">{escape(name)}</text>')
        parts.append(f'<line class="reach" x1="{at(least):.1f}" x2="{at(max(values.values())):.1f}" '
                     f'y1="{y}" y2="{y}"/>')  # fmt: skip
        for view, value in sorted(values.items(), key=lambda item: -item[1]):
            kind = ("worst" if value > 0 else "worst bad") if value == least else "dot"
            parts.append(f'<circle class="{kind}" cx="{at(value):.1f}" cy="{y}" r="5"><title>'
                         f"{escape(view)}: {value:.3g}</title></circle>")  # fmt: skip
    middle = (LEFT + WIDTH - RIGHT) / 2
    parts.append(f'<text class="axis" x="{middle}" y="{height - 6}" text-anchor="middle">{escape(label)}</text>')
    return _svg(height, parts, label)


def _place(x: Axis, y: Axis, at: float, value: float) -> tuple[float, float]:
    bottom = HEIGHT - BOTTOM
    return AXIS_LEFT + x.share(at) * (AXIS_RIGHT - AXIS_LEFT), bottom - y.share(value) * (bottom - TOP)


def _axes(x: Axis, y: Axis, x_label: str, y_label: str) -> list[str]:
    """Grid lines, ticks and labels of both axes."""
    bottom, parts = HEIGHT - BOTTOM, []
    for tick in y.ticks:
        height = bottom - y.share(tick) * (bottom - TOP)
        parts.append(f'<line class="grid" x1="{AXIS_LEFT}" x2="{AXIS_RIGHT}" y1="{height:.1f}" y2="{height:.1f}"/>')
        parts.append(f'<text class="tick" x="{AXIS_LEFT - 8}" y="{height + 4:.1f}" text-anchor="end">'
                     f"{short(tick)}</text>")  # fmt: skip
    for tick in x.ticks:
        left = AXIS_LEFT + x.share(tick) * (AXIS_RIGHT - AXIS_LEFT)
        parts.append(f'<text class="tick" x="{left:.1f}" y="{bottom + 18}" text-anchor="middle">{short(tick)}</text>')
    middle = (AXIS_LEFT + AXIS_RIGHT) / 2
    parts.append(f'<text class="axis" x="{middle}" y="{HEIGHT - 6}" text-anchor="middle">{escape(x_label)}</text>')
    parts.append(f'<text class="axis" transform="translate(14 {(TOP + bottom) / 2}) rotate(-90)" '
                 f'text-anchor="middle">{escape(y_label)}</text>')  # fmt: skip
    return parts


def _polyline(places: Sequence[tuple[float, float]], hue: str = "") -> str:
    joined = " ".join(f"{x:.1f},{y:.1f}" for x, y in places)
    return f'<polyline class="{" ".join(["line", *([hue] if hue else [])])}" points="{joined}"/>'


def _named(points: Sequence[Point], places: Sequence[tuple[float, float]]) -> list[str]:
    """Circles, and names beside them that do not overlap."""
    parts, names, taken = [], [], []
    order = sorted(zip(points, places, strict=True), key=lambda item: (not item[0].minor, item[1][1]))
    for point, (x, y) in order:
        kind = point.group if point.group in GROUPS else "own"
        title = f"{escape(point.title or point.label)}: {point.x:.4g}, {point.y:.4g}"
        parts.append(f'<circle class="point {kind}" cx="{x:.1f}" cy="{y:.1f}" r="{3.5 if point.minor else 5}">'
                     f"<title>{title}</title></circle>")  # fmt: skip
    for point, (x, y) in sorted(order, key=lambda item: item[1][1]):
        if not point.label:
            continue
        height = y
        while any(abs(height - other) < LABEL and abs(x - beside) < 150 for beside, other in taken):
            height += 2
        taken.append((x, height))
        kind = "minor" if point.minor else "name"
        names.append(f'<text class="{kind}" x="{x + 9:.1f}" y="{height + 4:.1f}">{escape(point.label)}</text>')
    return parts + names


def _svg(height: float, parts: Sequence[str], title: str) -> str:
    return f'<svg viewBox="0 0 {WIDTH} {height}" role="img" aria-label="{escape(title)}">{"".join(parts)}</svg>'
