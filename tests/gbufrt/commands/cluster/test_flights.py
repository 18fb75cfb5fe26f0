"""Flights and ablations on real Ray workers: the same as one run's, whatever happens to a worker."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import torch
from command_line import run

from gbufrt.commands.cluster.cluster import Cluster
from gbufrt.commands.flights.shots import cut
from gbufrt.files.exr import read_exr

FRAMES, LEAD_IN = 10, 4
FLIGHT = ("render", "terrain", "--size", "24x16", "--preset", "low", "--light-samples", "1", "--warmup", "1")
QUICK = ("ao.accumulate.blend=0.2", "gi.accumulate.blend=0.2", "reflection.accumulate.blend=0.2", "taa.blend=0.2")
ADAPTED = ("exposure.speed_up=100", "exposure.speed_down=100")
SHORT = [part for setting in (*QUICK, *ADAPTED) for part in ("--set", setting)]  # histories that end in four frames


@pytest.fixture(scope="module")
def single(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One run without a cluster."""
    out = tmp_path_factory.mktemp("single") / "out"
    assert run(*FLIGHT, *SHORT, "--frames", FRAMES, "--out", out) == 0
    return out


@pytest.fixture(scope="module")
def spread(cluster: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same on two workers."""
    out = tmp_path_factory.mktemp("spread") / "out"
    assert on(cluster, out) == 0
    return out


def on(cluster: str, out: Path, *more: object) -> int:
    where = ("--cluster", cluster, "--workers", 2, "--lead-in", LEAD_IN)
    return run(*FLIGHT, *SHORT, "--frames", FRAMES, *where, "--out", out, *more)


def psnr(a: Path, b: Path, index: int) -> float:
    one, other = (read_exr(folder / f"frame_{index:04d}.exr").read("image").double() for folder in (a, b))
    return -10 * float(torch.log10(((one - other) ** 2).mean()))


def contents(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_two_workers_make_what_one_run_makes(single: Path, spread: Path):
    shots = cut(FRAMES, range(FRAMES), workers=2, lead_in=LEAD_IN)
    assert [shot.frames for shot in shots] == [range(0, 7), range(3, 10)]
    assert sorted(contents(spread)) == sorted(contents(single))
    for index in shots[0].wanted:
        assert psnr(single, spread, index) > 90, "the first shot begins as one run does"
    for index in shots[1].wanted:
        assert 50 < psnr(single, spread, index) < 1000, "its history is another, but tells no more"


def test_resume_makes_what_is_missing_as_it_was(
    trusted: str, spread: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    out = tmp_path / "out"
    shutil.copytree(spread, out)
    (out / "frame_0008.exr").unlink()
    kept = {path: path.stat().st_mtime_ns for path in out.iterdir() if "0008" not in path.name}
    steps: list[Any] = []
    whole = Cluster.run
    monkeypatch.setattr(Cluster, "run", lambda *a, **k: (steps.append(step) or step for step in whole(*a, **k)))
    assert on(trusted, out, "--resume") == 0
    assert contents(out) == contents(spread)
    assert kept == {path: path.stat().st_mtime_ns for path in kept}
    assert len(steps) == len(range(3, 9)), "the other shot is not made, nor what comes after"
    assert "all 10 frames" not in capsys.readouterr().out
    assert on("nowhere:0", out, "--resume") == 2
    assert on(trusted, out, "--resume") == 0
    assert "all 10 frames" in capsys.readouterr().out
    (out / "frame_0008.exr").unlink()
    where = ("--cluster", trusted, "--workers", 2, "--lead-in", LEAD_IN + 1)
    assert run(*FLIGHT, *SHORT, "--frames", FRAMES, *where, "--out", out, "--resume") == 2
    assert "has lead_in 4, not 5" in capsys.readouterr().err


def workers_at_work(ancestor: int) -> list[int]:
    """Descendants of a process that are Ray workers which run a task."""
    parents, busy = {}, []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            stat, command = (folder / "stat").read_text(), (folder / "cmdline").read_bytes()
        except OSError:  # it has just ended
            continue
        parents[int(folder.name)] = int(stat.rpartition(")")[2].split()[1])
        if b"ray::steps" in command:
            busy.append(int(folder.name))

    def descends(pid: int) -> bool:
        return pid == ancestor or (pid in parents and descends(parents[pid]))

    return [pid for pid in busy if descends(pid)]


@pytest.mark.skipif(not Path("/proc/self/cmdline").exists(), reason="finds the worker in /proc")
def test_a_lost_worker_costs_its_shot_alone(
    trusted: str,
    holder: subprocess.Popen[str],
    left_behind: Callable[[], list[Path]],
    spread: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
):
    steps: list[str] = []
    killed: list[int] = []
    whole = Cluster.run

    def disturbed(self: Cluster, *arguments: Any, **options: Any) -> Iterator[str]:
        for what in whole(self, *arguments, **options):
            steps.append(what)
            if len(steps) == 3:  # workers are at most two steps ahead of what is read: a shot of seven goes on
                killed.append(workers_at_work(holder.pid)[0])
                os.kill(killed[0], signal.SIGKILL)
            yield what

    monkeypatch.setattr(Cluster, "run", disturbed)
    assert on(trusted, tmp_path / "out") == 0
    assert killed
    assert not left_behind(), "the killed worker's folder is removed"
    assert len(steps) == len(set(steps)) == FRAMES + LEAD_IN, "no step comes twice, although it is made twice"
    assert contents(tmp_path / "out") == contents(spread)


def test_an_ablation_finds_the_same(trusted: str, tmp_path: Path):
    here, there = tmp_path / "here", tmp_path / "there"
    small = ("--size", "24x16", "--frames", 2, "--samples", 1, "--preset", "low", "--only", "ao,frame")
    command = ("ablate", "terrain", *small, "--variants", "without=ao,gtao.radius=-1", "--cache", tmp_path / "cache")
    assert run(*command, "--out", there, "--cluster", trusted, "--workers", 2) == 0
    assert run(*command, "--out", here) == 0
    one, other = (json.loads((folder / "report.json").read_text()) for folder in (here, there))
    assert one["table"] == other["table"]
    assert (one["about"]["traced"], other["about"]["traced"] > 0) == (0, True), "truth is kept for the next run"
    assert [record.pop("beside") for record in other["records"]] == [2] * len(one["records"])
    assert any("radius" in (record["error"] or "") for record in other["records"]), "a failure is told"
    for record in (*one["records"], *other["records"]):
        assert record["passes"] or record["error"]
        for timed in ("beside", "passes", "seconds"):
            record.pop(timed, None)
        record["figures"].pop("ms", None)
    assert one["records"] == other["records"]
    assert "no measure of speed" in (there / "report.html").read_text()
    assert "no measure of speed" not in (here / "report.html").read_text()
