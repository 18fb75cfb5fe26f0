"""Figures of Minecraft RTX's frame and BetterRTX's world, over pictures of a few pixels and worlds whose answers are
known."""

from __future__ import annotations

from dataclasses import replace
from itertools import chain
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import torch
from ablation_stand_ins import fake_load
from court import court

from gbufrt.commands.ablation import Plan, world
from gbufrt.commands.ablation.cache import Cache
from gbufrt.commands.ablation.place import Place
from gbufrt.commands.ablation.records import Record
from gbufrt.commands.ablation.table import table
from gbufrt.commands.ablation.world import caustics, cut, fog, lights_out, programs, sky, upscaling
from gbufrt.commands.arguments.checks import SLOW, SUBJECTS, WORLD, WORLDS


def place(folder: Path, view: str, **options: Any) -> Place:
    return Place(
        scene=court(), world="court", view=view, size=(9, 12), samples=2, cache=Cache(folder), fps=24.0, **options
    )  # fmt: skip


def named(subject: str) -> set[str]:
    """All figures that rows and sections of a subject have words for."""
    bars = [bar for bar in world.BARS if bar.subject == subject]
    shown = chain(*(section.figures for section in world.SECTIONS if section.subject == subject))
    return {*shown, *(bar.key for bar in bars), *chain(*(bar.trivial.values() for bar in bars))} | {
        bar.limit for bar in bars if bar.limit
    }


def test_the_built_in_world_is_judged_by_all_but_what_is_slow(tmp_path: Path):
    load: Any = lambda name: SimpleNamespace(views=dict.fromkeys(WORLDS[name]))
    units = lambda plan, name: {
        subject for variant, subject, _ in plan.units(load(name), name) if variant.name == "full"
    }
    plan = Plan(out=tmp_path, variants=("passes",))
    assert units(plan, "builtin") >= set(WORLD) - set(SLOW)
    assert not units(plan, "builtin") & set(SLOW)
    assert units(replace(plan, only=("world",)), "builtin") == set(WORLD)
    assert units(replace(plan, only=("sky", "ao")), "builtin") == {"sky", "signals"}
    assert not units(plan, "terrain") & set(WORLD), "other worlds have no such places"
    assert {*world.JUDGES} == {*world.VIEWS} == set(WORLD) <= set(SUBJECTS)
    for subject in set(WORLD) - set(world.PLACELESS):
        assert set(world.VIEWS[subject]) <= set(load("builtin").views)
    with pytest.raises(ValueError, match="--only must be among"):
        replace(plan, only=("worlds",)).check()
    small = [view for _, _, view in replace(plan, only=("world",)).units(fake_load("builtin"), "builtin")]
    assert set(small) == {*sky.HOURS, *caustics.SUNS}, "a world without the views is judged where it needs none"


def test_rows_take_the_worst_place_and_times_beside_others_tell_nothing():
    def record(subject: str, view: str, beside: int = 1, **figures: float) -> Record:
        named = {key.replace("__", "."): value for key, value in figures.items()}
        return Record(world="builtin", view=view, subject=subject, variant="full", figures=named, beside=beside)

    found = [record("fog", "hall", fog__error=0.04), record("fog", "village", fog__error=0.06, fog__if_none=1.0)]
    found += [record("dispatch", "village", beside=2, dispatch__times=1.5)]
    rows = {row.what: row for row in table(found) if row.part == "world"}
    row = rows["RMS error over the mean after 16 static frames, to 1,024 steps a ray"]
    assert (row.value, row.view, row.reached, row.trivial["none"]) == (0.06, "village", False, 1.0)
    row = rows["time of a plain hit program over trace's"]
    assert (row.value, row.reached) == (1.5, None)
    assert rows["RMS error over the mean of all directions, to paths of light"].note == "slow: --only sky"
    assert len(rows) == len(world.BARS)


def test_caustics_are_told_from_none_and_from_an_even_wall(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(caustics, "PHOTONS", 200_000)
    monkeypatch.setattr(caustics, "BINS", 10)
    found = world.JUDGES["caustics"](place(tmp_path, "high sun"))
    assert found.figures["caustics.energy"] < 0.2
    assert found.figures["caustics.alike"] > 0.6
    assert named("caustics") <= set(found.figures)
    monkeypatch.setattr(caustics, "arrived", lambda scene, time: torch.eye(10, 20))
    assert world.JUDGES["caustics"](place(tmp_path, "high sun")).figures["caustics.alike"] < 0.3


def test_the_sky_is_off_by_what_it_lacks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(sky, "GRID", (2, 4))
    monkeypatch.setattr(sky, "RUNS", 1)
    exact = sky.truth

    def twice(spot: Place, ways: torch.Tensor, paths: int) -> tuple[torch.Tensor, torch.Tensor]:
        first, _ = exact(spot, ways, 2)
        return torch.full_like(first, 1.0), torch.full_like(first, 1.0)

    monkeypatch.setattr(sky, "truth", twice)
    monkeypatch.setattr("gbufrt.atmosphere.sky_picture", lambda air, sun: torch.full((1, 3, 64, 128), 0.97))
    found = world.JUDGES["sky"](place(tmp_path, "noon")).figures
    assert found["sky.error"] == pytest.approx(0.03, rel=1e-3)
    assert found["sky.if_even"] == 0.0
    assert found["sky.step"] == pytest.approx(0.0, abs=1e-3)
    assert named("sky") <= set(found)
    bands = torch.linspace(0.2, 1.0, 2048).mul(16).round().div(16).view(1, 1, -1, 1).expand(1, 3, -1, 8)
    assert sky.step(bands, (0.0, 0.6, 0.8), smooth=True) > 1.0


def test_programs_are_timed_and_find_what_trace_finds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(programs, "SIZE", (9, 12))
    found = world.JUDGES["dispatch"](place(tmp_path, "still")).figures
    assert found["dispatch.off"] == 0.0
    assert named("dispatch") <= set(found)


def test_upscaled_pictures_beat_interpolated_ones(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    for name, value in (("SIZE", (36, 54)), ("FRAMES", 6), ("CHECKED", (4, 5)), ("SAMPLES", 8), ("LIGHT_SAMPLES", 1)):
        monkeypatch.setattr(upscaling, name, value)
    found = world.JUDGES["upscale"](place(tmp_path, "turning"))
    assert found.figures["upscale.half.gain"] > 0.5
    assert found.figures["upscale.half.behind"] <= found.figures["upscale.half.behind_worst"]
    assert found.figures["upscale.half.bicubic_behind"] == found.figures["upscale.half.native_gain"]
    keys = named("upscale")
    assert keys - set(found.figures) <= {key for key in keys if "flip" in key}, "without FLIP's package"
    assert found.pictures["upscale.half"].shape[-1] >= 480


def test_lamps_that_go_out_are_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    for name, value in (("SIZE", (9, 12)), ("OUT", 2), ("LATER", 1), ("STEADY", (4, 5)), ("PATHS", 4)):
        monkeypatch.setattr(lights_out, name, value)
    monkeypatch.setattr(lights_out, "EVEN_LATER", (2,))
    found = world.JUDGES["asvgf"](place(tmp_path, "still"))
    later = {key for key in named("asvgf") if "asvgf.after" in key}
    assert named("asvgf") - later <= set(found.figures)
    assert len(later) == 4
    assert found.figures["asvgf.after_2_ours"] > 0
    assert found.figures["asvgf.over_denoise_Denoise"] == 1.0
    assert found.figures["asvgf.over_denoise_input"] > 1.0
    scenes = [lights_out.scene_at(fake_load("builtin"), number) for number in (0, 1)]
    suns = [torch.tensor((scene.sun or pytest.fail("no sun")).direction) for scene in scenes]
    cosine = torch.nn.functional.cosine_similarity(*suns, dim=0).double()
    assert 0 < float(1 - cosine) < 1e-4


def test_a_cache_gains_after_a_cut_and_forgets(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    for name, value in (("SIZE", (8, 12)), ("BEFORE", 4), ("NOISES", (0,)), ("PATHS", 8), ("TRUTH_PATHS", 8)):
        monkeypatch.setattr(cut, name, value)
    for name, value in (
        ("MEANS", 2),
        ("MOST", 5),
        ("KNOWN", 10),
        ("CUTS", {"still": ((4.0, 9.0, 30.0), (10.0, 2.5, 6.0), 42.0)}),
    ):
        monkeypatch.setattr(cut, name, value)
    found = world.JUDGES["irradiance_cache"](place(tmp_path, "still")).figures
    assert named("irradiance_cache") - {f"cut.bias_{n}" for n in (12,)} - {"cut.bias_indirect_12"} <= set(found)
    assert found["cut.bias"] < 0.5
    assert 0.0 < found["cut.left"] < 1.0


def test_fog_is_judged_by_brute_force(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    for name, value in (("SIZE", (8, 12)), ("HOURS", {"still": 16.0}), ("STEPS", 16), ("FRAMES", 3)):
        monkeypatch.setattr(fog, name, value)
    found = world.JUDGES["fog"](place(tmp_path, "still")).figures
    assert named("fog") <= set(found)
    assert found["fog.error"] < found["fog.if_none"]
    assert found["fog.mean"] == pytest.approx(1.0, abs=0.1)
