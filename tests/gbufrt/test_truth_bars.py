"""The table of `gbufrt ablate` in short: passes against ray-traced truth in a court that a camera sees nearly all of.

The bounds are those of the report, or what a broken pass would miss where a small picture cannot reach them.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from court import court

from gbufrt import Pipeline
from gbufrt.commands.ablation import lens, subjects
from gbufrt.commands.ablation.cache import Cache
from gbufrt.commands.ablation.place import Place
from post import me1

FRAMES = 4
MIRRORS = 0.3  # the report's bound is 0.1; here pixels are coarse, and edges many


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("truth")


def place(folder: Path, view: str = "still", **options: Any) -> Place:
    scene = options.pop("scene", None) or court()
    return Place(scene=scene, world="court", view=view, size=(72, 108), samples=16, cache=Cache(folder), **options)


def signals(folder: Path, pipeline: Pipeline) -> dict[str, float]:
    return subjects.signals(place(folder), pipeline, subjects.SIGNALS, FRAMES).figures


@pytest.fixture(scope="module")
def found(folder: Path) -> dict[str, float]:
    return signals(folder, me1("high"))


def test_ambient_occlusion(found: dict[str, float]) -> None:
    assert found["ao.rmse"] <= 0.06 < found["ao.if_open"]
    assert found["ao.bent"] <= 0.5


def test_indirect_light(found: dict[str, float]) -> None:
    assert found["gi.error"] <= 0.25
    assert found["gi.to_constant"] <= 0.5
    assert found["sky.rmse"] < found["sky.if_constant"]
    assert found["gi.exact"] < found["gi.error"]  # most of its error is in finding what is there


def test_reflections(found: dict[str, float]) -> None:
    assert found["reflection.mirror"] <= MIRRORS < min(found["reflection.if_constant"], found["reflection.if_sky"])
    assert found["reflection.exact_lit"] <= found["reflection.exact"] <= MIRRORS


def test_broken_passes_miss_the_bounds(folder: Path) -> None:
    broken = {"ao.estimate.steps": 1, "gi.estimate.steps": 1, "reflection.estimate.distance": 1.0}
    worse = signals(folder, me1("high", tunables=broken))
    assert worse["ao.rmse"] > 0.06
    assert worse["gi.error"] > 0.25
    assert worse["reflection.mirror"] > MIRRORS


def test_every_pass_earns_its_place(folder: Path) -> None:
    # without the mirror, whose light on the walls no pass knows of
    spot, full = place(folder, scene=court(mirror=False)), me1("high")
    best = subjects.whole_frame(spot, full, FRAMES, None).figures["psnr"]
    assert best > subjects.whole_frame(spot, full.without("gi"), FRAMES, None).figures["psnr"] + 0.5
    assert best > subjects.whole_frame(spot, full.without("reflection"), FRAMES, None).figures["psnr"]


def test_lens_passes(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lens, "MOVING_FPS", 1.0)  # the court turns slowly, and
    monkeypatch.setattr(lens, "APERTURES", {"small": 1.5, "large": 2.5})  # is far away, and pixels are few
    blurred = lens.motion_blur(place(folder, "turning", time=-1.0), me1("high")).figures
    assert blurred["motion_blur.centred.gain"] >= 4.0
    assert blurred["motion_blur.trailing.gain"] >= 3.0
    focused = lens.depth_of_field(place(folder), me1("high")).figures
    assert focused["depth_of_field.small.gain"] >= 10.0
    assert focused["depth_of_field.large.gain"] >= 10.0
