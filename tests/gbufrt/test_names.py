"""What docstrings say of a pass's tunables, and how frames tell what they hold."""

from __future__ import annotations

import boxes
import torch

from gbufrt import Frame, Pass


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
