"""Error against time: AO, GI and reflections at several settings, and whether a preset is slower than it needs to be.

Every setting answers the same question: radius and scales of AO are those of the full pipeline, and GI has one bounce.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import torch

from gbufrt.commands.ablation.figures.signals import ao_error, gi_error, reflection_error
from gbufrt.commands.ablation.place import Place, Truth
from gbufrt.commands.ablation.subjects import SIGNALS, Outcome, ao_truth, one_bounce, only
from gbufrt.commands.recipe import Recipe
from gbufrt.frame import Frame
from gbufrt.pipeline import Pipeline

FRAMES = 4  # static ones, from an empty history
PRESETS = ("low", "medium", "high")
TOLERANCE = 1.1  # times the front's time that a preset may take: times vary by that much from run to run
JOINT = ", "  # between the names of presets that have the same setting
SHARED = ("radius", "scales")  # tunables of an estimate that change what it answers


@dataclass(frozen=True, eq=False, kw_only=True)
class Effect:
    """A branch of the pipeline, and the settings of its estimate that are measured."""

    signal: str
    title: str
    error: str
    """In words."""
    judge: Callable[[Frame, Truth], float]
    grid: Mapping[str, Sequence[int]]
    """Tunables and their values; all combinations are measured."""


EFFECTS = (
    Effect(
        signal="ao", title="Ambient occlusion", error="RMSE", judge=ao_error,
        grid={"directions": (1, 2, 4), "steps": (8, 16, 32)},
    ),
    Effect(
        signal="gi", title="Indirect light", error="relative squared error", judge=gi_error,
        grid={"directions": (1, 2, 4), "steps": (12, 36)},
    ),
    Effect(
        signal="reflection", title="Reflections", error="relative squared error", judge=reflection_error,
        grid={"samples": (1, 4, 8)},
    ),
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Setting:
    """One setting of an effect, as measured."""

    name: str
    ms: float
    """Milliseconds a frame of the effect's own passes, of all processors together."""
    error: float

    @property
    def known(self) -> bool:
        """Whether its error and its time could be measured: a coarse clock may find no time at all."""
        return math.isfinite(self.error) and self.ms > 0

    @property
    def preset(self) -> bool:
        """Whether a preset has it."""
        return any(name in PRESETS for name in self.name.split(JOINT))


def front(settings: Sequence[Setting]) -> list[Setting]:
    """The known settings that no other beats in time without a larger error, fastest first."""
    found: list[Setting] = []
    for setting in sorted((s for s in settings if s.known), key=lambda s: (s.ms, s.error)):
        if not found or setting.error < found[-1].error:
            found.append(setting)
    return found


def behind(settings: Sequence[Setting]) -> float:
    """The most times longer that a preset takes than the fastest setting whose error is no larger; NaN without any.

    Settings that are not known do not count.
    """
    known = [s for s in settings if s.known]
    shares = [s.ms / min(other.ms for other in known if other.error <= s.error) for s in known if s.preset]
    return max(shares, default=float("nan"))


def settings_of(figures: Mapping[str, float], signal: str) -> list[Setting]:
    """What `measure` put into the figures of a record."""
    found: dict[str, dict[str, float]] = {}
    for key, value in figures.items():
        parts = key.split(".")
        if len(parts) == 4 and parts[:2] == ["front", signal]:
            found.setdefault(parts[2], {})[parts[3]] = value
    return [Setting(name=name, **values) for name, values in found.items() if {"ms", "error"} <= values.keys()]


def measure(place: Place, recipe: Recipe) -> Outcome:
    """Time and error of each setting of each effect that the recipe has, and how far presets are behind the front.

    GI and reflections read the AO of the recipe as it is after `FRAMES` frames; other effects are left out.
    """
    result, frame, full = Outcome(), place.still(), one_bounce(recipe.build())
    known, _ = _run({"full": only(full, SIGNALS[:2])}, frame)["full"]
    for effect in EFFECTS:
        if effect.signal not in full.stages:
            continue
        truth = _truth(place, full, frame, effect.signal)
        source = frame if effect.signal == "ao" else known.replace(gi=None, reflection=None)
        place.say(f"{place.view}, settings of {effect.signal}")
        for name, (after, ms) in _run(branches(effect, recipe), source).items():
            key = f"front.{effect.signal}.{name}"
            result.figures.update({f"{key}.ms": ms, f"{key}.error": effect.judge(after, truth)})
        result.figures[f"front.{effect.signal}.behind"] = behind(settings_of(result.figures, effect.signal))
    return result


def _alike(one: Pipeline, other: Pipeline) -> bool:
    """Whether two branches are the same: tunables, and the resolution at which stages run."""
    resolutions = [
        {name: stage.place.reduction for name, stage in branch.stages.items() if isinstance(stage, Pipeline)}
        for branch in (one, other)
    ]
    return one.all_tunables() == other.all_tunables() and resolutions[0] == resolutions[1]


def branches(effect: Effect, recipe: Recipe) -> dict[str, Pipeline]:
    """The effect's stages at each setting, by its name: a preset's, or the values of the grid joined by ``x``.

    Presets with the same setting share a name, and a setting that a preset has is not measured twice.
    """
    full = one_bounce(recipe.build())
    present = full.all_tunables()
    start = f"{effect.signal}.estimate."
    tunables = [name for name in effect.grid if start + name in present]
    shared = {start + name: present[start + name] for name in SHARED if start + name in present}
    pipelines = {preset: one_bounce(replace(recipe, preset=preset).build()).with_tunables(shared) for preset in PRESETS}
    for values in product(*(effect.grid[name] for name in tunables)) if tunables else ():
        settings = {start + name: value for name, value in zip(tunables, values, strict=True)}
        pipelines["x".join(map(str, values))] = full.with_tunables(settings)
    found: dict[str, Pipeline] = {}
    for name, pipeline in pipelines.items():
        branch = only(pipeline, [effect.signal])
        same = next((other for other in found if _alike(found[other], branch)), None)
        if same is None:
            found[name] = branch
        elif name in PRESETS:
            found[f"{same}{JOINT}{name}"] = found.pop(same)
    return found


def _run(pipelines: Mapping[str, Pipeline], frame: Frame) -> dict[str, tuple[Frame, float]]:
    """The last of `FRAMES` static frames by each pipeline, and the least milliseconds that one after the first took.

    Processor time, which does not count waiting for other processes; the least, because they can only slow a frame
    down; and the pipelines take turns, so that all are beside the same ones.
    """
    after, states, least = {}, dict.fromkeys(pipelines), dict.fromkeys(pipelines, float("inf"))
    with torch.no_grad():
        for index in range(FRAMES):
            for name, pipeline in pipelines.items():
                begun = time.process_time()
                after[name], states[name] = pipeline(frame.replace(index=index), states[name])  # pyright: ignore[reportArgumentType]
                seconds = time.process_time() - begun
                least[name] = least[name] if index == 0 else min(least[name], seconds)
    return {name: (after[name], least[name] * 1e3) for name in pipelines}


def _truth(place: Place, pipeline: Pipeline, frame: Frame, signal: str) -> Truth:
    if signal == "ao":
        return ao_truth(place, pipeline, frame)
    if signal == "gi":
        return place.truth_of("indirect_diffuse", frame.gbuffer, {"bounces": 1})
    return place.truth_of("reflection", frame.gbuffer)
