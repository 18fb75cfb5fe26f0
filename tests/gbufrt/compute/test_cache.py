"""Compiled kernels are kept between processes, wherever there is a place for them, and their making is told."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from gbufrt.compute import cache

ROOT = Path(cache.__file__).parents[2]
KERNEL = """
import numba
from gbufrt.compute.cache import kept

{extra}
def squares(out):
    for i in range(len(out)):
        out[i] = i * i

squares = kept(numba.njit(squares))
"""
RUN = """
import sys, numpy as np
from gbufrt.compute.cache import watch
told = []
with watch(told.append):
    import squares
    for dtype in sys.argv[1:]:
        out = np.zeros(5, dtype)
        squares.squares(out)
        assert list(out) == [0, 1, 4, 9, 16], out
print([compilation.seconds is None for compilation in told])
"""
ONCE, NEVER = "[True, False]\n", "[]\n"


def run(folder: Path, *dtypes: str, then: str = "", **environment: str) -> subprocess.Popen[str]:
    """A process that runs the kernel of ``folder``, and prints whether it compiled it, then runs ``then``."""
    env = {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"} | {"PYTHONPATH": f"{ROOT}:{folder}"}
    command = [sys.executable, "-c", RUN + then, *dtypes]
    return subprocess.Popen(
        command, env=env | environment, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def told(process: subprocess.Popen[str]) -> tuple[str, str]:
    out, err = process.communicate()
    assert process.returncode == 0, err
    return out, err


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    place = tmp_path / "kernels"
    place.mkdir()
    (place / "squares.py").write_text(KERNEL.format(extra=""))
    return place


def test_a_second_process_compiles_nothing(folder: Path):
    assert told(run(folder, "float32")) == (ONCE, "")
    assert told(run(folder, "float32")) == (NEVER, "")
    (kept,) = (folder / "__pycache__").glob("*.nbc")
    (folder / "squares.py").write_text(KERNEL.format(extra="ANOTHER = 1"))
    assert told(run(folder, "float32")) == (ONCE, "")
    assert not kept.exists(), "what was compiled from a source that is no more is left behind"


def test_a_loaded_form_runs_without_its_intermediate_code(folder: Path):
    """Only what is compiled in this process, and may be kept on disk, has it."""
    then = "import squares; print([form.library._shared_module is None for form in squares.squares.overloads.values()])"
    for kept in (False, True):
        process = run(folder, "float32", then=then)
        assert told(process)[0].endswith(f"[{kept}]\n")


def test_processes_that_start_at_once_share_a_cold_cache(folder: Path):
    """Two of them ask for the same form, a third for another one, at the same time; a late one may find it kept."""
    same, late, other = [run(folder, kind) for kind in ("float32", "float32", "int64")]
    assert {told(same), told(late)} in ({(ONCE, "")}, {(ONCE, ""), (NEVER, "")})
    assert told(other) == (ONCE, "")
    assert told(run(folder, "float32", "int64")) == (NEVER, "")


def test_two_forms_made_at_once_are_told_apart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Both processes have looked for what is there before either of them writes."""
    monkeypatch.setattr(cache._Files, "_load_index", lambda self: {})
    one, other = (cache._Files(str(tmp_path), "squares", "stamp") for _ in range(2))
    one.save("float", 1)
    other.save("int", 2)
    monkeypatch.undo()
    assert (other.load("float"), one.load("int")) == (1, 2)


def test_a_damaged_file_is_made_again(folder: Path):
    kinds = ("float32", "float64", "int64")
    told(run(folder, *kinds))
    files = sorted((folder / "__pycache__").glob("*.nbc"))
    whole = files[1].read_bytes()
    for file, damage in zip(files, (b"", whole[: len(whole) // 2], b"nonsense"), strict=True):
        file.write_bytes(damage)
    assert told(run(folder, *kinds)) == (f"{[True, False] * 3}\n", "")
    assert told(run(folder, *kinds)) == (NEVER, "")


def test_where_nothing_is_writable_a_temporary_folder_keeps_kernels(folder: Path, tmp_path: Path):
    """A file in the way stands for folders without permission, which do not bind root."""
    temporary = tmp_path / "tmp"
    temporary.mkdir()
    (folder / "__pycache__").write_text("in the way")
    (tmp_path / "home").write_text("no folder")
    environment = {"HOME": str(tmp_path / "home"), "TMPDIR": str(temporary)}
    environment |= {"XDG_CACHE_HOME": str(tmp_path / "home"), "PYTHONDONTWRITEBYTECODE": "1"}
    out, err = told(run(folder, "float32", **environment))
    assert out == ONCE
    assert err.count("\n") == 1
    assert str(temporary / "gbufrt-kernels-") in err
    assert "a minute" in err
    assert "NUMBA_CACHE_DIR" in err
    assert told(run(folder, "float32", **environment))[0] == NEVER
    keep = {"NUMBA_CACHE_DIR": str(tmp_path / "keep")}
    assert told(run(folder, "float32", **environment, **keep)) == (ONCE, "")


@pytest.mark.skipif(os.name == "nt", reason="permissions")
def test_a_folder_of_others_is_not_trusted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Who can write there could have this process run what they like."""
    monkeypatch.setattr(cache.tempfile, "tempdir", str(tmp_path))
    monkeypatch.setenv("NUMBA_CACHE_DIR", "")
    place = tmp_path / f"gbufrt-kernels-{os.getuid()}"
    for make in (lambda: place.mkdir(), lambda: place.symlink_to(tmp_path)):
        make()
        if not place.is_symlink():
            place.chmod(0o777)
        found = cache._temporary.__wrapped__()
        assert found is not None
        assert Path(found) != place
        assert Path(found).stat().st_mode & 0o077 == 0
        place.unlink() if place.is_symlink() else shutil.rmtree(place)
    assert cache._temporary.__wrapped__() == str(place)


def test_a_full_disk_stops_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    files = cache._Files(str(tmp_path), "squares", "stamp")
    files.save("key", 1)
    assert files.load("key") == 1

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(cache._Files, "_save_data", full)
    files.save("other", 2)
    assert files.load("other") is None
