"""Plan: what an ablation measures, and where."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from gbufrt.commands.ablation import world as worlds
from gbufrt.commands.ablation.subjects import SIGNALS
from gbufrt.commands.ablation.variants import FULL, Variant, parse_variants
from gbufrt.commands.arguments.checks import SLOW, SUBJECTS, WORLD
from gbufrt.commands.arguments.values import at_least
from gbufrt.commands.recipe import Recipe

if TYPE_CHECKING:
    from tracer.scene.scene import Scene

STILL = ("frame", "taa", "depth_of_field", "front")
ONE_VIEW = ("taa", "front")
VIEWS: Mapping[str, tuple[str, ...]] = {  # of the built-in world; each subject where there is something to judge
    "signals": ("village", "cave", "plaza", "hall"),
    "frame": ("village", "hall"),
    "path": ("orbit",),
    "taa": ("village",),
    "motion_blur": ("orbit", "plaza"),
    "depth_of_field": ("closeup", "plaza"),
    "denoise": ("orbit",),
    "front": ("village",),
}
MOST_VIEWS = 4  # of a world that is not in the table


@dataclass(frozen=True, kw_only=True)
class Plan:
    """What to measure. The defaults give the table that the report begins with.

    Args:
        out: folder for report.html, report.json, report.csv, and what they are made from.
        worlds: built-in worlds or .vox files.
        views: views that stand still; by default four.
        paths: views that move, for what needs motion; by default one or two.
        size: ``(H, W)``.
        frames: static frames that signals accumulate over; whole frames take a quarter as many.
        samples: paths a pixel of the truth; cheaper truths take several times as many.
        recipe: the full pipeline.
        variants: groups (``passes``, ``presets``, ``methods``) or changes (``without=gi``, ``gtao.method=horizon``).
        sweeps: ``NAME=LOW:HIGH:COUNT``.
        only: subjects to judge by, ``world`` for all of `WORLD`; by default all of `SUBJECTS` but the slow ones.
        cache: folder where truth is kept; by default the user's own.
        resume: keep what is in ``out`` already.
    """

    out: Path
    worlds: tuple[str, ...] = ("builtin",)
    views: tuple[str, ...] = ()
    paths: tuple[str, ...] = ()
    size: tuple[int, int] = (270, 480)
    frames: int = 16
    samples: int = 32
    recipe: Recipe = field(default_factory=Recipe)
    variants: tuple[str, ...] = ("passes",)
    sweeps: tuple[str, ...] = ()
    only: tuple[str, ...] = ()
    cache: Path | None = None
    resume: bool = False

    def check(self) -> None:
        """Raise ValueError for settings that make no sense."""
        at_least("--frames", self.frames, 1)
        at_least("--samples", self.samples, 1)
        for name in self.only:
            if name not in (*SUBJECTS, "world"):
                raise ValueError(f"--only must be among {', '.join(SUBJECTS)}, world; got {name!r}")
        parse_variants(self.variants, self.sweeps, self.recipe)
        self.recipe.build()

    def wanted(self, subject: str) -> bool:
        """Whether the plan judges by a subject."""
        asked = subject in self.only or ("world" in self.only and subject in WORLD)
        return asked or (not self.only and subject not in SLOW)

    def views_of(self, scene: Scene, world: str, subject: str) -> tuple[str, ...]:
        """Where to judge by a subject.

        Raises:
            ValueError: the world has no such view.
        """
        if subject in WORLD:  # at places of their own, of the built-in world alone
            own = worlds.VIEWS[subject] if world in ("builtin", "valley") else ()
            return tuple(view for view in own if view in scene.views or subject in worlds.PLACELESS)
        still = subject in (*STILL, "signals")
        chosen = self.views if still else self.paths or self.views
        if not chosen:
            known = VIEWS[subject] if world in ("builtin", "valley") else ()
            chosen = known or tuple(scene.views)[: MOST_VIEWS if still else 1]
        for view in chosen:
            if view not in scene.views:
                raise ValueError(f"no view {view!r} in world {world!r}; it has {', '.join(scene.views)}")
        return chosen[:1] if subject in ONE_VIEW else chosen

    def units(self, scene: Scene, world: str) -> Iterator[tuple[Variant, str, str]]:
        """Variant, subject and view of everything to measure in a world; the full pipeline first."""
        for variant in parse_variants(self.variants, self.sweeps, self.recipe):
            for subject in self._subjects(variant):
                for view in self.views_of(scene, world, subject):
                    yield variant, subject, view

    def signals_of(self, variant: Variant) -> tuple[str, ...]:
        """Which signals of a variant are judged against truths of their own."""
        concerned = SIGNALS if variant.name == FULL else (variant.subject,)
        return tuple(name for name in SIGNALS if name in concerned and self.wanted(name))

    def _subjects(self, variant: Variant) -> list[str]:
        if variant.name == FULL:
            others = [name for name in SUBJECTS if name not in SIGNALS and self.wanted(name)]
            return [*(["signals"] if self.signals_of(variant) else []), *others]
        if variant.subject in SIGNALS:
            return ["signals"] if self.signals_of(variant) else []
        found = [variant.subject] if self.wanted(variant.subject) else []
        steadies = any(".accumulate" in change for change in variant.changes)
        return [*found, *(["path"] if variant.subject == "frame" and steadies and self.wanted("path") else [])]
