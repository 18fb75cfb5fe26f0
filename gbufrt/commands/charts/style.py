"""Colours of charts: for pages, which bring their own, and for files."""

from __future__ import annotations

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
svg .line.bad { stroke: var(--bad); } svg .line.good { stroke: var(--good); } svg .good { fill: var(--good); }
svg .mark { fill: var(--mark); } svg .other { fill: var(--other); } svg .third { fill: var(--third); }
svg .bad { fill: var(--bad); } svg polyline.line { fill: none; } svg .paper { fill: var(--paper); }
"""

GROUPS = ("full", "passes", "presets", "methods", "sweep", "own")
HUES = ("mark", "other", "third", "bad", "good")
