"""Several charts on one sheet: a file with colours of its own."""

from __future__ import annotations

import math
from collections.abc import Mapping
from html import escape

from gbufrt.commands.charts.drawing import HEIGHT, NARROW
from gbufrt.commands.charts.style import COLOURS, STYLE


def sheet(charts: Mapping[str, str], *, columns: int = 2) -> str:
    """Charts of width `NARROW` under their titles on one sheet: a file with colours of its own, for light and dark."""
    drawn = [(title, chart) for title, chart in charts.items() if chart]
    gap, head = 24, 30
    parts, rows = [], math.ceil(len(drawn) / columns)
    width, height = columns * (NARROW + gap) + gap, rows * (HEIGHT + head + gap) + gap
    for number, (title, chart) in enumerate(drawn):
        left = gap + number % columns * (NARROW + gap)
        top = gap + number // columns * (HEIGHT + head + gap)
        parts.append(f'<text class="title" x="{left + 8}" y="{top + 14}">{escape(title)}</text>')
        placed = f'<svg x="{left}" y="{top + head}" width="{NARROW}" height="{HEIGHT}" '
        parts.append(chart.replace("<svg ", placed, 1))
    size = f'width="{width}" height="{height}"'
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" {size}><style>{COLOURS}{STYLE}</style>'
        f'<rect class="paper" {size}/>{"".join(parts)}</svg>\n'
    )
