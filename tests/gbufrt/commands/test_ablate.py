"""The ablation as a whole, over stand-ins that are quick and count what they did."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path

import pytest
from ablation_stand_ins import FakeAO, FakeGI, calls, install

import gbufrt.commands.ablation.units as units
from gbufrt.commands.ablation import Plan, Results, ablate
from gbufrt.commands.ablation.cache import sources
from gbufrt.commands.ablation.variants import parse_sweep, parse_variants
from gbufrt.commands.cli import main
from gbufrt.commands.recipe import Recipe
from gbufrt.frame import Frame

SMALL = {"size": (24, 32), "frames": 2, "samples": 2, "views": ("front", "above")}


@pytest.fixture(autouse=True)
def stand_ins(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    install(monkeypatch)
    monkeypatch.chdir(tmp_path)


def measured(**changes: object) -> Results:
    return ablate(Plan(**{"out": Path("out"), "cache": Path("cache"), **SMALL, **changes}))  # pyright: ignore[reportArgumentType]


def report(out: str = "out") -> dict:
    return json.loads(Path(out, "report.json").read_text())


def test_variants_are_parsed():
    base = Recipe()
    names = [v.name for v in parse_variants(["passes", "presets"], [], base)]
    assert names[0] == "full"
    assert {"without=ao", "without=gi", "without=reflection", "composite=me1", "preset=low"} <= set(names)
    several = parse_variants(["without=gi+ao.estimate.steps=5", "fakeao.radius=2"], [], base)
    assert several[1].recipe.without == ("gi",)
    assert several[1].recipe.set == {"ao.estimate.steps": 5}
    assert (several[1].subject, several[2].subject) == ("frame", "ao")
    steps = parse_sweep("fakeao.steps=1:4:4", base)
    assert [v.recipe.set["fakeao.steps"] for v in steps] == [1, 2, 3, 4]
    assert [v.axis for v in parse_sweep("fakeao.radius=0.25:2:2", base)] == [
        ("fakeao.radius", 0.25),
        ("fakeao.radius", 2.0),
    ]
    for wrong in ("fakeao.radius", "fakeao.radius=1:2", "fakeao.radius=1:2:1", "=1:2:3"):
        with pytest.raises(ValueError, match="--sweep"):
            parse_sweep(wrong, base)
    with pytest.raises(ValueError, match="neither a group"):
        parse_variants(["nonsense"], [], base)


def test_the_table_gives_known_errors_and_trivial_answers():
    rows = {row.what: row for row in measured(variants=()).rows}
    ao = rows["RMSE to true AO at the same radius"]
    assert ao.value == pytest.approx((0.5 * 0.01**2 + 0.5 * 0.11**2) ** 0.5, rel=0.05)  # every other column is 0.1 off
    assert ao.reached is False
    assert ao.trivial["ao = 1"] == pytest.approx((0.5 * 0.4**2 + 0.5 * 0.5**2) ** 0.5, rel=0.05)
    gi = rows["squared error over squared truth, on-screen part of one bounce"]
    assert gi.value == pytest.approx(0.25, rel=1e-3)  # one bounce, not the preset's two
    mirror = rows["RMSE over mean true radiance, mirrors whose hit is on screen"]
    assert mirror.value is not None
    assert 0.1 <= mirror.value < 0.2  # a tenth too bright; GI is kept away from it
    assert mirror.trivial["black"] == pytest.approx(10 * mirror.value, rel=1e-3)
    assert rows["bent normal's error over the normal's, where true AO < 0.9"].value == pytest.approx(1.0)
    assert rows["dB gained, centred shutter"].reached is None  # nothing moves: no pixel to judge by
    kornia = rows["dB over kornia's joint bilateral, least of four frames from the first on"]
    assert set(kornia.views) == {"front", "above"}
    assert kornia.trivial["the input"] is not None


def test_signals_are_judged_after_the_first_frames_too(monkeypatch: pytest.MonkeyPatch):
    """AO that is off by 0.2, 0.1, 0.07... and GI that starts black: one frame and four count from an empty history."""
    real_ao, real_gi = FakeAO.forward, FakeGI.forward

    def slow_ao(self: FakeAO, frame: Frame) -> Frame:
        self.bias = 0.2 / (int(frame.index) + 1)
        return real_ao(self, frame)

    def slow_gi(self: FakeGI, frame: Frame) -> Frame:
        self.share = 0.5 * int(frame.index)
        return real_gi(self, frame)

    monkeypatch.setattr(FakeAO, "forward", slow_ao)
    monkeypatch.setattr(FakeGI, "forward", slow_gi)
    results = measured(variants=(), only=("ao", "gi", "reflection"), frames=6, views=("front",))
    figures = results.records[0].figures
    for key, bias in (("ao.rmse_1", 0.2), ("ao.rmse_4", 0.05), ("ao.rmse", 0.2 / 6)):
        assert figures[key] == pytest.approx((0.5 * bias**2 + 0.5 * (bias + 0.1) ** 2) ** 0.5, rel=0.05), key
    assert figures["gi.error_1"] == pytest.approx(1.0)  # black
    assert figures["gi.error_4"] == pytest.approx(0.25, rel=1e-3)  # half as much again
    bars = {row.what: row for row in results.rows}
    assert bars["the same RMSE after 1 frame from an empty history"].reached is False
    assert bars["the same error after 1 frame from an empty history"].reached is False


def test_json_csv_and_page_say_the_same():
    results = measured(variants=("passes",), sweeps=("fakeao.bias=0:0.2:3",))
    assert not results.failures
    values = {
        (r["subject"], r["view"], r["variant"], name): value
        for r in report()["records"]
        for name, value in r["figures"].items()
    }
    lines = list(csv.DictReader(Path("out/report.csv").read_text().splitlines()))
    told = {
        (line["subject"], line["view"], line["variant"], line["measure"]): float(line["value"])
        for line in lines
        if line["subject"] == "front" or not line["measure"].endswith((".ms", ".peak_mb"))
    }
    assert told == values
    assert any(line["measure"] == "ao.estimate.peak_mb" for line in lines)
    page = Path("out/report.html").read_text()
    assert not re.search(r'(src|href)\s*=\s*["\']?(https?:|//|\.|/)', page)
    assert "@import" not in page
    assert "url(" not in page
    assert page.count("data:image/jpeg;base64,") > 20
    assert "without reflection" in page
    assert "fakeao.bias" in page
    assert len(page) < 15e6


def test_leaving_a_pass_out_is_measured_where_it_changes_the_frame():
    results = measured(variants=("passes",), only=("frame",))
    losses = {(r.variant, r.view): r.figures["loss"] for r in results.records if "loss" in r.figures}
    assert losses["without=gi", "front"] > 0.5  # too dark a frame gets darker still
    assert losses["without=ao", "front"] == 0.0  # sky visibility is what this composite uses: nothing changes
    (whole,) = [row for row in results.rows if row.name == "whole frame"]
    assert whole.reached is False  # and what changes nothing does not earn its place
    assert whole.value == min(v for (name, _), v in losses.items() if name.startswith("without="))


def test_a_failing_variant_is_told_in_its_row_and_ends_nothing(capsys: pytest.CaptureFixture[str]):
    options = ["--size", "32x24", "--frames", "1", "--samples", "1", "--views", "front", "--only", "ao,frame"]
    with pytest.raises(SystemExit) as end:
        main(["ablate", *options, "--out", "out", "--cache", "cache", "--variants", "without=nothing,preset=low",
              "--sweep", "fakeao.radius=1:5:3", "--sweep", "ao.nothing=1:2:2"])  # fmt: skip
    assert end.value.code == 0
    failed = {r["variant"]: r["error"] for r in report()["records"] if r["error"]}
    assert set(failed) == {"without=nothing", "fakeao.radius=5", "ao.nothing=1", "ao.nothing=2"}
    assert "radius must be at most 3" in failed["fakeao.radius=5"]
    assert {r["variant"] for r in report()["records"] if not r["error"]} >= {"full", "preset=low", "fakeao.radius=3"}
    assert "failed: fakeao.radius=5" in capsys.readouterr().out
    assert "radius must be at most 3" in Path("out/report.html").read_text()
    assert "radius must be at most 3" in Path("out/report.csv").read_text()


def test_resume_skips_what_is_done_and_tries_failures_again(monkeypatch: pytest.MonkeyPatch):
    asked = {"only": ("ao",), "variants": ("fakeao.radius=2", "fakeao.radius=5")}
    first = measured(**asked)
    done = calls["ao"]
    again = measured(**asked, resume=True)
    assert [r.figures for r in again.records] == [r.figures for r in first.records]
    assert [r.variant for r in again.failures] == ["fakeao.radius=5"] * 2
    assert calls["ao"] - done == 2  # the two failures alone
    done = calls["ao"]
    measured(**{**asked, "variants": ("fakeao.radius=2",)}, frames=3, resume=True)  # another setting is another record
    assert calls["ao"] > done
    done = calls["ao"]
    measured(**asked)
    assert calls["ao"] > done + 2  # without --resume all is made again


def test_an_interrupted_run_goes_on(monkeypatch: pytest.MonkeyPatch):
    real, count = units._judge, 0

    def stop(*arguments: object) -> object:
        nonlocal count
        count += 1
        if count == 3:
            raise KeyboardInterrupt
        return real(*arguments)  # pyright: ignore[reportArgumentType]

    monkeypatch.setattr(units, "_judge", stop)
    with pytest.raises(KeyboardInterrupt):
        measured(only=("ao", "frame"), variants=())
    monkeypatch.setattr(units, "_judge", real)
    before = calls["ao"]
    assert len(measured(only=("ao", "frame"), variants=(), resume=True).records) == 4
    assert calls["ao"] - before == 2  # one frame each for the two that were not done


def test_truth_is_kept_by_content(monkeypatch: pytest.MonkeyPatch):
    measured(only=("ao",), variants=())  # two halves of the truth a view
    assert (calls["truth ao"], calls["render"]) == (4, 2)
    measured(only=("ao",), variants=(), out=Path("elsewhere"))
    assert (calls["truth ao"], calls["render"]) == (4, 2)
    measured(only=("ao",), variants=(), out=Path("elsewhere"), worlds=("other",))
    assert calls["truth ao"] == 8  # another world
    measured(only=("ao",), variants=(), samples=3)
    assert calls["truth ao"] == 12
    measured(only=("ao",), variants=("fakeao.radius=2",))
    assert calls["truth ao"] == 16  # truth of the other radius
    for path in Path("cache").glob("ambient_occlusion*.npz"):
        path.write_bytes(path.read_bytes()[:100])
    measured(only=("ao",), variants=())
    assert calls["truth ao"] == 20  # damaged files are made again
    monkeypatch.setattr("gbufrt.commands.ablation.place.sources", lambda *_: sources("post"))
    measured(only=("ao",), variants=())
    assert calls["truth ao"] == 24  # another tracer


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--only", "shadows"], "--only must be ao, gi"),
        (["--views", "nowhere"], "no view 'nowhere'"),
        (["--frames", "0"], "--frames must be 1 or more"),
        (["--samples", "0"], "--samples must be 1 or more"),
        (["--size", "0x3"], "--size"),
        (["--sweep", "fakeao.radius"], "--sweep must be NAME=LOW:HIGH:COUNT"),
        (["--variants", "rubbish"], "neither a group"),
        (["--preset", "best"], "--preset must be low, medium"),
        (["missing.vox"], "missing.vox does not exist"),
        (["--out", "file"], "--out file must be a folder"),
    ],
)
def test_mistakes_are_told_in_one_line(arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]):
    Path("file").touch()
    with pytest.raises(SystemExit) as end:
        main(["ablate", "--cache", "cache", *([] if "--out" in arguments else ["--out", "out"]), *arguments])
    told = capsys.readouterr().err.strip()
    assert end.value.code == 2
    assert words in told
    assert "\n" not in told
    assert not Path("out").exists()
