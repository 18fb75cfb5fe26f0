"""Small charts as SVG; what shows them gives them their colours, see `charts.style`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from itertools import count, cycle
from types import MappingProxyType

from gbufrt.commands.charts.axes import Axis, short
from gbufrt.commands.charts.style import GROUPS, HUES

WIDTH, LEFT, RIGHT, ROW = 760, 190, 24, 24
HEIGHT, TOP, BOTTOM = 340, 16, 44
END = HEIGHT - BOTTOM
AXIS_LEFT, MARGIN = 64, 150  # of charts with two axes
NARROW, NARROW_MARGIN = 460, 90  # charts that stand side by side
LIFT = 7  # pixels that names stand above points which a falling line joins
LABEL, NEAR = 13, 9  # pixels between labels that would overlap, and between a label and another point
LETTER = 6.5  # pixels, mean width of one in a label
OWN_TICKS = 7  # so many places of a series at most each get a tick


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


@dataclass(frozen=True, kw_only=True)
class Plane:
    """Two axes on a chart of a width; names stand right of their points, in a margin."""

    x: Axis
    y: Axis
    width: int
    margin: int

    @property
    def right(self) -> float:
        """The end of the horizontal axis."""
        return self.width - self.margin

    def place(self, x: float, y: float) -> tuple[float, float]:
        """Pixels of a point."""
        return AXIS_LEFT + self.x.share(x) * (self.right - AXIS_LEFT), END - self.y.share(y) * (END - TOP)

    def axes(self, x_label: str, y_label: str) -> list[str]:
        """Grid lines, ticks and labels."""
        parts = []
        for tick in self.y.ticks:
            _, y = self.place(self.x.low, tick)
            parts.append(f'<line class="grid" x1="{AXIS_LEFT}" x2="{self.right}" y1="{y:.1f}" y2="{y:.1f}"/>')
            parts.append(f'<text class="tick" x="{AXIS_LEFT - 8}" y="{y + 4:.1f}" text-anchor="end">'
                         f"{short(tick)}</text>")  # fmt: skip
        for tick in self.x.ticks:
            x, _ = self.place(tick, self.y.low)
            parts.append(f'<text class="tick" x="{x:.1f}" y="{END + 18}" text-anchor="middle">{short(tick)}</text>')
        middle = (AXIS_LEFT + self.right) / 2
        parts.append(f'<text class="axis" x="{middle}" y="{HEIGHT - 6}" text-anchor="middle">{escape(x_label)}</text>')
        parts.append(f'<text class="axis" transform="translate(14 {(TOP + END) / 2}) rotate(-90)" '
                     f'text-anchor="middle">{escape(y_label)}</text>')  # fmt: skip
        return parts


def scatter(
    points: Sequence[Point],
    *,
    x_label: str,
    y_label: str,
    line: bool = False,
    front: Sequence[Point] = (),
    log: str = "",
    width: int = WIDTH,
) -> str:
    """Points with their names, as far as the axes can hold them. Empty without points.

    Args:
        points: what to draw; those that are not finite, or not positive on a logarithmic axis, are left out.
        x_label: under the axis.
        y_label: beside the axis.
        line: join all points from left to right.
        front: points to join from left to right by a line, which need not be drawn themselves.
        log: the axes that are logarithmic: ``""``, ``"x"``, ``"y"`` or ``"xy"``.
        width: of the chart, pixels.
    """
    points, front = (
        [p for p in some if _fits(p.x, log="x" in log) and _fits(p.y, log="y" in log)] for some in (points, front)
    )
    if not points:
        return ""
    x, y = Axis.of([p.x for p in points], log="x" in log), Axis.of([p.y for p in points], log="y" in log)
    plane = Plane(x=x, y=y, width=width, margin=MARGIN if width == WIDTH else NARROW_MARGIN)
    parts = plane.axes(x_label, y_label)
    for joined in (points if line else (), front):
        if joined:
            parts.append(_polyline([plane.place(p.x, p.y) for p in sorted(joined, key=lambda p: p.x)]))
    parts += _named(points, [plane.place(p.x, p.y) for p in points], lift=LIFT if front else 0)
    return _svg(width, HEIGHT, parts, f"{y_label} against {x_label}")


def lines(
    series: Mapping[str, Sequence[tuple[float, float]]],
    *,
    x_label: str,
    y_label: str,
    width: int = WIDTH,
    hues: Mapping[str, str] = MappingProxyType({}),
) -> str:
    """Lines through finite positive points, each named at its right end, on logarithmic axes. Empty without points.

    Args:
        series: points by the name of their line.
        x_label: under the axis.
        y_label: beside the axis.
        width: of the chart, pixels.
        hues: names of lines to members of `HUES`; by default in turn.
    """
    fitting = {name: sorted(p for p in points if all(_fits(n, log=True) for n in p)) for name, points in series.items()}
    series = {name: points for name, points in fitting.items() if points}
    if not series:
        return ""
    xs, ys = zip(*(point for points in series.values() for point in points), strict=True)
    x, y = Axis.of(xs, log=True), Axis.of(ys, log=True)
    if len(set(xs)) <= OWN_TICKS:
        x = Axis(low=x.low, high=x.high, ticks=sorted(set(xs)), log=True)
    plane = Plane(x=x, y=y, width=width, margin=round(20 + LETTER * max(map(len, series))))
    parts, ends = plane.axes(x_label, y_label), []
    for (name, points), hue in zip(series.items(), cycle(HUES), strict=False):
        hue = hues.get(name, hue)
        places = [plane.place(*point) for point in points]
        parts.append(_polyline(places, hue))
        for (px, py), (at, value) in zip(places, points, strict=True):
            title = f"<title>{escape(name)}: {at:.6g}, {value:.4g}</title>"
            parts.append(f'<circle class="{hue}" cx="{px:.1f}" cy="{py:.1f}" r="3.5">{title}</circle>')
        ends.append((places[-1], name, hue))
    ends.sort(key=lambda end: end[0][1])
    for ((px, _), name, hue), height in zip(ends, _apart([py for (_, py), _, _ in ends]), strict=True):
        parts.append(f'<text class="name {hue}" x="{px + 9:.1f}" y="{height + 4:.1f}">{escape(name)}</text>')
    return _svg(width, HEIGHT, parts, f"{y_label} against {x_label}")


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
    return _svg(WIDTH, height, parts, label)


def _fits(value: float, *, log: bool) -> bool:
    """Whether an axis has a place for a value."""
    return math.isfinite(value) and (value > 0 or not log)


def _apart(heights: Sequence[float]) -> list[float]:
    """Ascending heights of labels moved so that none overlap: down, and up again as far as they pass the end."""
    found: list[float] = []
    for height in heights:
        found.append(max(height, found[-1] + LABEL + 1) if found else height)
    lowest: float = END
    for n in reversed(range(len(found))):
        found[n] = min(found[n], lowest)
        lowest = found[n] - LABEL - 1
    return found


def _polyline(places: Sequence[tuple[float, float]], hue: str = "") -> str:
    joined = " ".join(f"{x:.1f},{y:.1f}" for x, y in places)
    return f'<polyline class="{" ".join(["line", *([hue] if hue else [])])}" points="{joined}"/>'


def _named(points: Sequence[Point], places: Sequence[tuple[float, float]], *, lift: float = 0) -> list[str]:
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
        right = x + 9 + LETTER * len(point.label)
        circles = [(cx, cy) for cx, cy in places if (cx, cy) != (x, y) and x < cx < right + 4]
        beside = [height for left, end, height in taken if left < right and x < end]
        height = next(
            at
            for at in (y - lift + sign * 2 * n for n in count() for sign in (-1, 1))
            if all(abs(at - other) >= LABEL for other in beside) and all(abs(at - cy) >= NEAR for _, cy in circles)
        )
        taken.append((x, right, height))
        kind = "minor" if point.minor else "name"
        names.append(f'<text class="{kind}" x="{x + 9:.1f}" y="{height + 4:.1f}">{escape(point.label)}</text>')
    return parts + names


def _svg(width: float, height: float, parts: Sequence[str], title: str) -> str:
    return f'<svg viewBox="0 0 {width} {height}" role="img" aria-label="{escape(title)}">{"".join(parts)}</svg>'
