"""What docstrings say of a pass's tunables, how frames tell what they hold, and files that are not read."""

from __future__ import annotations

import re
from pathlib import Path

import boxes
import pytest
import torch

import tracer
from gbufrt import Frame, Pass
from gbufrt.commands.inspect import inspect


def shaded(light: float, *, gain: float = 1.0, kind: str = "plain") -> float:
    """Shade.

    Args:
        light: what comes in.
        gain: factor on
            it; 1 changes nothing. More is brighter.
        kind: see `other`.

    Returns:
        what goes out: not an argument.
    """
    return light * gain if kind else light


class Shade(Pass):
    """See `shaded`.

    Args:
        floor: the least of it (Smith et al. 2020).
        gain: see `shaded`, as the rest.
    """

    def __init__(self, *, gain: float = 1.0, floor: float = 0.0, kind: str = "plain") -> None:
        super().__init__()
        self.gain, self.floor, self.kind = gain, floor, kind

    def forward(self, frame: Frame) -> Frame:
        return frame


def test_meanings_come_from_the_docstrings_of_class_and_function():
    assert Shade().meanings() == {
        "gain": "factor on it; 1 changes nothing",
        "floor": "the least of it (Smith et al. 2020)",
        "kind": "",
    }


def test_a_frame_tells_what_it_holds_in_ten_lines():
    frame = boxes.frame(boxes.camera((54, 96)), previous=boxes.camera((54, 96), dx=0.5), index=7)
    frame = frame.replace(
        gbuffer=frame.gbuffer.replace(thickness=None),
        ambient=None,
        ao=frame.gbuffer.depth,
        extra={"glow": torch.zeros(1, 2, 54, 96)},
        behind=frame,
        cut=torch.tensor([True]),
    )
    text = repr(frame)
    assert len(text.splitlines()) <= 10
    for part in (
        "Frame 7 at 0 s: batch 1, 96x54, float32 on cpu, cut [True]",
        "  camera   Camera(96x54, 79.3 x 50.0 degrees, at (2, 4, 9), forward (-0.206, -0.309, -0.928), near 0.05, far",
        "  before   Camera(96x54, 79.3 x 50.0 degrees, at (2.5, 4, 9)",
        "depth, hit, normal (3), normal_geo (3), motion (2),",
        "  light    radiance (3), environment (3, 32x16)",
        "  signals  ao\n",
        "  extra    glow (2)",
        "  absent   thickness, ambient",
        "  behind   depth, hit",
    ):
        assert part in text, (part, text)
    assert "orthographic, 12 x 9 units" in repr(boxes.camera(orthographic=True))
    assert "first of 2" in repr(boxes.cameras(2, (8, 8)))
    assert repr(frame.gbuffer).count("\n") == 0


@pytest.mark.parametrize(
    ("files", "told"),
    [
        (("db/CURRENT", "level.dat"), "a world of Minecraft Bedrock; convert it to a Java save"),
        (("CURRENT",), "a world of Minecraft Bedrock; convert it to a Java save"),
        (("region/r.0.0.linear",), "a world in Linear's regions; convert them to .mca"),
        (("region/r.0.0.mcr",), "a world of Minecraft before 1.2; open the world in a newer one, which writes .mca"),
        (("region3d/0.0.0.3dr",), "a world of cubic chunks"),
    ],
)
def test_saves_that_are_not_read_are_told_with_a_remedy(files: tuple[str, ...], told: str, tmp_path: Path) -> None:
    for file in files:
        (tmp_path / file).parent.mkdir(exist_ok=True)
        (tmp_path / file).touch()
    with pytest.raises(ValueError, match=f"^{re.escape(f'{tmp_path} is {told}')}"):
        tracer.load(tmp_path)
    with pytest.raises(ValueError, match=f"^{re.escape(f'{tmp_path} is {told}')}"):
        inspect(tmp_path)


@pytest.mark.parametrize(
    ("name", "told"),
    [("a.gox", "export a .vox"), ("a.QB", "export a .vox"), ("a.mcworld", "Java"), ("a.obj", "a mesh")],
)
def test_files_of_other_kinds_are_told_with_a_remedy(name: str, told: str, tmp_path: Path) -> None:
    (tmp_path / name).touch()
    with pytest.raises(ValueError, match=rf"{re.escape(name)} is .*{told}"):
        tracer.load(tmp_path / name)
    with pytest.raises(ValueError, match=rf"{re.escape(name)} is .*{told}"):
        inspect(tmp_path / name)
