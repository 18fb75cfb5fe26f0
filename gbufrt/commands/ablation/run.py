"""The run: every unit of the plan on its own, then their results together."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from torch import Tensor

from gbufrt.commands.ablation.bars import Results, table
from gbufrt.commands.ablation.cache import Cache, default_folder, digest, sources
from gbufrt.commands.ablation.place import Place
from gbufrt.commands.ablation.plan import Plan
from gbufrt.commands.ablation.records import Record, Store, to_csv
from gbufrt.commands.ablation.report import write_front, write_page
from gbufrt.commands.ablation.subjects import Outcome
from gbufrt.commands.ablation.variants import FULL, Variant
from gbufrt.commands.checks import check_folder
from gbufrt.commands.progress import progress
from gbufrt.files.output import write_text


def ablate(plan: Plan) -> Results:
    """Measure what the plan says, and write report.html, report.json, report.csv, and front.svg where it is measured.

    A variant that fails is noted in its record; the others still run.

    Raises:
        ValueError: the plan makes no sense, or a world or view does not exist.
        FileNotFoundError: a world's file does not exist.
    """

    plan.check()
    check_folder(plan.out)
    begun, cache = time.monotonic(), Cache(plan.cache or default_folder())
    store = Store(folder=plan.out)
    scenes = {world: _load(world) for world in plan.worlds}
    units = [(world, *unit) for world, scene in scenes.items() for unit in plan.units(scene, world)]
    records, full = [], {}
    with progress("ablate", len(units)) as doing:
        for world, variant, subject, view in units:
            place = Place(
                scene=scenes[world], world=world, view=view, size=plan.size, samples=plan.samples, cache=cache,
                time=_moment(subject), say=lambda text, name=variant.name: doing(f"{name}: {text}"),
            )  # fmt: skip
            tick = doing(f"{variant.name}: {subject} of {view}")
            records.append(_unit(plan, store, place, variant, subject, full))
            tick()
    about = {**_about(plan), "seconds": time.monotonic() - begun, "traced": cache.made}
    results = Results(records=records, rows=table(records), about=about)
    write_results(plan.out, results)
    write_page(plan.out, results)
    write_front(plan.out, records)
    return results


def write_results(out: Path, results: Results) -> None:
    """report.json and report.csv."""
    values = {
        "about": results.about,
        "table": [row.to_json() for row in results.rows],
        "records": [record.to_json() for record in results.records],
    }
    write_text(out / "report.json", json.dumps(values, indent=1) + "\n")
    write_text(out / "report.csv", to_csv(results.records))


def _unit(plan: Plan, store: Store, place: Place, variant: Variant, subject: str, full: dict[str, Tensor]) -> Record:
    """One record: read back, or measured, or holding the error."""
    key = _key(plan, place, variant, subject)
    record = Record(
        world=place.world, view=place.view, subject=subject, variant=variant.name, group=variant.group,
        axis=variant.axis,
    )  # fmt: skip
    found = store.find(key) if plan.resume else None
    spot = f"{place.world}/{place.view}"
    if found is None:
        begun = time.monotonic()
        try:
            outcome = _judge(plan, place, variant, subject, full.get(spot))
        except Exception as error:  # an error in one variant must not end the others
            told = " ".join(str(error).split()) or "no reason given"
            return replace(record, error=f"{type(error).__name__}: {told}", seconds=time.monotonic() - begun)
        found = store.keep(key, replace(record, seconds=time.monotonic() - begun), outcome)
    if variant.name == FULL and subject == "frame" and "frame" in found.pictures:
        full[spot] = _read_png(store.folder / found.pictures["frame"])
    return found


def _judge(plan: Plan, place: Place, variant: Variant, subject: str, full: Tensor | None) -> Outcome:
    from gbufrt.commands.ablation import denoising, front, lens, subjects

    pipeline = variant.pipeline
    if subject == "signals":
        return subjects.signals(place, pipeline, plan.signals_of(variant), plan.frames)
    if subject == "frame":
        base = None if variant.name == FULL else full
        return subjects.whole_frame(place, pipeline, max(plan.frames // 4, 1), base)
    if subject in ("path", "taa"):
        return getattr(subjects, subject)(place, pipeline, plan.frames)
    if subject == "front":
        return front.measure(place, variant.recipe)
    judges: dict[str, Callable[..., Outcome]] = {
        "motion_blur": lens.motion_blur,
        "depth_of_field": lens.depth_of_field,
        "denoise": denoising.denoise,
    }
    return judges[subject](place, pipeline)


def _key(plan: Plan, place: Place, variant: Variant, subject: str) -> str:
    """A name made from all that a record depends on."""
    text = sources("tracer", "post", "gbufrt.commands.ablation", "gbufrt")
    settings = (plan.size, plan.frames, plan.samples, plan.signals_of(variant) if subject == "signals" else ())
    recipes = (asdict(variant.recipe), asdict(plan.recipe))  # losses are measured against the full pipeline
    return digest(place.contents, place.view, subject, variant.name, recipes, settings, text)


def _moment(subject: str) -> float:
    """Seconds into the scene."""
    return 1.0 if subject in ("path", "denoise") else 0.0


def _load(world: str) -> Any:
    from tracer.worlds import load

    scene = load(world)
    if scene.empty or not scene.views:
        raise ValueError(f"world {world!r} has nothing to look at; give one with voxels and views")
    return scene


def _read_png(path: Path) -> Tensor:
    import numpy as np
    import torch
    from PIL import Image

    return torch.from_numpy(np.array(Image.open(path).convert("RGB"))).permute(2, 0, 1)[None].float() / 255


def _about(plan: Plan) -> dict[str, Any]:
    from gbufrt import __version__
    from gbufrt.commands.bench import machine

    return {
        "version": __version__,
        "machine": machine(),
        "worlds": list(plan.worlds),
        "size": [plan.size[1], plan.size[0]],
        "frames": plan.frames,
        "samples": plan.samples,
        "pipeline": plan.recipe.to_notes(),
    }
