"""The run: every unit of the plan on its own, then their results together."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from torch import Tensor

from gbufrt.commands.ablation.cache import Cache, default_folder
from gbufrt.commands.ablation.plan import Plan
from gbufrt.commands.ablation.records import Record, Store, to_csv
from gbufrt.commands.ablation.report import write_front, write_page
from gbufrt.commands.ablation.table import Results, table
from gbufrt.commands.ablation.units import Run, Unit
from gbufrt.commands.arguments.checks import check_folder
from gbufrt.commands.arguments.options import ClusterOptions
from gbufrt.commands.progress import progress
from gbufrt.files.output import write_text


@dataclass(frozen=True, kw_only=True)
class Share:
    """Units of one view and subject, with their numbers. What they share of truth, no other share needs at length."""

    units: list[tuple[int, Unit]]
    full: dict[str, Tensor]
    """Displayed composites of the full pipeline that are there already, by place."""


def ablate(plan: Plan, spread: ClusterOptions | None = None) -> Results:
    """Measure what the plan says, here or on a cluster; write report.html, report.json, report.csv, perhaps front.svg.

    A variant that fails is noted in its record; the others still run.

    Raises:
        ValueError: the plan makes no sense, or a world or view does not exist.
        FileNotFoundError: a world's file does not exist.
    """

    plan.check()
    check_folder(plan.out)
    begun, cache = time.monotonic(), Cache(plan.cache or default_folder())
    scenes = {world: _load(world) for world in plan.worlds}
    units = [
        Unit(world=world, variant=variant, subject=subject, view=view)
        for world, scene in scenes.items()
        for variant, subject, view in plan.units(scene, world)
    ]
    run = Run(plan=plan, scenes=scenes, store=Store(folder=plan.out), cache=cache)
    records = _on_workers(run, units, spread) if spread and spread.cluster else _one_by_one(run, units)
    about = {**_about(plan), "seconds": time.monotonic() - begun, "traced": cache.made}
    results = Results(records=records, rows=table(records), about=about)
    write_results(plan.out, results)
    write_page(plan.out, results)
    write_front(plan.out, records)
    return results


def _one_by_one(run: Run, units: list[Unit]) -> list[Record]:
    records = []
    with progress("ablate", len(units)) as doing:
        for unit in units:
            tick = doing(str(unit))
            records.append(run.find(unit) or run.measure(unit, lambda t, name=unit.variant.name: doing(f"{name}: {t}")))
            tick()
    return records


def _on_workers(run: Run, units: list[Unit], spread: ClusterOptions) -> list[Record]:
    from gbufrt.commands.cluster.connection import open_cluster

    records = {number: found for number, unit in enumerate(units) if (found := run.find(unit)) is not None}
    shares: dict[Any, Share] = {}
    for number, unit in enumerate(units):
        if number not in records:
            full = run.full if unit.subject == "frame" else {}
            share = shares.setdefault((unit.world, unit.view, unit.subject), Share(units=[], full=full))
            share.units.append((number, unit))
    if shares:
        plan = run.plan if run.plan.cache is None else replace(run.plan, cache=run.plan.cache.resolve())
        with open_cluster(spread) as cluster, progress("ablate", len(units) - len(records)) as doing:
            given = (plan, run.scenes, min(cluster.workers, len(shares)))
            for number, record, made in cluster.run(measure, [*shares.values()], shared=given, out=plan.out):
                records[number] = record
                run.cache.made += made
                doing(str(units[number]))()
    return [records[number] for number in range(len(units))]


def measure(given: tuple[Plan, dict[str, Any], int], share: Share, folder: Path) -> Iterator[tuple[int, Record, int]]:
    """Measure a share in a worker of `gbufrt.commands.cluster`: a unit's number, its record, and files of truth made.

    Truth is kept where the worker is: in ``--cache`` if all machines share its disk, else on each machine.
    """
    plan, scenes, beside = given
    cache = Cache(plan.cache or default_folder())
    run = Run(plan=plan, scenes=scenes, store=Store(folder=folder), cache=cache, full=dict(share.full), beside=beside)
    for number, unit in share.units:
        before = cache.made
        record = run.measure(unit)
        yield number, record, cache.made - before


def write_results(out: Path, results: Results) -> None:
    """report.json and report.csv."""
    values = {
        "about": results.about,
        "table": [row.to_json() for row in results.rows],
        "records": [record.to_json() for record in results.records],
    }
    write_text(out / "report.json", json.dumps(values, indent=1) + "\n")
    write_text(out / "report.csv", to_csv(results.records))


def _load(world: str) -> Any:
    from tracer.worlds import load

    scene = load(world)
    if scene.empty or not scene.views:
        raise ValueError(f"world {world!r} has nothing to look at; give one with voxels and views")
    return replace(scene, haze=None, waves=None)  # which the truth does not know


def _about(plan: Plan) -> dict[str, Any]:
    from gbufrt import __version__
    from gbufrt.commands.benchmark.process import machine

    return {
        "version": __version__,
        "machine": machine(),
        "worlds": list(plan.worlds),
        "size": [plan.size[1], plan.size[0]],
        "frames": plan.frames,
        "samples": plan.samples,
        "pipeline": plan.recipe.to_notes(),
    }
