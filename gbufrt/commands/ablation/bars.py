"""The table at the head of the report: one figure a pass, the bar it must reach, and what trivial answers score."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

from gbufrt.commands.ablation.front import TOLERANCE
from gbufrt.commands.ablation.records import Record
from gbufrt.commands.ablation.variants import FULL


@dataclass(frozen=True, kw_only=True)
class Bar:
    """What one figure must reach in the worst view."""

    name: str
    """Of the pass."""
    what: str
    key: str
    bound: float
    better: Literal["lower", "higher"]
    subject: str
    trivial: Mapping[str, str] = field(default_factory=dict)
    """Label to the figure that holds the score of a trivial answer."""
    limit: str | None = None
    """The figure that holds what a perfect screen-space answer would score."""


BARS = (
    Bar(
        name="AO", what="RMSE to true AO at the same radius", key="ao.rmse", bound=0.06, better="lower",
        subject="signals", trivial={"ao = 1": "ao.if_open", "constant per object": "ao.if_constant"}, limit="ao.limit",
    ),
    Bar(
        name="AO", what="the same RMSE after 1 frame from an empty history", key="ao.rmse_1", bound=0.09,
        better="lower", subject="signals",
    ),
    Bar(
        name="AO", what="bent normal's error over the normal's, where true AO < 0.9", key="ao.bent", bound=0.5,
        better="lower", subject="signals", trivial={"the normal": "ao.if_normal"},
    ),
    Bar(
        name="GI", what="squared error over squared truth, on-screen part of one bounce", key="gi.error", bound=0.25,
        better="lower", subject="signals", trivial={"black": "gi.if_black", "constant per object": "gi.if_constant"},
        limit="gi.exact",
    ),
    Bar(
        name="GI", what="the same error after 1 frame from an empty history", key="gi.error_1", bound=0.5,
        better="lower", subject="signals",
    ),
    Bar(
        name="GI", what="the error over a per-object constant's", key="gi.to_constant", bound=0.5, better="lower",
        subject="signals",
    ),
    Bar(
        name="reflections", what="RMSE over mean true radiance, mirrors whose hit is on screen",
        key="reflection.mirror", bound=0.1, better="lower", subject="signals",
        trivial={
            "black": "reflection.if_black", "sky": "reflection.if_sky", "constant per object": "reflection.if_constant",
        },
        limit="reflection.exact",
    ),
    Bar(
        name="denoise", what="dB over OIDN, last of 32 frames, 1 sample a pixel", key="denoise.last_over_oidn",
        bound=2.0, better="higher", subject="denoise", trivial={"the input": "denoise.last_input_over_oidn"},
    ),
    Bar(
        name="denoise", what="dB over kornia's joint bilateral, least of four frames from the first on",
        key="denoise.least_over_kornia", bound=0.0, better="higher", subject="denoise",
        trivial={"the input": "denoise.least_input_over_kornia"},
    ),
    Bar(
        name="motion blur", what="dB gained, centred shutter", key="motion_blur.centred.gain", bound=4.0,
        better="higher", subject="motion_blur",
    ),
    Bar(
        name="motion blur", what="dB gained, trailing shutter", key="motion_blur.trailing.gain", bound=3.0,
        better="higher", subject="motion_blur",
    ),
    Bar(
        name="depth of field", what="dB gained, small aperture", key="depth_of_field.small.gain", bound=10.0,
        better="higher", subject="depth_of_field",
    ),
    Bar(
        name="depth of field", what="dB gained, large aperture", key="depth_of_field.large.gain", bound=12.0,
        better="higher", subject="depth_of_field",
    ),
)  # fmt: skip
BARS += tuple(
    Bar(
        name=name, what="most times the time of the fastest setting that errs no more, of presets low to high",
        key=f"front.{signal}.behind", bound=TOLERANCE, better="lower", subject="front",
    )
    for name, signal in (("AO", "ao"), ("GI", "gi"), ("reflections", "reflection"))
)  # fmt: skip
UNTOUCHED = {"motion_blur": "the untouched frame: 0 dB", "depth_of_field": "the untouched frame: 0 dB"}


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
    """All rows: from the records of the full pipeline; for the whole frame, from those with a pass left out."""
    return [*(_row(bar, records) for bar in BARS), _whole(records)]


def _row(bar: Bar, records: Sequence[Record]) -> Row:
    own = [r for r in records if r.subject == bar.subject and r.variant == FULL]
    views = {_place(r): r for r in own if bar.key in r.figures}
    scores = {place: record.figures[bar.key] for place, record in views.items()}
    worst = (max if bar.better == "lower" else min)(scores, key=scores.__getitem__, default=None)
    value = None if worst is None else scores[worst]
    figures = {} if worst is None else views[worst].figures
    failed = next((r.error for r in own if r.error), None)
    note = UNTOUCHED.get(bar.subject, "") if value is not None else failed or "not measured in this run"
    if value is None and bar.key.endswith("oidn") and own and not failed:
        note = "OIDN is not installed: pip install 'gbufrt[denoise]'"
    reached = None if value is None else value <= bar.bound if bar.better == "lower" else value >= bar.bound
    crowded = bar.key.endswith(".behind") and any(record.beside > 1 for record in views.values())
    note = "timed beside other units: no measure of speed" if crowded else note
    return Row(
        name=bar.name, what=bar.what, value=value, view=worst, bound=bar.bound, better=bar.better,
        reached=None if crowded else reached, views=scores,
        trivial={label: figures.get(key) for label, key in bar.trivial.items()},
        limit=None if bar.limit is None else figures.get(bar.limit), note=note,
    )  # fmt: skip


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
