"""Which pipeline a command runs, in a form that files carry."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from gbufrt.commands.arguments.checks import DENOISERS, PIPELINES
from gbufrt.commands.arguments.options import PassOptions
from gbufrt.commands.arguments.settings import blamed, fitted, parse_settings
from gbufrt.commands.arguments.values import MOST_WARMUP, at_least, parse_names
from gbufrt.pipeline import Pipeline

WARMUPS: Mapping[str, int] = {"me1": 3, "minecraft-rtx": 15}
"""Runs of a pipeline over a first frame before it counts."""
OPTIONAL = ("fog", "pipeline", "denoiser", "irradiance_cache", "units_per_metre")
"""What a recipe says only where it is not the default."""


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """A pipeline in a form that fits a file's header."""

    preset: str = "high"
    composite: str = "physical"
    without: tuple[str, ...] = ()
    set: Mapping[str, Any] = field(default_factory=dict)
    warmup: int = 3
    fog: bool = False
    pipeline: str = "me1"
    denoiser: str = "asvgf"
    irradiance_cache: bool = False
    units_per_metre: float = 1.0

    @staticmethod
    def of(options: PassOptions, start: Recipe | None = None) -> Recipe:
        """The recipe of the command line; ``start`` fills in what it does not set (a preset or pipeline starts anew).

        Raises:
            ValueError: a setting or the warm-up is malformed, or the pipeline has no such composite or denoiser.
        """
        base = start or Recipe()
        if options.pipeline not in (None, base.pipeline):
            base = Recipe(pipeline=str(options.pipeline), warmup=WARMUPS[str(options.pipeline)], fog=base.fog)
        if options.preset is not None:
            kept = {name: getattr(base, name) for name in ("warmup", *OPTIONAL)}
            base = Recipe(preset=options.preset, **kept)
        if options.composite is not None:
            if base.pipeline != "me1":
                raise ValueError(f"--composite is for me1; leave it out with --pipeline {base.pipeline}")
            base = replace(base, composite=options.composite)
        if options.units_per_metre is not None:
            if base.pipeline != "me1":
                raise ValueError(f"--units-per-metre is for me1; leave it out with --pipeline {base.pipeline}")
            if not 0 < options.units_per_metre < math.inf:
                raise ValueError(f"--units-per-metre must be above 0, got {options.units_per_metre:g}")
            base = replace(base, units_per_metre=options.units_per_metre)
        if options.denoiser is not None:
            if base.pipeline != "minecraft-rtx":
                raise ValueError("--denoiser is for minecraft-rtx; leave it out, or give --pipeline minecraft-rtx")
            base = replace(base, denoiser=options.denoiser)
        base = replace(base, irradiance_cache=base.irradiance_cache or options.irradiance_cache)
        if base.irradiance_cache and (base.pipeline, base.denoiser) != ("minecraft-rtx", "asvgf"):
            raise ValueError("--irradiance-cache is for minecraft-rtx with asvgf; leave it out, or give --pipeline")
        warmup = base.warmup if options.warmup is None else options.warmup
        at_least("--warmup", warmup, 0, MOST_WARMUP)
        without = tuple(dict.fromkeys((*base.without, *parse_names(options.without))))
        short: dict[str, Any] = {} if options.ui is None else {"ui.picture": str(options.ui)}
        if options.status is not None:
            from post.presets import STATUSES

            short |= STATUSES[options.status]
        settings = {**base.set, **short, **parse_settings(options.set)}
        return replace(base, without=without, set=settings, warmup=warmup)

    @staticmethod
    def of_notes(notes: Mapping[str, Any], *, source: str = "the file", warmup: int | None = None) -> Recipe:
        """The recipe that `to_notes` wrote; the default recipe where there is no valid one.

        Args:
            notes: of a file.
            source: its name, for the message.
            warmup: replaces the file's.

        Raises:
            ValueError: the file asks for more warm-up runs than `MOST_WARMUP`.
        """
        found = notes.get("pipeline")
        if not isinstance(found, dict):
            return Recipe()
        try:
            recipe = Recipe(
                preset=str(found["preset"]),
                composite=str(found["composite"]),
                without=tuple(map(str, found["without"])),
                set=dict(found["set"]),
                warmup=int(found["warmup"]) if warmup is None else warmup,
                fog=found.get("fog") is True,
                pipeline=found.get("pipeline", "me1"),
                denoiser=found.get("denoiser", "asvgf"),
                irradiance_cache=found.get("irradiance_cache") is True,
                units_per_metre=float(found.get("units_per_metre", 1.0)),
            )
        except (KeyError, TypeError, ValueError, OverflowError):
            return Recipe()
        if recipe.pipeline not in PIPELINES:
            raise ValueError(f"{source} has the unknown pipeline {recipe.pipeline!r}; say which to run with --pipeline")
        if recipe.denoiser not in DENOISERS:
            raise ValueError(f"{source} has the unknown denoiser {recipe.denoiser!r}; say which to run with --denoiser")
        if not 0 <= recipe.warmup <= MOST_WARMUP:
            raise ValueError(f"{source} asks for more warm-up runs than {MOST_WARMUP}; say how many with --warmup")
        return recipe

    def to_notes(self) -> dict[str, Any]:
        """The recipe as JSON values."""
        notes, plain = {**asdict(self), "without": list(self.without)}, Recipe()
        usual = {name for name in OPTIONAL if getattr(self, name) == getattr(plain, name)}
        return {name: value for name, value in notes.items() if name not in usual}

    def build(self) -> Pipeline:
        """The pipeline; raises as `whole`, and ValueError where there is no such stage to leave out."""
        return self.whole().without(*self.without)

    def whole(self) -> Pipeline:
        """The pipeline with the stages that are left out.

        Raises:
            ValueError: there is no such preset or tunable, or a value that a pass refuses.
        """
        from post.path_traced import minecraft_rtx
        from post.presets import me1, with_fog

        composite: Any = self.composite
        denoiser: Any = self.denoiser
        if self.pipeline == "me1":
            pipeline = me1(self.preset, composite=composite, units_per_metre=self.units_per_metre)
        else:
            pipeline = minecraft_rtx(self.preset, denoiser=denoiser)
        pipeline = with_fog(pipeline) if self.fog else pipeline
        if self.set:
            present = pipeline.all_tunables()
            values = {name: fitted(name, value, present[pipeline.resolve(name)]) for name, value in self.set.items()}
            try:
                pipeline = pipeline.with_tunables(values)
            except ValueError as error:
                raise ValueError(blamed(values, error)) from error
        return pipeline
