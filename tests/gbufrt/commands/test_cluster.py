"""Work on real Ray workers: the same frames and figures as one run's, whatever happens to a worker."""

from __future__ import annotations

import json
import os
import secrets
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
import torch

from gbufrt.commands.arguments.checks import check_cluster
from gbufrt.commands.arguments.options import ClusterOptions
from gbufrt.commands.cli import main
from gbufrt.commands.cluster import Cluster, open_cluster
from gbufrt.commands.flights.shots import cut
from gbufrt.files.exr import read_exr

FRAMES, LEAD_IN = 10, 4
FLIGHT = ("render", "terrain", "--size", "24x16", "--preset", "low", "--light-samples", "1", "--warmup", "1")
QUICK = ("ao.accumulate.blend=0.2", "gi.accumulate.blend=0.2", "reflection.accumulate.blend=0.2", "taa.blend=0.2")
ADAPTED = ("exposure.speed_up=100", "exposure.speed_down=100")
SHORT = [part for setting in (*QUICK, *ADAPTED) for part in ("--set", setting)]  # histories that end in four frames
holders: list[int] = []  # processes that started the cluster of these tests
HOLD = """
import sys, ray
ray.init("local", num_cpus=2, include_dashboard=False, log_to_driver=False, logging_level="ERROR")
print(ray.get_runtime_context().gcs_address, flush=True)
sys.stdin.read()
"""


def run(*arguments: object) -> int:
    with pytest.raises(SystemExit) as exit:
        main([str(argument) for argument in arguments])
    assert isinstance(exit.value.code, int)
    return exit.value.code


@pytest.fixture(scope="module")
def cluster() -> Iterator[str]:
    """The address of a cluster of two cores, which ends with the tests."""
    if find_spec("ray") is None:
        pytest.skip("Ray is not installed: pip install 'gbufrt[cluster]'")
    token = {"RAY_AUTH_MODE": "token", "RAY_AUTH_TOKEN": secrets.token_hex(16)}  # read when Ray is imported
    quiet = {"RAY_USAGE_STATS_ENABLED": "0", "RAY_worker_niceness": "0"}
    pipe: Any = subprocess.PIPE
    with pytest.MonkeyPatch.context() as patch:
        for name, value in (token | quiet).items():
            patch.setenv(name, value)
        with subprocess.Popen([sys.executable, "-c", HOLD], stdin=pipe, stdout=pipe, text=True) as holder:
            assert holder.stdin is not None
            assert holder.stdout is not None
            holders.append(holder.pid)
            yield holder.stdout.readline().strip()
            holder.stdin.close()


@pytest.fixture
def trusted(cluster: str, spread: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """The address of a cluster that has been found to answer: nothing asks again."""
    monkeypatch.setattr("gbufrt.commands.cluster._probe", lambda address: None)
    return cluster


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


def left_behind() -> list[Path]:
    """Temporary folders of the runs that this process began."""
    return list(Path(tempfile.gettempdir()).glob(f"gbufrt-{os.getpid()}-*"))


def workers_at_work(ancestor: int) -> list[int]:
    """Descendants of a process that are Ray workers which run a task."""
    parents, busy = {}, []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            stat, command = (folder / "stat").read_text(), (folder / "cmdline").read_bytes()
        except OSError:  # it has just ended
            continue
        parents[int(folder.name)] = int(stat.rpartition(")")[2].split()[1])
        if b"ray::_steps" in command:
            busy.append(int(folder.name))

    def descends(pid: int) -> bool:
        return pid == ancestor or (pid in parents and descends(parents[pid]))

    return [pid for pid in busy if descends(pid)]


@pytest.mark.skipif(not Path("/proc/self/cmdline").exists(), reason="finds the worker in /proc")
def test_a_lost_worker_costs_its_shot_alone(
    trusted: str, spread: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    steps: list[str] = []
    killed: list[int] = []
    whole = Cluster.run

    def disturbed(self: Cluster, *arguments: Any, **options: Any) -> Iterator[str]:
        for what in whole(self, *arguments, **options):
            steps.append(what)
            if len(steps) == 3:  # workers are at most two steps ahead of what is read: a shot of seven goes on
                killed.append(workers_at_work(holders[-1])[0])
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


def fails(shared: str, task: int, folder: Path) -> Iterator[int]:
    yield task
    raise FileNotFoundError(f"{shared} does not exist")


def test_an_error_in_a_worker_is_the_users(trusted: str, tmp_path: Path):
    with open_cluster(ClusterOptions(cluster=trusted)) as opened:
        steps = opened.run(fails, [7], shared="world.vox", out=tmp_path)
        assert next(steps) == 7
        with pytest.raises(FileNotFoundError, match=r"^world.vox does not exist$"):
            next(steps)


def waits(shared: None, task: int, folder: Path) -> Iterator[int]:
    yield task
    (folder / "half.exr").write_bytes(b"half")
    time.sleep(60.0)


def test_a_run_that_is_cut_short_leaves_nothing(trusted: str, tmp_path: Path):
    with open_cluster(ClusterOptions(cluster=trusted)) as opened:
        steps: Any = opened.run(waits, [1, 2], shared=None, out=tmp_path)
        next(steps)
        assert left_behind()
        begun = time.monotonic()
        steps.close()
        assert not left_behind()
        assert time.monotonic() - begun < 10, "nobody waits for the workers"


class TwoError(Exception):
    def __init__(self, one: int, other: int) -> None:
        super().__init__(f"{one} and {other}")


class HolderError(ValueError):
    def __init__(self) -> None:
        super().__init__("holds what cannot be sent")
        self.held = lambda: None


def raises(shared: None, task: str, folder: Path) -> Iterator[int]:
    yield 1
    if task == "import":
        raise ModuleNotFoundError("no module named 'other'", name="other")
    if task == "own":
        raise ModuleNotFoundError("no module named 'tracer.new'", name="tracer.new")
    raise {"two": TwoError(1, 2), "holder": HolderError(), "key": KeyError("depth")}[task]


def test_every_error_in_a_worker_is_told_as_what_it_is(trusted: str, tmp_path: Path):
    told = {
        "two": (RuntimeError, "TwoError: 1 and 2"),
        "holder": (ValueError, "HolderError: holds what cannot be sent"),
        "key": (RuntimeError, "KeyError: 'depth'"),
        "import": (RuntimeError, "ModuleNotFoundError: no module named 'other'"),
        "own": (ValueError, "gbufrt must be installed on all machines of the cluster: no module named 'tracer.new'"),
    }
    with open_cluster(ClusterOptions(cluster=trusted)) as opened:
        for task, (kind, message) in told.items():
            steps = opened.run(raises, [task], shared=None, out=tmp_path)
            next(steps)
            with pytest.raises(kind) as error:
                next(steps)
            assert str(error.value) == message
            assert "in raises" in str(error.value.__cause__)


def test_another_version_on_a_machine_is_told(trusted: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("gbufrt.commands.cluster.__version__", "0.0.1")
    with open_cluster(ClusterOptions(cluster=trusted)) as opened, pytest.raises(ValueError, match=r"not 0\.0\.1"):
        list(opened.run(raises, ["key"], shared=None, out=tmp_path))


def ends(shared: None, task: int, folder: Path) -> Iterator[int]:
    yield task
    os._exit(1)


def test_a_worker_that_is_lost_again_and_again_is_told(trusted: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("gbufrt.commands.cluster.RETRIES", 0)
    lost = pytest.raises(ChildProcessError, match=r"^lost 1 workers over one task")
    with open_cluster(ClusterOptions(cluster=trusted)) as opened, lost:
        list(opened.run(ends, [1], shared=None, out=tmp_path))


@pytest.mark.parametrize(
    ("frames", "workers", "lead_in"), [(8, 2, 2), (240, 2, 40), (240, 64, 40), (5, 9, 0), (1, 4, 40)]
)
def test_shots_cover_a_flight_and_take_equally_long(frames: int, workers: int, lead_in: int):
    shots = cut(frames, range(frames), workers=workers, lead_in=lead_in)
    assert [index for shot in shots for index in shot.wanted] == list(range(frames))
    assert [shot.begin for shot in shots] == [max(shot.wanted[0] - lead_in, 0) for shot in shots]
    lengths = [len(shot.frames) for shot in shots]
    assert max(lengths) - min(lengths) <= 2, "nobody waits for the last one"
    assert all(len(shot.wanted) >= lead_in // 2 for shot in shots[1:])
    assert len(shots) <= workers
    some = cut(frames, [frames - 1], workers=workers, lead_in=lead_in)
    assert [(shot.begin, shot.wanted) for shot in some] == [(shots[-1].begin, (frames - 1,))]


def test_a_flight_of_many_frames_has_shots_that_may_be_lost():
    assert max(len(shot.wanted) for shot in cut(5000, range(5000), workers=2, lead_in=40)) < 300
    assert len(cut(5000, range(5000), workers=2, lead_in=1000)) == 2


@pytest.mark.parametrize(("frames", "workers"), [(512, 2), (513, 2), (1025, 4), (2049, 8), (5000, 2)])
def test_a_long_flight_takes_little_longer_than_one_shot_a_worker(frames: int, workers: int):
    shots = cut(frames, range(frames), workers=workers, lead_in=48)
    lanes = [0] * workers
    for shot in shots:
        lanes[lanes.index(min(lanes))] += len(shot.frames)
    assert max(lanes) < 1.2 * (frames + (workers - 1) * 48) / workers


def test_cores_are_shared_out(monkeypatch: pytest.MonkeyPatch):
    both = Cluster(sizes=(8, 4))
    assert [(both.workers, both.threads(tasks)) for tasks in (100, 4, 1)] == [(12, 1), (12, 2), (12, 8)]
    assert Cluster(sizes=(64, 2)).threads(4) == 16, "the small machine is left out"
    assert Cluster(sizes=(2,), most=8).workers == 2, "no more than the cores allow"
    assert (Cluster(sizes=(8, 4), each=3).workers, Cluster(sizes=(8, 4), each=3).threads(100)) == (3, 3)
    assert (Cluster(sizes=(8,), most=2).workers, Cluster(sizes=(8,), most=2).threads(100)) == (2, 4)
    assert (Cluster(sizes=(2,), each=16).workers, Cluster(sizes=(2,), each=16).threads(9)) == (1, 2)


def test_what_does_not_answer_is_told():
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
        with pytest.raises(ValueError, match=rf"nothing answers at --cluster 127.0.0.1:{port} .*ray start --head"):
            check_cluster(ClusterOptions(cluster=f"127.0.0.1:{port}"))


def test_a_host_that_cannot_be_one_is_told():
    with pytest.raises(ValueError, match=r"nothing answers at --cluster a\.\.b:6379"):
        check_cluster(ClusterOptions(cluster="a..b:6379"))


def test_what_answers_but_is_not_ray_is_told(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("gbufrt.commands.cluster.SECONDS_TO_CONNECT", 2.0)
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        options = ClusterOptions(cluster=f"127.0.0.1:{other.getsockname()[1]}")
        check_cluster(options)
        with pytest.raises(ValueError, match="is not Ray"), open_cluster(options):
            pass


def test_without_ray_the_extra_is_named(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("gbufrt.commands.arguments.checks.find_spec", lambda name: None)
    with pytest.raises(ValueError, match=r"pip install 'gbufrt\[cluster\]'"):
        check_cluster(ClusterOptions(cluster="local"))
