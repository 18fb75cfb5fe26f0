"""Records of results, one file each, so that an interrupted run can resume."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from gbufrt.commands.ablation.subjects import Outcome
from gbufrt.files.output import write_text
from gbufrt.files.png import write_png


@dataclass(frozen=True, kw_only=True)
class Record:
    """One variant at one place, judged by one subject."""

    world: str
    view: str
    subject: str
    variant: str
    group: str = "own"
    axis: tuple[str, float] | None = None
    figures: Mapping[str, float] = field(default_factory=dict)
    """Finite numbers only: what could not be measured is left out."""
    passes: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    """Of each pass ``ms`` and ``peak_mb``."""
    pictures: Mapping[str, str] = field(default_factory=dict)
    """Files of display-referred pictures, relative to the folder of the results."""
    error: str | None = None
    """Why there are no figures."""
    seconds: float = 0.0
    beside: int = 1
    """Units measured at the same time, on a cluster: with more than one, ``ms`` tells nothing."""

    @property
    def ms(self) -> float:
        """Milliseconds of all passes."""
        return sum(cost["ms"] for cost in self.passes.values())

    def to_json(self) -> dict[str, Any]:
        """The record as JSON values."""
        return asdict(self)

    @staticmethod
    def of_json(values: Mapping[str, Any]) -> Record:
        """What `to_json` gave.

        Raises:
            TypeError, ValueError, KeyError: it did not give this.
        """
        axis = values.get("axis")
        return Record(**{**values, "axis": None if axis is None else (str(axis[0]), float(axis[1]))})


@dataclass(frozen=True, kw_only=True)
class Store:
    """Records in a folder by key."""

    folder: Path

    def find(self, key: str) -> Record | None:
        """The finished record under ``key``. Failures do not count: they are tried again."""
        try:
            record = Record.of_json(json.loads((self.folder / "records" / f"{key}.json").read_text()))
        except (OSError, ValueError, TypeError, KeyError):
            return None
        whole = all((self.folder / path).exists() for path in record.pictures.values())
        return record if whole and record.error is None else None

    def keep(self, key: str, record: Record, outcome: Outcome) -> Record:
        """Write a record and its pictures; the record last."""
        pictures = {}
        for name, picture in outcome.pictures.items():
            path = f"pictures/{key}_{name.replace(' ', '_')}.png"
            write_png(self.folder / path, picture)
            pictures[name] = path
        figures = {name: float(value) for name, value in outcome.figures.items() if math.isfinite(value)}
        values = {**record.to_json(), "figures": figures, "passes": outcome.passes, "pictures": pictures}
        write_text(self.folder / "records" / f"{key}.json", json.dumps(values, indent=1))
        return Record.of_json(values)


def to_csv(records: Iterable[Record]) -> str:
    """One line a number: world, view, subject, variant, measure, value; a failure is a line with its ``error``."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(("world", "view", "subject", "variant", "measure", "value"))
    for record in records:
        start = (record.world, record.view, record.subject, record.variant)
        if record.error is not None:
            table.writerow((*start, "error", record.error))
        for name, value in record.figures.items():
            table.writerow((*start, name, repr(value)))
        for stage, cost in record.passes.items():
            for name, value in cost.items():
                table.writerow((*start, f"{stage}.{name}", repr(value)))
    return text.getvalue()
