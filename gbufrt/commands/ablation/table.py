"""The tables at the head of the report: a figure, the bar it must reach, and what trivial answers score."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from gbufrt.commands.ablation import world
from gbufrt.commands.ablation.bars import BARS, UNTOUCHED, Bar
from gbufrt.commands.ablation.records import Record
from gbufrt.commands.ablation.variants import FULL
from gbufrt.commands.arguments.checks import SLOW


@dataclass(frozen=True, kw_only=True)
class Row:
    """One line of the table."""

    name: str
    what: str
    value: float | None
    view: str | None
    """The worst."""
    bound: float
    better: str
    reached: bool | None
    """None where it was not measured, or is made of times that tell nothing."""
    views: Mapping[str, float]
    trivial: Mapping[str, float | None]
    """Scores in the worst view."""
    limit: float | None = None
    note: str = ""
    part: str = "passes"
    """The table that it stands in: ``passes``, or ``world``."""

    def to_json(self) -> dict[str, Any]:
        """The row as JSON values."""
        return asdict(self)


@dataclass(frozen=True, kw_only=True)
class Results:
    """What was found."""

    records: list[Record]
    rows: list[Row]
    """The table that the report begins with."""
    about: dict[str, Any]

    @property
    def failures(self) -> list[Record]:
        """The records of what failed."""
        return [record for record in self.records if record.error is not None]


def table(records: Sequence[Record]) -> list[Row]:
    """All rows: from the records of the full pipeline; for the whole frame, from those with a pass left out.

    Then those of Minecraft RTX's frame and of BetterRTX's world.
    """
    passes = [*(_row(bar, records, "passes") for bar in BARS), _whole(records)]
    return [*passes, *(_row(bar, records, "world") for bar in world.BARS)]


def _row(bar: Bar, records: Sequence[Record], part: str) -> Row:
    own = [r for r in records if r.subject == bar.subject and r.variant == FULL]
    views = {_place(r): r for r in own if bar.key in r.figures}
    scores = {place: record.figures[bar.key] for place, record in views.items()}
    worst = (max if bar.better == "lower" else min)(scores, key=scores.__getitem__, default=None)
    value = None if worst is None else scores[worst]
    figures = {} if worst is None else views[worst].figures
    failed = next((r.error for r in own if r.error), None)
    note = UNTOUCHED.get(bar.subject, "") if value is not None else failed or _unmeasured(bar)
    if value is None and bar.key.endswith("oidn") and own and not failed:
        note = "OIDN is not installed: pip install 'gbufrt[denoise]'"
    reached = None if value is None else value <= bar.bound if bar.better == "lower" else value >= bar.bound
    crowded = bar.timed and any(record.beside > 1 for record in views.values())
    note = "timed beside other units: no measure of speed" if crowded else note
    return Row(
        name=bar.name, what=bar.what, value=value, view=worst, bound=bar.bound, better=bar.better,
        reached=None if crowded else reached, views=scores,
        trivial={label: figures.get(key) for label, key in bar.trivial.items()},
        limit=None if bar.limit is None else figures.get(bar.limit), note=note, part=part,
    )  # fmt: skip


def _unmeasured(bar: Bar) -> str:
    return f"slow: --only {bar.subject}" if bar.subject in SLOW else "not measured in this run"


def _whole(records: Sequence[Record]) -> Row:
    """The smallest loss from leaving a stage out, over stages and views."""
    lost = {
        f"{_place(r)}, {r.variant}": r.figures["loss"]
        for r in records
        if r.subject == "frame" and r.group == "passes" and "loss" in r.figures and r.variant.startswith("without=")
    }
    worst = min(lost, key=lost.__getitem__, default=None)
    value = None if worst is None else lost[worst]
    return Row(
        name="whole frame", what="dB lost by leaving out any pass, on the pixels that it changes", value=value,
        view=worst, bound=0.0, better="higher", reached=None if value is None else value > 0, views=lost, trivial={},
        note="" if value is not None else "not measured in this run",
    )  # fmt: skip


def _place(record: Record) -> str:
    return record.view if record.world in ("builtin", "valley") else f"{record.world}: {record.view}"
