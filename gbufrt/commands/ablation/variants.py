"""Variants: which pipelines are measured, and by which part of their work.

A variant is written as what it changes, joined by ``+``: ``without=gi``, ``preset=low``, ``composite=me1``,
``gtao.method=horizon+ao.estimate.steps=12``, ``gi.estimate=MarchGI`` (another pass in its place). Groups stand
for many: ``passes``, ``presets``, ``methods``.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from functools import cached_property
from typing import Literal, get_args, get_origin, get_type_hints

from gbufrt.commands.arguments.checks import PRESETS
from gbufrt.commands.arguments.settings import parse_settings
from gbufrt.commands.recipe import Recipe
from gbufrt.passes import Stage
from gbufrt.pipeline import Pipeline

FULL = "full"
GROUPS = ("passes", "presets", "methods")
BRANCHES = ("ao", "gi", "reflection", "motion_blur", "depth_of_field", "taa")
METHODS = ("method", "weights")  # tunables that choose a method
RIVALS = {"SSGI": "MarchGI"}  # passes that estimate the same signal by another method
ROUNDS = ("denoise", "accumulate")  # stages that several branches have, left out together


@dataclass(frozen=True, kw_only=True)
class Variant:
    """One pipeline to measure."""

    name: str
    recipe: Recipe
    group: str = "own"
    changes: tuple[str, ...] = ()
    """Tunables and stages that differ from the full pipeline."""
    swaps: Mapping[str, str] = field(default_factory=dict)
    """Stages that another pass of `post` replaces, by its class's name."""
    axis: tuple[str, float] | None = None
    """For a step of a sweep: the tunable and its value."""

    @cached_property
    def pipeline(self) -> Pipeline:
        """The pipeline, built once.

        Raises:
            ValueError: no such preset, stage, tunable or pass, or a value that does not fit.
        """
        pipeline = replace(self.recipe, without=()).build()
        for path, name in self.swaps.items():
            pipeline = _swapped(pipeline, path, name)
        return pipeline.without(*(path for pattern in self.recipe.without for path in _matching(pipeline, pattern)))

    @property
    def subject(self) -> str:
        """The subject that shows its effect: the branch that it changes, if only one, else the whole ``frame``."""
        try:
            names = self.pipeline.all_tunables()
            full = [name if name not in self.recipe.set else self.pipeline.resolve(name) for name in self.changes]
        except ValueError:  # reported in its row
            return "frame"
        heads = {name.partition(".")[0] for name in full}
        inner = all("." in name for name in full) and names
        return heads.pop() if inner and len(heads) == 1 and heads <= set(BRANCHES) else "frame"


def parse_variants(items: Iterable[str], sweeps: Iterable[str], base: Recipe) -> list[Variant]:
    """The full pipeline, then the variants of ``items`` and ``sweeps``, each once.

    Raises:
        ValueError: an item is malformed. A name that does not exist fails later, with its variant.
    """
    found = [Variant(name=FULL, recipe=base, group=FULL)]
    for item in items:
        found += _group(item, base) if item in GROUPS else [_variant(item, base)]
    for sweep in sweeps:
        found += parse_sweep(sweep, base)
    return list({variant.name: variant for variant in reversed(found)}.values())[::-1]


def parse_sweep(text: str, base: Recipe) -> list[Variant]:
    """``NAME=LOW:HIGH:COUNT``, evenly spaced, both ends included.

    Raises:
        ValueError: not of that form, or fewer than two steps.
    """
    name, _, span = text.partition("=")
    parts = span.split(":")
    try:
        low, high, count = float(parts[0]), float(parts[1]), int(parts[2])
    except (ValueError, IndexError):
        low, high, count = 0.0, 0.0, 0
    if not name.strip() or len(parts) != 3 or count < 2:
        raise ValueError(f"--sweep must be NAME=LOW:HIGH:COUNT with a count of at least 2, got {text!r}")
    values = [low + (high - low) * i / (count - 1) for i in range(count)]
    steps = {}
    for value in values:
        exact = _like_the_present(name.strip(), value, base)
        variant = _variant(f"{name.strip()}={exact:g}", base)
        steps[variant.name] = replace(variant, group="sweep", axis=(name.strip(), float(exact)))
    return list(steps.values())


def _like_the_present(name: str, value: float, base: Recipe) -> float:
    """A whole number for a tunable that counts something; a tunable that does not exist fails later, in its row."""
    pipeline = base.build()
    try:
        present = pipeline.all_tunables()[pipeline.resolve(name)]
    except ValueError:
        return value
    return round(value) if isinstance(present, int) and not isinstance(present, bool) else value


def _variant(text: str, base: Recipe, group: str = "own") -> Variant:
    recipe, settings, swaps, changes = base, dict(base.set), {}, []
    for part in text.split("+"):
        if "=" not in part:
            raise ValueError(
                f"--variants {text!r} is neither a group ({', '.join(GROUPS)}) nor NAME=VALUE joined by '+', such as "
                "without=gi, preset=low, composite=me1 or gtao.method=horizon"
            )
        ((name, value),) = parse_settings([part]).items()
        changes.append(str(value) if name == "without" else name)
        if name == "without":
            recipe = replace(recipe, without=(*recipe.without, str(value)))
        elif name in ("preset", "composite"):
            recipe = replace(recipe, **{name: str(value)})
        elif isinstance(value, str) and value[:1].isupper():
            swaps[name] = value
        else:
            settings[name] = value
    recipe = replace(recipe, set=settings)
    return Variant(name=text, recipe=recipe, group=group, changes=tuple(changes), swaps=swaps)


def _group(name: str, base: Recipe) -> list[Variant]:
    pipeline = base.build()
    texts = {
        "passes": lambda: _left_out(pipeline) + _other_composite(base),
        "presets": lambda: [f"preset={preset}" for preset in PRESETS if preset != base.preset],
        "methods": lambda: _other_methods(pipeline),
    }[name]()
    return [_variant(text, base, name) for text in texts]


def _left_out(pipeline: Pipeline) -> list[str]:
    """Each stage before the composite, then every branch's denoise stage together, then every accumulate stage."""
    names = list(pipeline.stages)
    before = names[: names.index("composite")] if "composite" in names else names
    rounds = [f"*.{part}" for part in ROUNDS if any(path.endswith(f".{part}") for path, _ in pipeline.passes())]
    return [f"without={name}" for name in (*before, *rounds)]


def _other_composite(base: Recipe) -> list[str]:
    return ["composite=" + ("me1" if base.composite == "physical" else "physical")]


def _other_methods(pipeline: Pipeline) -> list[str]:
    """Every value but the present one of every tunable that chooses a method."""
    found = []
    for path, stage in pipeline.passes():
        kinds = get_type_hints(type(stage).__init__)
        for key, present in stage.tunables().items():
            if key in METHODS and get_origin(kinds.get(key)) is Literal and not path.startswith("behind."):
                found += [f"{path}.{key}={choice}" for choice in get_args(kinds[key]) if choice != present]
        if type(stage).__name__ in RIVALS and not path.startswith("behind."):
            found.append(f"{path}={RIVALS[type(stage).__name__]}")
    return found


def _matching(pipeline: Pipeline, pattern: str) -> list[str]:
    """The stages that a pattern such as ``*.denoise`` stands for; a plain name stands for itself."""
    if "*" not in pattern:
        return [pattern]
    found = [path for path, _ in pipeline.passes() if fnmatchcase(path, pattern)]
    if not found:
        raise ValueError(f"no stage fits {pattern!r}; the pipeline has {', '.join(n for n, _ in pipeline.passes())}")
    return found


def _swapped(pipeline: Pipeline, path: str, name: str) -> Pipeline:
    """The pipeline with another pass at ``path``, which keeps the tunables that both have."""
    import post

    kind, old = getattr(post, name, None), dict(pipeline.passes()).get(path)
    if not (isinstance(kind, type) and issubclass(kind, Stage)):
        raise ValueError(
            f"no pass {name!r} in post; give STAGE=PASS, such as gi.estimate=MarchGI, or NAME=VALUE for a tunable"
        )
    kept = {} if old is None else {key: value for key, value in old.tunables().items() if key in kind().tunables()}
    return pipeline.replace(path, kind(**kept))
