"""Small charts as SVG that takes its colours from the page."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape

WIDTH, LEFT, RIGHT, ROW = 760, 190, 24, 24
HEIGHT, TOP, BOTTOM = 340, 16, 44
LABEL = 13  # pixels between labels that would overlap
GROUPS = ("full", "passes", "presets", "methods", "sweep", "own")


@dataclass(frozen=True, kw_only=True)
class Point:
    """One point of a scatter chart."""

    x: float
    y: float
    label: str
    group: str = "own"


def scatter(points: Sequence[Point], *, x_label: str, y_label: str, line: bool = False) -> str:
    """Points with their names; ``line`` joins them from left to right. Empty without points."""
    points = [p for p in points if math.isfinite(p.x) and math.isfinite(p.y)]
    if not points:
        return ""
    left, bottom = 64, HEIGHT - BOTTOM
    x_low, x_high, x_ticks = _span([p.x for p in points])
    y_low, y_high, y_ticks = _span([p.y for p in points])

    def place(p: Point) -> tuple[float, float]:
        across, up = (p.x - x_low) / (x_high - x_low), (p.y - y_low) / (y_high - y_low)
        return left + across * (WIDTH - left - 150), bottom - up * (bottom - TOP)

    parts = []
    for tick in y_ticks:
        y = bottom - (tick - y_low) / (y_high - y_low) * (bottom - TOP)
        parts.append(f'<line class="grid" x1="{left}" x2="{WIDTH - 150}" y1="{y:.1f}" y2="{y:.1f}"/>')
        parts.append(f'<text class="tick" x="{left - 8}" y="{y + 4:.1f}" text-anchor="end">{tick:g}</text>')
    for tick in x_ticks:
        x = left + (tick - x_low) / (x_high - x_low) * (WIDTH - left - 150)
        parts.append(f'<text class="tick" x="{x:.1f}" y="{bottom + 18}" text-anchor="middle">{tick:g}</text>')
    middle = (left + WIDTH - 150) / 2
    parts.append(f'<text class="axis" x="{middle}" y="{HEIGHT - 6}" text-anchor="middle">{escape(x_label)}</text>')
    parts.append(f'<text class="axis" transform="translate(14 {(TOP + bottom) / 2}) rotate(-90)" '
                 f'text-anchor="middle">{escape(y_label)}</text>')  # fmt: skip
    if line:
        joined = " ".join(f"{x:.1f},{y:.1f}" for x, y in map(place, sorted(points, key=lambda p: p.x)))
        parts.append(f'<polyline class="line" points="{joined}"/>')
    parts += _named(points, [place(p) for p in points])
    return _svg(HEIGHT, parts, f"{y_label} against {x_label}")


def dots(rows: Sequence[tuple[str, Mapping[str, float]]], *, label: str) -> str:
    """One line for each row, with a dot for each value; the least is filled. Empty without rows."""
    rows = [(name, values) for name, values in rows if values]
    if not rows:
        return ""
    low, high, ticks = _span([0.0, *(v for _, values in rows for v in values.values())])
    height = TOP + ROW * len(rows) + BOTTOM

    def at(value: float) -> float:
        return LEFT + (value - low) / (high - low) * (WIDTH - LEFT - RIGHT)

    parts = []
    for tick in ticks:
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


def _named(points: Sequence[Point], places: Sequence[tuple[float, float]]) -> list[str]:
    """Circles, and names beside them that do not overlap."""
    parts, taken = [], []
    for point, (x, y) in sorted(zip(points, places, strict=True), key=lambda item: item[1][1]):
        height = y
        while any(abs(height - other) < LABEL and abs(x - beside) < 150 for beside, other in taken):
            height += 2
        taken.append((x, height))
        kind = point.group if point.group in GROUPS else "own"
        title = f"{escape(point.label)}: {point.x:.4g}, {point.y:.4g}"
        parts.append(f'<circle class="point {kind}" cx="{x:.1f}" cy="{y:.1f}" r="5"><title>{title}</title></circle>')
        parts.append(f'<text class="name" x="{x + 9:.1f}" y="{height + 4:.1f}">{escape(point.label)}</text>')
    return parts


def _span(values: Sequence[float]) -> tuple[float, float, list[float]]:
    """Round axis limits around the values, and round ticks between them."""
    low, high = min(values), max(values)
    if high - low < 1e-9:
        low, high = low - max(abs(low), 1.0) * 0.1, high + max(abs(high), 1.0) * 0.1
    raw = (high - low) / 5
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(m * power for m in (1, 2, 2.5, 5, 10) if m * power >= raw)
    first, last = math.floor(low / step + 1e-9), math.ceil(high / step - 1e-9)
    return first * step, last * step, [round(i * step, 10) for i in range(first, last + 1)]


def _svg(height: float, parts: Sequence[str], title: str) -> str:
    return f'<svg viewBox="0 0 {WIDTH} {height}" role="img" aria-label="{escape(title)}">{"".join(parts)}</svg>'
