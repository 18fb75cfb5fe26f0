"""Files appear whole or not at all, whoever else writes beside."""

from __future__ import annotations

import os
import platform
import resource
import subprocess
import sys
from pathlib import Path

import pytest
import smooth

from gbufrt.files import output
from gbufrt.files.exr import write_exr
from gbufrt.files.output import atomic

WRITER = """
import sys
from gbufrt.files.output import atomic
for _ in range(300):
    with atomic("shared.bin") as part:
        part.write_bytes(sys.argv[1].encode() * 200000)
    found = open("shared.bin", "rb").read()
    assert len(found) == 200000 and len(set(found)) == 1, "a file of both"
"""


def test_two_processes_may_write_the_same_file(tmp_path: Path):
    env = os.environ | {"PYTHONPATH": str(Path(output.__file__).parents[2])}
    writers = [subprocess.Popen([sys.executable, "-c", WRITER, name], cwd=tmp_path, env=env) for name in "ab"]
    assert [writer.wait(60) for writer in writers] == [0, 0]
    assert [path.name for path in tmp_path.iterdir()] == ["shared.bin"]


@pytest.mark.skipif(os.name == "nt", reason="asks for processes")
def test_what_a_killed_process_left_behind_is_removed_but_not_what_another_writes(tmp_path: Path):
    dead = subprocess.Popen([sys.executable, "-c", ""])
    dead.wait()
    left, written, elsewhere = (
        tmp_path / f".a.png.{machine}-{process}.part"
        for machine, process in ((platform.node(), dead.pid), (platform.node(), os.getppid()), ("far", dead.pid))
    )
    for path in (left, written, elsewhere):
        path.write_bytes(b"half")
    with atomic(tmp_path / "a.png") as part:
        part.write_bytes(b"whole")
    assert sorted(tmp_path.iterdir()) == sorted([tmp_path / "a.png", written, elsewhere])


def test_an_error_leaves_what_was_there(tmp_path: Path):
    path = tmp_path / "a.txt"
    path.write_text("before")

    def stopped() -> None:
        with atomic(path) as part:
            part.write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        stopped()
    assert [(p.name, p.read_text()) for p in tmp_path.iterdir()] == [("a.txt", "before")]


def test_an_exr_file_that_finds_no_room_is_one_error_and_leaves_nothing(tmp_path: Path):
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, hard))  # bytes of a file, fewer than the frame needs
    try:
        with pytest.raises(OSError, match="cannot be written, is the disk full"):
            write_exr(tmp_path / "a.exr", smooth.corner((64, 64)))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert [*tmp_path.iterdir()] == []
