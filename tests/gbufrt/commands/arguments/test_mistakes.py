"""Command lines with mistakes: one line with the remedy, and exit code 2."""

from __future__ import annotations

from pathlib import Path

import pytest
from command_line import run

LISTED = "--pipeline is one of me1, minecraft-rtx, --preset one of low, medium, high, ultra"


@pytest.mark.parametrize(
    ("command", "message"),
    [
        (
            "render --size -4x5",
            "--size needs a value; one that begins with a minus is joined to it, as in --size=-4x5",
        ),
        ("render --size=-4x5", "--size must be WIDTHxHEIGHT, both at least 1, such as 960x540; got '-4x5'"),
        (
            "render --eye -1,2,3 --target 0,0,0",
            "--eye needs a value; one that begins with a minus is joined to it, as in --eye=-1,2,3",
        ),
        ("ablate --out", "--out needs a value; `gbufrt ablate --help` tells which"),
        ("render --size --frames 2", "--size needs a value; `gbufrt render --help` tells which"),
        ("video folder", "`gbufrt video` needs --out; `gbufrt video --help` tells what it is"),
        ("render lake", "lake is a view, not a world; leave the world out and give --view lake"),
        ("passes foo", f"no pipeline 'foo'; {LISTED}"),
        ("passes minecraft", f"no pipeline 'minecraft' (did you mean minecraft-rtx?); {LISTED}"),
        ("passes low", "`gbufrt passes` takes low as an option: gbufrt passes --preset low"),
        ("bench foo", "`gbufrt bench` has no place for 'foo'; options begin with --, see `gbufrt bench --help`"),
        ("render --ui folder", "--ui folder is no file; give a picture with alpha, such as overlay.png"),
        ("render --ui none.png", "--ui none.png does not exist; check the path"),
    ],
)
def test_a_mistake_is_told_with_the_remedy(
    command: str, message: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    monkeypatch.chdir(tmp_path)
    Path("folder").mkdir()
    assert run(*command.split()) == 2
    assert capsys.readouterr().err == f"gbufrt: {message}\n"
