"""Error against time: which settings are on the front, and how far behind it a preset is."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
import torch
from ablation_stand_ins import install
from court import court

from gbufrt import Pipeline
from gbufrt.commands.ablation import Plan, ablate, front
from gbufrt.commands.ablation.cache import Cache
from gbufrt.commands.ablation.front import EFFECTS, Setting
from gbufrt.commands.ablation.place import Place
from gbufrt.commands.ablation.records import Record
from gbufrt.commands.ablation.report import fronts, write_front
from gbufrt.commands.ablation.table import table
from gbufrt.commands.recipe import Recipe
from gbufrt.reduction import Reduction


def setting(name: str, ms: float, error: float) -> Setting:
    return Setting(name=name, ms=ms, error=error)


FAST, SLOW, WORSE = setting("1x8", 10, 0.3), setting("4x8", 40, 0.1), setting("2x8", 30, 0.35)
LOW, HIGH = setting("low", 20, 0.2), setting("high", 60, 0.1)


def test_the_front_is_what_no_other_beats():
    assert front.front([SLOW, WORSE, LOW, HIGH, FAST]) == [FAST, LOW, SLOW]
    assert front.front([]) == []
    same = setting("2x16", 10, 0.3)
    assert front.front([FAST, same]) == [FAST], "of two that are alike, one"


def test_a_preset_behind_the_front_is_found():
    assert front.behind([FAST, LOW]) == 1.0
    assert front.behind([FAST, LOW, SLOW, HIGH]) == pytest.approx(1.5), "4x8 errs no more, in 40 ms of 60"
    assert front.behind([FAST, setting("low", 20, 0.3)]) == pytest.approx(2.0)
    assert front.behind([FAST, setting("medium, high", 20, 0.3)]) == pytest.approx(2.0), "presets that are alike"
    assert math.isnan(front.behind([FAST, SLOW])), "no preset, nothing to say"
    assert not any(s.preset for s in (FAST, setting("lower", 1, 1)))


def test_settings_without_an_error_or_a_time_do_not_count():
    nothing = setting("low", 1, math.nan)
    assert math.isnan(front.behind([nothing, setting("high", 2, math.nan)]))
    assert front.behind([nothing, setting("1x8", 0, 0.05), SLOW, HIGH]) == pytest.approx(1.5)
    assert front.front([nothing, SLOW, setting("1x8", 0, 0.05)]) == [SLOW]


def test_beside_other_units_the_bar_tells_nothing():
    record = Record(
        world="builtin", view="village", subject="front", variant="full", beside=2, figures={"front.gi.behind": 9.0}
    )
    row = next(row for row in table([record]) if row.what.startswith("most times") and row.name == "GI")
    assert (row.reached, row.value, row.note) == (None, 9.0, "timed beside other units: no measure of speed")


def test_each_of_several_places_has_a_chart():
    figures = {f"front.ao.{name}.{key}": 1.0 for name in ("low", "1x8") for key in ("ms", "error")}
    records = [
        Record(world=world, view="still", subject="front", variant="full", figures=figures) for world in ("a", "b")
    ]
    assert list(fronts(records)) == ["Ambient occlusion, a: still", "Ambient occlusion, b: still"]
    assert list(fronts(records[:1])) == ["Ambient occlusion"]


def test_a_front_of_a_run_before_goes(tmp_path: Path):
    (tmp_path / "front.svg").write_text("old")
    assert write_front(tmp_path, []) is None
    assert not (tmp_path / "front.svg").exists()


@pytest.mark.parametrize(("ms", "reached"), [(43.0, True), (45.0, False)])
def test_the_bar_can_fail(ms: float, reached: bool):
    share = front.behind([FAST, SLOW, setting("high", ms, 0.1)])
    record = Record(
        world="builtin", view="village", subject="front", variant="full", figures={"front.gi.behind": share}
    )
    row = next(row for row in table([record]) if row.what.startswith("most times") and row.name == "GI")
    assert (row.reached, row.value, row.bound) == (reached, pytest.approx(ms / 40), front.TOLERANCE)


def half(branch: Pipeline, signal: str) -> Reduction | None:
    stage = branch.stages[signal]
    assert isinstance(stage, Pipeline)
    return stage.place.reduction


def test_settings_of_an_effect_answer_the_same_question_and_are_measured_once():
    for effect in EFFECTS:
        found = front.branches(effect, Recipe())
        tunables = {name: branch.all_tunables() for name, branch in found.items()}
        values = list(tunables.values())
        halves = [half(branch, effect.signal) for branch in found.values()]
        kinds = list(zip(values, halves, strict=True))
        assert all(a != b for n, a in enumerate(kinds) for b in kinds[:n]), "each is another"
        names = [preset for name in found for preset in name.split(front.JOINT) if preset in front.PRESETS]
        assert sorted(names) == sorted(front.PRESETS)
        assert all(set(branch.stages) == {effect.signal} for branch in found.values())
        for shared in front.SHARED:
            assert len({t.get(f"{effect.signal}.estimate.{shared}") for t in values}) == 1, shared
    gi = front.branches(EFFECTS[1], Recipe())
    assert {"medium", "high"} <= set(gi), "the same tunables at half resolution are another setting"
    found = front.branches(EFFECTS[2], Recipe())
    steps = {name: branch.all_tunables()["reflection.estimate.steps"] for name, branch in found.items()}
    assert steps["low"] < steps["4"] == steps["high"], "what the grid does not set is the preset's, or the recipe's"


def test_measured_in_a_court(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """More directions err less; the effects that a recipe leaves out are left out."""
    monkeypatch.setattr(front, "FRAMES", 2)
    place = Place(scene=court(), world="court", view="still", size=(36, 54), samples=16, cache=Cache(tmp_path))
    figures = front.measure(place, Recipe(without=("reflection",))).figures
    ao = {s.name: s for s in front.settings_of(figures, "ao")}
    assert {"1x8", "4x32"} <= set(ao)
    assert {"low", "medium", "high"} <= {word for name in ao for word in name.split(front.JOINT)}
    assert all(s.ms > 0 and 0 < s.error < 0.3 for s in ao.values())
    assert ao["1x32"].error > ao["4x32"].error
    assert front.settings_of(figures, "gi")
    assert not front.settings_of(figures, "reflection")
    assert figures["front.ao.behind"] >= 1.0


def test_page_and_file_show_the_front(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    install(monkeypatch)
    plan = Plan(
        out=tmp_path / "out", cache=tmp_path / "cache", size=(24, 32), frames=2, samples=2, views=("front", "above"),
        only=("front",), variants=(),
    )  # fmt: skip
    results = ablate(plan)
    assert not results.failures
    assert [record.view for record in results.records] == ["front"], "one view"
    page = (tmp_path / "out" / "report.html").read_text()
    root = ElementTree.fromstring((tmp_path / "out" / "front.svg").read_text())
    words = {node.text for node in root.iter() if node.tag.endswith("text")}
    assert {"Ambient occlusion", "Indirect light", "Reflections"} <= words
    assert any("low" in str(word) for word in words)
    assert 'id="front"' in page
    assert "<polyline" in page
    ablate(Plan(**{**vars(plan), "out": tmp_path / "other", "only": ("ao",)}))
    assert not (tmp_path / "other" / "front.svg").exists()
    assert 'id="front"' not in (tmp_path / "other" / "report.html").read_text()


def test_least_time_and_last_frame_are_taken(monkeypatch: pytest.MonkeyPatch):
    import boxes

    from gbufrt import Frame, Pass, Pipeline

    ticks = iter([0.0, 9.0, 10.0, 13.0, 20.0, 22.0, 30.0, 35.0])  # 9, 3, 2 and 5 seconds: the first does not count
    monkeypatch.setattr(front.time, "process_time", lambda: next(ticks))

    class Numbered(Pass):
        reads, writes = frozenset({"depth"}), frozenset({"ao"})

        def forward(self, frame: Frame) -> Frame:
            return frame.replace(ao=torch.full_like(frame.gbuffer.depth, float(frame.index)))

    after, ms = front._run({"a": Pipeline(ao=Numbered())}, boxes.frame(boxes.camera((4, 4))))["a"]
    assert ms == pytest.approx(2000.0)
    assert float(after.read("ao").mean()) == front.FRAMES - 1
