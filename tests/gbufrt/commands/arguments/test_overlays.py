"""`--ui`: a picture that does not fit is told before the work begins."""

from __future__ import annotations

from pathlib import Path

import boxes
import pytest
from command_line import SMALL, fake_me1, install, run
from PIL import Image

from gbufrt.commands.cli import main
from gbufrt.files.exr import write_exr
from post import Overlay


@pytest.fixture(autouse=True)
def stand_ins(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    install(monkeypatch, tmp_path)


def test_an_overlay_of_another_size_is_told_before_a_world_is_loaded(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
):
    def load(*_: object, **__: object) -> None:
        raise AssertionError("loaded")

    monkeypatch.setattr("tracer.worlds.load", load)
    monkeypatch.setattr(
        "post.presets.me1", lambda *a, **k: fake_me1(*a, **k).with_stage("ui", Overlay(), after="display")
    )
    Image.new("RGBA", (24, 16)).save("fits.png")
    Image.new("RGBA", (12, 8)).save("small.png")
    write_exr("a.exr", boxes.frame(boxes.camera((16, 24))))
    told = "gbufrt: small.png has 12x8 pixels, the frame 24x16: make them the same size\n"
    upscaled = ("--pipeline", "minecraft-rtx")
    for given in (("render", *SMALL), ("render", *SMALL, *upscaled), ("post", "a.exr")):
        assert run(*given, "--ui", "small.png", "--out", "out") == 2
        assert capfd.readouterr().err.endswith(told)
    assert not Path("out").exists()
    for given in (SMALL, (*SMALL, *upscaled)):
        with pytest.raises(AssertionError, match="loaded"):
            main(["render", *given, "--ui", "fits.png", "--out", "out"])
    assert run("post", "a.exr", "--ui", "fits.png", "--out", "out") == 0
