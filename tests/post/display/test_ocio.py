"""OpenColorIO's views as tone curves: the published values, a config of one's own, and what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import boxes
import numpy as np
import pytest
import torch

from post import me1
from post.passes.display.tone_map import ToneMap, display_encode, tone_map

ocio = pytest.importorskip("PyOpenColorIO", reason="OpenColorIO is not installed: pip install gbufrt[color]")

OWN = """ocio_profile_version: 2
roles: {default: linear, scene_linear: linear}
displays:
  screen:
    - !<View> {name: plain, colorspace: shown}
    - !<View> {name: half/dark, colorspace: dark}
colorspaces:
  - !<ColorSpace> {name: linear, aliases: [lin_rec709_srgb]}
  - !<ColorSpace>
    name: shown
    from_scene_reference: !<MatrixTransform> {matrix: [0.5, 0, 0, 0, 0, 0.5, 0, 0, 0, 0, 0.25, 0, 0, 0, 0, 1]}
  - !<ColorSpace>
    name: dark
    from_scene_reference: !<MatrixTransform> {matrix: [0.1, 0, 0, 0, 0, 0.1, 0, 0, 0, 0, 0.1, 0, 0, 0, 0, 1]}
"""


def shown(rgb: tuple[float, float, float], **choices: Any) -> list[float]:
    """What a display gets."""
    return display_encode(tone_map(torch.tensor(rgb).view(1, 3, 1, 1), **choices)).flatten().tolist()


@pytest.mark.parametrize(
    ("operator", "builtin", "view"),
    [
        ("aces-1.3", "cg-config-v2.2.0_aces-v1.3_ocio-v2.4", "ACES 1.0 - SDR Video"),
        ("aces-2.0", "cg-config-v4.0.0_aces-v2.0_ocio-v2.5", "ACES 2.0 - SDR 100 nits (Rec.709)"),
    ],
)
def test_aces_is_what_opencolorio_gives(operator: str, builtin: str, view: str):
    transform = ocio.DisplayViewTransform(src="Linear Rec.709 (sRGB)", display="sRGB - Display", view=view)
    processor = ocio.Config.CreateFromBuiltinConfig(builtin).getProcessor(transform).getDefaultCPUProcessor()
    for colour in ((0.18, 0.18, 0.18), (0.0, 0.0, 0.0), (4.0, 0.5, 0.1), (0.02, 0.1, 0.6)):
        expected = np.clip(processor.applyRGB(list(colour)), 0, 1)
        assert shown(colour, operator=operator) == pytest.approx(expected, abs=2e-4)
        assert shown(colour, operator=operator, view=view) == shown(colour, operator=operator)
        assert shown(colour, operator=operator, view=f"sRGB - Display/{view}") == shown(colour, operator=operator)
    grey = shown((0.18, 0.18, 0.18), operator=operator)
    assert 0.3 < grey[0] < 0.45
    assert shown((0.18, 0.18, 0.18), operator=operator, view="Un-tone-mapped") == pytest.approx([0.461] * 3, abs=2e-3)


def test_a_config_of_ones_own(tmp_path: Path):
    (tmp_path / "own.ocio").write_text(OWN)
    path = str(tmp_path / "own.ocio")
    assert shown((0.8, 0.4, 0.4), operator=path) == pytest.approx([0.4, 0.2, 0.1], abs=1e-5)
    assert shown((0.8, 0.4, 0.4), operator=path, view="half/dark") == pytest.approx([0.08, 0.04, 0.04], abs=1e-5)
    color, auto = 2 * torch.rand(2, 3, 5, 7), torch.tensor([0.5, 0.25]).view(2, 1, 1, 1)
    both = tone_map(color, operator=path, exposure=auto)
    assert torch.allclose(both[1:], tone_map(color[1:] * 0.25, operator=path), atol=1e-6)  # a batch equals its pictures
    frame = boxes.frame(boxes.camera((5, 7))).replace(color=color[:1], exposure=auto[:1])
    assert torch.allclose(ToneMap(operator=path)(frame).read("image"), both[:1], atol=1e-6)


def test_operator_and_view_are_set_at_once_in_any_order():
    told = {"tone_map.view": "Un-tone-mapped", "tone_map.operator": "aces-2.0"}
    tuned = me1("low").with_tunables(told)
    assert {name: tuned.all_tunables()[name] for name in told} == told


def test_what_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "bad.ocio").write_text("ocio_profile_version: 2\nroles: [")
    (tmp_path / "bare.ocio").write_text(OWN.replace("aliases: [lin_rec709_srgb]", "aliases: [mine]"))
    light = torch.rand(1, 3, 2, 2)
    for choices, message in (
        ({"operator": "aces-3"}, "operator must be one of agx, .*aces-1.3, aces-2.0, or the path of a .ocio file"),
        ({"operator": "none.ocio"}, "there is no config none.ocio; check the path"),
        ({"operator": str(tmp_path / "bad.ocio")}, "bad.ocio cannot be used: "),
        ({"operator": str(tmp_path / "bare.ocio")}, "has no colour space called Linear Rec.709 .*; add an alias"),
        (
            {"operator": "aces-2.0", "view": "Film"},
            "'Film' is not in config aces-2.0; sRGB - Display has .*Un-tone-mapped",
        ),
        ({"operator": "aces-2.0", "view": "Rec.2100-PQ - Display/x"}, "Rec.2100-PQ - Display has .*those of sRGB"),
    ):
        with pytest.raises(ValueError, match=message):
            shown((0.1, 0.2, 0.3), **choices)
    with pytest.raises(ValueError, match="operator must be one of"):
        ToneMap(operator="aces-3")  # before anything is traced
    with pytest.raises(ValueError, match=r"'Film' is not in config aces-2.0"):
        ToneMap(operator="aces-2.0", view="Film")
    with pytest.raises(ValueError, match=r"view 'Film': agx has none; set operator to aces-1.3, aces-2.0 or a .ocio"):
        ToneMap(view="Film")
    with pytest.raises(ValueError, match="has no gradient; use agx"):
        tone_map(light.requires_grad_(), operator="aces-2.0")
    monkeypatch.setattr("post.display.ocio.find_spec", lambda name: None)
    with pytest.raises(ValueError, match=r"needs OpenColorIO: pip install 'gbufrt\[color\]'"):
        ToneMap(operator="aces-1.3")
