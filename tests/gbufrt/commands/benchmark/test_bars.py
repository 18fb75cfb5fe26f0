"""The table that `gbufrt bench --peers --scaling` ends with."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from gbufrt.commands.benchmark import bars, frames, peers, process, rays, run, scaling
from gbufrt.commands.benchmark.bars import ANOTHER_MACHINE, NO_OIDN, Row, table
from gbufrt.commands.benchmark.blender import NO_BPY
from gbufrt.commands.benchmark.scaling import Series
from gbufrt.commands.cli import main
from tracer.worlds import terrain


def figures() -> dict[str, Any]:
    """Made up, so that every bar that is judged is just reached."""
    totals = {"high": 1000.0, "medium": 500.0, "low": 200.0}
    lamps = Series(name="direct light", points=[(10, 20.0), (100, 25.0), (1000, 40.0)])
    return {
        "presets": {name: {"total_ms": ms, "passes_ms": {}, "peak_mb": 1.0} for name, ms in totals.items()},
        "rays": {"ms": 100.0, "mrays_per_s": 4.1},
        "scaling": {"lamps": [lamps.to_json()]},
        "tracing_ms": 1000.0,
        "rtx": {"ms": 600.0, "me1_ms": 300.0},
        "rates": {"grazing": 21.0, "occlusion": 5.5},
        "oidn_ms": 1000.0,
        "filters_ms": {peers.BILATERAL: 100.0, peers.KORNIA: 800.0, peers.ATROUS: 100.0, peers.OIDN_FAST: 500.0},
        "blender": {
            "version": "5.0",
            "motion_blur": {"ms": 40.0, "blender_ms": 800.0, "psnr": 32.0, "blender_psnr": 32.0, "sharp_psnr": 25.0},
            "depth_of_field": {
                "ms": 60.0,
                "blender_ms": 1200.0,
                "psnr": 36.0,
                "blender_psnr": 36.0,
                "sharp_psnr": 18.0,
            },
        },
        "worlds": {"small": 4.0, "large": 2.0},
        "hd": {"passes_ms": {"motion_blur": 40.0, "depth_of_field": 60.0}, "total_ms": 1.0, "peak_mb": 1500.0},
        "import_s": 1.0,
    }


def row_of(found: dict[str, Any], name: str) -> Row:
    (row,) = [row for row in table(found) if name in row.name]
    return row


RATES = ("to the horizon", "a grazing view", "AO rays")
JUDGED = (
    ("over one OIDN denoise", ("oidn_ms",), 999.0, "1.00x: 1000 ms beside 1000"),
    ("ME1 medium", ("presets", "medium", "total_ms"), 501.0, "0.50x: 500 ms beside 1000"),
    ("ME1 low", ("presets", "low", "total_ms"), 201.0, "0.20x: 200 ms beside 1000"),
    ("tracing a frame", ("tracing_ms",), 1001.0, "1.00x: 1000 ms beside 1000"),
    ("Minecraft RTX", ("rtx", "ms"), 601.0, "2.00x: 600 ms beside 300"),
    ("1,000 lamps", ("scaling", "lamps", 0, "points", 2, 1), 40.1, "2.00x: 40.0 ms beside 20.0"),
    ("1024x256x1024", ("worlds", "large"), 1.9, "0.50x: 2.0 Mrays/s beside 4.0"),
    ("bilateral", ("filters_ms", peers.BILATERAL), 101.0, "8.00x: 800 ms beside 100"),
    ("wavelet", ("filters_ms", peers.OIDN_FAST), 499.0, "5.00x: 500 ms beside 100"),
    ("Vector Blur over it", ("blender", "motion_blur", "ms"), 41.0, "20.00x: 800 ms beside 40"),
    ("PSNR over Blender's Vector", ("blender", "motion_blur", "psnr"), 31.9, "+0.0 dB: 32.0 beside 32.0"),
    ("Defocus over it", ("blender", "depth_of_field", "ms"), 61.0, "20.00x: 1200 ms beside 60"),
    ("PSNR over Blender's Defocus", ("blender", "depth_of_field", "blender_psnr"), 36.1, "+0.0 dB: 36.0 beside 36.0"),
    ("peak memory", ("hd", "peak_mb"), 1501.0, "1.50 GB"),
    ("import gbufrt", ("import_s",), 1.01, "1.00 s"),
)


@pytest.mark.parametrize(("name", "place", "worse", "measured"), JUDGED)
def test_a_bar_is_reached_or_missed(name: str, place: tuple[Any, ...], worse: float, measured: str):
    found = figures()
    row = row_of(found, name)
    assert (row.reached, row.verdict, row.measured) == (True, "yes", measured)
    for value in (worse, math.nan):
        at: Any = found
        for key in place[:-1]:
            at = at[key]
        at[place[-1]] = value
        row = row_of(found, name)
        assert (row.reached, row.verdict) == (False, "no")
    others = [row for row in table(found) if row.reached is not None and name not in row.name]
    assert len(others) == len(JUDGED) - 1


def test_rates_are_shown_but_not_judged():
    for name, rate in zip(RATES, (4.1, 21.0, 5.5), strict=True):
        row = row_of(figures(), name)
        assert row.value == rate
        assert row.measured == f"{rate:.2f} Mrays/s"
        assert row.reached is None
        assert row.verdict == f"not judged: {ANOTHER_MACHINE}"
    assert [row_of(figures(), name).bar for name in RATES] == [f"at least {r} Mrays/s" for r in ("8.2", "40", "10")]


def test_why_blender_did_not_run_is_named():
    found = {**figures(), "blender": {"error": NO_BPY}}
    missing = [row for row in table(found) if row.verdict == f"not measured: {NO_BPY}"]
    assert len(missing) == 4
    assert all("Blender" in row.name for row in missing)


@pytest.mark.parametrize(
    ("without", "names", "why"),
    [
        (("oidn_ms", "filters_ms"), {"OIDN denoise", "bilateral", "wavelet"}, "needs --peers"),
        (("blender",), {"Vector Blur over", "Defocus over", "Blender's V", "Blender's D"}, "needs --peers"),
        (("scaling", "worlds"), {"lamps", "1024"}, "needs --scaling"),
    ],
)
def test_what_options_left_out_is_named(without: tuple[str, ...], names: set[str], why: str):
    found = {name: figure for name, figure in figures().items() if name not in without}
    missing = [row for row in table(found) if row.verdict == f"not measured: {why}"]
    assert len(missing) == len(names)
    assert all(any(name in row.name for row in missing) for name in names)
    assert all((row.reached, row.value, row.measured) == (None, None, "") for row in missing)


def test_presets_that_did_not_run_are_named():
    found = figures()
    del found["presets"]["medium"]
    assert row_of(found, "ME1 medium").verdict == "not measured: needs --presets medium"
    assert row_of(found, "ME1 low").reached
    del found["presets"]["high"]
    named = ("OIDN denoise", "ME1 medium", "ME1 low", "tracing a frame")
    assert {row_of(found, name).note for name in named[2:]} == {"needs --presets high"}


def test_what_is_not_installed_or_not_reported_is_named():
    found = figures()
    found["oidn_ms"] = None
    del found["filters_ms"][peers.OIDN_FAST]
    found["hd"]["peak_mb"] = None
    found["scaling"] = {}
    assert row_of(found, "OIDN denoise").verdict == row_of(found, "wavelet").verdict == f"not measured: {NO_OIDN}"
    assert row_of(found, "bilateral").reached
    assert row_of(found, "peak memory").verdict == "not measured: the system does not report it"
    assert row_of(found, "lamps").verdict == "not measured: the run has no times of 10 and 1000 lamps"


@pytest.fixture
def tiny(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """All that a run measures, at a few pixels."""
    size = (24, 40)
    monkeypatch.setattr("tracer.worlds.builtin", lambda: terrain((32, 16, 32)))
    monkeypatch.setattr(process, "in_own_process", lambda run, *a: run(*a))
    monkeypatch.setattr(process, "STARTS", 1)
    monkeypatch.setattr(frames, "HD", size)
    monkeypatch.setattr(frames, "SMALL", size)
    monkeypatch.setattr(peers, "HD", size)
    monkeypatch.setattr("gbufrt.commands.benchmark.blender.blender_python", lambda: None)
    monkeypatch.setattr(rays, "TRACE_SIZE", size)
    monkeypatch.setattr(rays, "SIDE", 32)
    monkeypatch.setattr(scaling, "SMALL", size)
    monkeypatch.setattr(scaling, "LAMPS", (10, 1000))
    monkeypatch.setattr(scaling, "AXES", {"lamps": scaling.by_lamps})
    monkeypatch.chdir(tmp_path)


@pytest.mark.usefixtures("tiny")
def test_bench_ends_with_the_bars(capfd: pytest.CaptureFixture[str]):
    arguments = ["--presets", "low,medium,high", "--peers", "--scaling", "--size", "40x24", "--repeats", "1"]
    with pytest.raises(SystemExit) as end:
        main(["bench", *arguments, "--json", "found.json"])
    assert end.value.code == 0
    found = json.loads(Path("found.json").read_text())
    assert [row["name"] for row in found["bars"]] == [bar.name for bar in bars.BARS]
    without_oidn = {row["name"] for row in found["bars"] if row["note"] == NO_OIDN}
    assert len(without_oidn) == (0 if peers.has_oidn() else 2)
    for row in found["bars"]:
        known = row["name"] not in without_oidn and "Blender" not in row["name"]
        assert (row["value"] is not None) == known, row
        assert (row["reached"] is None) == (not known or "rays over" in row["name"]), row
    again = table(found)
    assert [row.to_json() for row in again] == found["bars"], "the file holds all that the table is made of"
    shown = capfd.readouterr().out
    last = shown[shown.index("reached") :]
    assert all(row["name"].split()[0] in last for row in found["bars"])
    assert "median ms" not in last


@pytest.mark.usefixtures("tiny")
def test_only_what_the_options_ask_for_is_measured(monkeypatch: pytest.MonkeyPatch):
    asked: list[str] = []
    steps, size = run._steps, (24, 40)
    monkeypatch.setattr(run, "_steps", lambda plan, folder: asked.extend(s.key for s in steps(plan, folder)) or [])
    monkeypatch.setattr(bars, "table", lambda found: [])
    own, plan = (
        (["tracing_ms", "rtx", "rates"], ["", "hd", "import_s"]),
        run.Plan(presets=("low",), size=size, repeats=1),
    )
    for planned, keys in (
        (plan, []),
        (replace(plan, peers=True), ["peers", *own[0], "oidn_ms", "filters_ms", "blender", *own[1]]),
        (replace(plan, scaling=True), ["scaling", *own[0], "worlds", "octree", *own[1]]),
        (replace(plan, peers=True, device="cuda"), ["peers"]),
    ):
        asked.clear()
        run.measure(planned)
        assert asked == ["rays", "", "presets", *keys]
