"""Units of an ablation: one variant at one place and one subject, found, measured and kept."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from torch import Tensor

from gbufrt.commands.ablation.cache import Cache, digest, sources
from gbufrt.commands.ablation.place import Place, Say
from gbufrt.commands.ablation.plan import Plan
from gbufrt.commands.ablation.records import Record, Store
from gbufrt.commands.ablation.subjects import Outcome
from gbufrt.commands.ablation.variants import FULL, Variant


@dataclass(frozen=True, kw_only=True)
class Unit:
    """One variant at one place, judged by one subject."""

    world: str
    variant: Variant
    subject: str
    view: str

    def __str__(self) -> str:
        return f"{self.variant.name}: {self.subject} of {self.view}"


@dataclass(kw_only=True)
class Run:
    """What finds and measures units."""

    plan: Plan
    scenes: dict[str, Any]
    store: Store
    cache: Cache
    full: dict[str, Tensor] = field(default_factory=dict)
    """Displayed composites of the full pipeline, by place: what its variants change is told against them."""
    beside: int = 1
    """Units that are measured at the same time."""

    def find(self, unit: Unit) -> Record | None:
        """The record of a unit that is finished already, where the plan goes on after an earlier run."""
        found = self.store.find(self._key(unit)) if self.plan.resume else None
        return None if found is None else self._remembered(unit, found)

    def measure(self, unit: Unit, say: Say = lambda _: None) -> Record:
        """The record of a unit, measured and kept, or holding the error."""
        record = Record(
            world=unit.world, view=unit.view, subject=unit.subject, variant=unit.variant.name,
            group=unit.variant.group, axis=unit.variant.axis, beside=self.beside,
        )  # fmt: skip
        begun, place = time.monotonic(), self._place(unit, say)
        try:
            outcome = _judge(self.plan, place, unit.variant, unit.subject, self.full.get(_spot(unit)))
        except Exception as error:  # an error in one variant must not end the others
            told = " ".join(str(error).split()) or "no reason given"
            return replace(record, error=f"{type(error).__name__}: {told}", seconds=time.monotonic() - begun)
        kept = self.store.keep(self._key(unit), replace(record, seconds=time.monotonic() - begun), outcome)
        return self._remembered(unit, kept)

    def _remembered(self, unit: Unit, record: Record) -> Record:
        if unit.variant.name == FULL and unit.subject == "frame" and "frame" in record.pictures:
            self.full[_spot(unit)] = _read_png(self.store.folder / record.pictures["frame"])
        return record

    def _place(self, unit: Unit, say: Say = lambda _: None) -> Place:
        return Place(
            scene=self.scenes[unit.world], world=unit.world, view=unit.view, size=self.plan.size,
            samples=self.plan.samples, cache=self.cache, time=_moment(unit.subject), say=say,
        )  # fmt: skip

    def _key(self, unit: Unit) -> str:
        return _key(self.plan, self._place(unit), unit.variant, unit.subject)


def _spot(unit: Unit) -> str:
    return f"{unit.world}/{unit.view}"


def _judge(plan: Plan, place: Place, variant: Variant, subject: str, full: Tensor | None) -> Outcome:
    from gbufrt.commands.ablation import denoising, front, lens, subjects, world

    if subject in world.JUDGES:
        return world.JUDGES[subject](place)
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


def _read_png(path: Path) -> Tensor:
    import numpy as np
    import torch
    from PIL import Image

    return torch.from_numpy(np.array(Image.open(path).convert("RGB"))).permute(2, 0, 1)[None].float() / 255
