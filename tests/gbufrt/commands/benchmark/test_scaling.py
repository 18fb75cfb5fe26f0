"""`gbufrt bench --scaling`: fitted exponents, the series, and their charts."""

from __future__ import annotations

import json
import math
import re
import xml.etree.ElementTree as ElementTree
from itertools import pairwise
from pathlib import Path

import pytest
import torch

from gbufrt.commands.bench import bench
from gbufrt.commands.benchmark import frames, process, rays, report, run, scaling
from gbufrt.commands.benchmark.scaling import Series
from gbufrt.commands.charts.axes import Axis
from gbufrt.commands.charts.drawing import END, NARROW, Point, lines, scatter
from gbufrt.commands.charts.sheet import sheet
from gbufrt.commands.cli import main
from tracer.worlds import terrain


@pytest.mark.parametrize("power", [-1.0, 0.0, 0.1, 1.3])
def test_exponent_of_a_power_law(power: float):
    points = [(float(x), 7.0 * x**power) for x in (1000, 10, 100)]
    assert scaling.slope(points) == pytest.approx(power, abs=1e-9)
    noisy = [(x, y * share) for (x, y), share in zip(points, (1.1, 1.1, 0.9), strict=True)]
    assert scaling.slope(noisy) == pytest.approx(power, abs=0.1)


def test_no_exponent_without_two_quantities():
    assert scaling.slope([(4.0, 1.0)]) is None
    assert scaling.slope([(4.0, 1.0), (4.0, 2.0)]) is None
    assert scaling.slope([(4.0, 1.0), (8.0, 0.0)]) is None
    assert report.growth(Series(name="one", points=[(1, 2.0)])) == ""
    assert report.growth(Series(name="two", points=[(1, 2.0), (10, 20.0)])) == "n^1.00"


def test_median_of_the_runs_after_the_first(monkeypatch: pytest.MonkeyPatch):
    ticks = iter([0.0, 50.0, 60.0, 61.0, 70.0, 73.0, 80.0, 82.0])  # 50, 1, 3 and 2 seconds
    monkeypatch.setattr(process.time, "perf_counter", lambda: next(ticks))
    runs = []
    assert process.timed(lambda: runs.append(1), 3, "cpu") == pytest.approx(2000.0)
    assert len(runs) == 4


@pytest.mark.parametrize("count", [1, 10, 1000])
def test_lamps_are_as_many_as_asked_for(count: int):
    scene = scaling.lamps_over_a_floor(count)
    shining = (scene.materials.emission.amax(1) > 0)[scene.world.bricks.long()]
    assert int(shining.sum()) == count
    assert scene.sun is None


def test_more_lamps_than_there_is_room_for():
    with pytest.raises(ValueError, match="count must be 1 to 1024, got 1025"):
        scaling.lamps_over_a_floor(1025)


def test_every_series_is_measured(monkeypatch: pytest.MonkeyPatch):
    small = (24, 40)
    monkeypatch.setattr("tracer.worlds.builtin", lambda: terrain((32, 16, 32)))
    monkeypatch.setattr(scaling, "SIZES", (small, (48, 80)))
    monkeypatch.setattr(scaling, "SMALL", small)
    monkeypatch.setattr(scaling, "COUNTS", (1, 8))
    monkeypatch.setattr(scaling, "LAMPS", (2, 8))
    monkeypatch.setattr(scaling, "SIDES", (32, 64))
    before = torch.get_num_threads()
    found = {axis: measure(1, "cpu") for axis, measure in scaling.AXES.items()}
    assert torch.get_num_threads() == before
    quantities = {axis: [x for x, _ in series[0].points] for axis, series in found.items()}
    threads = quantities.pop("threads")
    assert threads[0] == 1
    assert quantities == {
        "pixels": [960, 3840], "directions or samples": [1, 8], "lamps": [2, 8], "voxels on a side": [32, 64],
    }  # fmt: skip
    assert all(ms > 0 for series in found.values() for one in series for _, ms in one.points)
    frames = {one.name: one for one in found["pixels"]}
    assert set(frames) == {"all passes", "AO", "GI", "reflections", "G-buffer"}
    for n in range(2):
        parts = sum(frames[name].points[n][1] for name in scaling.BRANCHES.values())
        assert parts < frames["all passes"].points[n][1]


def stand_ins(monkeypatch: pytest.MonkeyPatch):
    passes = {"passes_ms": {}, "total_ms": 1.0, "peak_mb": 1.0}
    monkeypatch.setattr(process, "in_own_process", lambda *a: passes)
    monkeypatch.setattr(rays, "time_rays", lambda *a: {"ms": 10.0, "mrays_per_s": 41.0})
    monkeypatch.setattr(frames, "make_frame", lambda *a: None)
    monkeypatch.setattr(run.Plan, "judged", False)


def test_bench_prints_draws_and_writes_them(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capfd: pytest.CaptureFixture[str]
):
    series = [Series(name="direct light", points=[(10, 2.0), (1000, 4.0)]), Series(name="flat", points=[(10, 5.0)])]
    monkeypatch.setattr(scaling, "AXES", {"lamps": lambda repeats, device: series})
    stand_ins(monkeypatch)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as end:
        main(["bench", "--scaling", "--chart", "deep/chart.svg", "--json", "figures.json"])
    assert end.value.code == 0
    shown = capfd.readouterr().out
    assert "median ms, by lamps" in shown
    assert "n^0.15" in shown
    found = json.loads(Path("figures.json").read_text())["scaling"]["lamps"]
    assert found[0]["exponent"] == pytest.approx(0.1505, abs=1e-4)
    assert found[1] == {"name": "flat", "points": [[10, 5.0]], "exponent": None}
    root = ElementTree.fromstring(Path("deep/chart.svg").read_text())
    assert {node.text for node in root.iter() if "name" in node.get("class", "")} == {"direct light: n^0.15", "flat"}


def test_what_is_timed_has_one_colour_on_all_charts():
    names = {"pixels": ("all passes", "AO", "GI"), "samples": ("AO", "GI"), "threads": ("GI", "AO")}
    found = {axis: [Series(name=name, points=[(1, 1.0), (2, 2.0)]) for name in some] for axis, some in names.items()}
    hues: dict[str, set[str]] = {}
    for node in ElementTree.fromstring(report.chart_of(found)).iter():
        kind = node.get("class", "").split()
        if kind[:1] == ["name"]:
            hues.setdefault((node.text or "").partition(":")[0], set()).add(kind[1])
    assert all(len(some) == 1 for some in hues.values())
    assert len(set.union(*hues.values())) == 3


def test_threads_are_measured_on_the_cpu_alone():
    assert list(scaling.axes_of("cpu")) == list(scaling.AXES)
    assert set(scaling.AXES) - set(scaling.axes_of("cuda")) == {"threads"}


def test_the_figures_are_there_although_the_chart_fails(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    monkeypatch.setattr(scaling, "AXES", {})
    stand_ins(monkeypatch)
    monkeypatch.setattr(report, "chart_of", lambda found: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        bench(scaling=True, chart=tmp_path / "chart.svg", json=tmp_path / "figures.json")
    assert json.loads((tmp_path / "figures.json").read_text())["rays"]["ms"] == 10.0


def test_logarithmic_axes_leave_out_what_they_cannot_hold():
    points = [Point(x=x, y=1.0, label=str(x)) for x in (0.0, -1.0, 1.0, 2.0, math.nan)]
    chart = scatter(points, x_label="x", y_label="y", front=points, log="x")
    assert chart.count("<circle") == 2
    assert scatter(points[:2], x_label="x", y_label="y", log="x") == ""
    assert scatter(points, x_label="x", y_label="y").count("<circle") == 4
    drawn = lines(
        {"a": [(0.0, 1.0), (1.0, 0.0), (1.0, 2.0), (2.0, math.inf)], "b": [(1.0, 0.0)]}, x_label="", y_label=""
    )
    assert drawn.count("<circle") == 1


@pytest.mark.parametrize("scale", [1e-12, 1.0, 1e12])
def test_ticks_are_as_round_at_any_scale(scale: float):
    axis = Axis.of([2.0 * scale, 3.0 * scale])
    assert axis.ticks == pytest.approx([n * scale / 5 for n in range(10, 16)], rel=1e-9, abs=0.0)
    assert len(Axis.of([2.0 * scale, 3.0 * scale], log=True).ticks) >= 2
    same = Axis.of([scale, scale])
    assert 0.7 * scale < same.low < scale < same.high < 1.3 * scale
    assert Axis.of([0.0, 0.0]).low < 0 < Axis.of([0.0, 0.0]).high


def test_labels_of_lines_at_the_bottom_stay_on_the_chart():
    series = {f"{n}": [(1.0, 1.0), (2.0, 1.0 + n * 1e-3)] for n in range(12)}
    chart = lines({**series, "top": [(1.0, 1.0), (2.0, 100.0)]}, x_label="n", y_label="ms")
    heights = sorted(float(y) for y in re.findall(r'class="name[^"]*" x="[\d.]+" y="([\d.]+)"', chart))
    assert heights[-1] <= END + 4
    assert min(b - a for a, b in pairwise(heights)) >= 13


def test_labels_of_lines_do_not_overlap_and_stay_on_the_chart():
    series = {f"line {n} of many with names": [(1.0, 2.0 + 0.01 * n), (100.0, 3.0 + 0.01 * n)] for n in range(6)}
    chart = lines(series, x_label="n", y_label="ms", width=NARROW)
    names = [node for node in ElementTree.fromstring(chart).iter() if "name" in node.get("class", "")]
    heights = sorted(float(node.get("y", "")) for node in names)
    assert len(heights) == 6
    assert min(b - a for a, b in pairwise(heights)) >= 13
    assert all(float(node.get("x", "")) + 6 * len(node.text or "") <= NARROW for node in names)
    assert lines({}, x_label="n", y_label="ms") == ""
    whole = ElementTree.fromstring(sheet({"a": chart, "b": chart, "none": "", "c": chart}))
    places = [(float(node.get("x", "")), float(node.get("y", ""))) for node in whole if node.tag.endswith("svg")]
    assert len(set(places)) == 3
    assert "prefers-color-scheme: dark" in sheet({"a": chart})
