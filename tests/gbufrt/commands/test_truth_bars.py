"""The table of `gbufrt ablate` in short: passes against ray-traced truth in a court that is nearly all on screen.

The bounds are the report's; where a small picture cannot reach them, they are bounds that a broken pass misses.
"""

from __future__ import annotations

from itertools import chain
from pathlib import Path
from typing import Any

import pytest
import torch
from court import court, posts

from gbufrt import Frame, Pipeline
from gbufrt.commands.ablation import denoising, lens, limits, subjects
from gbufrt.commands.ablation.cache import Cache
from gbufrt.commands.ablation.place import Place
from gbufrt.commands.ablation.sections import SECTIONS
from post import Denoise, DepthOfField, MotionBlur, gtao, me1

FRAMES = 4
HALO = 0.04  # RMSE of visibility
LATER = 8.5  # dB over the joint bilateral filter after a dozen frames, of which one wavelet over the last alone gives 7
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


def test_the_same_rays_read_a_frame_in_each_of_its_lights(folder: Path) -> None:
    frame = place(folder).still()
    dark = frame.replace(sky_visibility=0.5 * torch.ones_like(frame.gbuffer.depth))
    both = limits.exact_reflections(place(folder), frame, dark)
    for one, halves in zip((frame, dark), both, strict=True):
        for half, alone in zip(halves, limits.exact_reflections(place(folder), one)[0], strict=True):
            assert torch.equal(half, alone)
    assert not torch.equal(both[0][0], both[1][0])
    assert not torch.equal(*both[0]), "halves are independent"


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


def test_thin_poles_have_no_halo(folder: Path) -> None:
    """Posts in front of a wall, thin and close to it for the radius: the wall behind them is as dark as in truth."""
    spot, radius = place(folder, scene=posts()), 8.0
    g = spot.still().gbuffer
    truth = spot.truth_of("ambient_occlusion", g, {"radius": radius})["ao"]
    wall = g.hit & (g.camera.to_world(g.points_view())[:, 2:] < 1.01)

    def error(**options: Any) -> float:
        ao, _ = gtao(g.depth, g.normal, g.camera, hit=g.hit, radius=radius, directions=8, steps=16, **options)
        return float((truth - ao)[wall].square().mean().sqrt())

    assert error(thickness=g.thickness) < HALO
    assert error(thickness=g.thickness, hidden=0.0) < HALO / 2  # here nothing is hidden behind what is measured
    assert error(method="horizon") > 1.5 * HALO  # what the bound catches: solid posts, which darken the wall


def test_denoiser(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One sample a pixel on the way past the court: above the joint bilateral filter from the first frame on."""
    monkeypatch.setattr(denoising, "FRAMES", 12)
    spot = place(folder, "turning", fps=48.0)
    found = denoising.denoise(spot, me1("high")).figures
    assert found["denoise.least_over_kornia"] > 0
    assert found["denoise.last_over_kornia"] > LATER
    blind = Pipeline(given={"radiance"}, denoise=Denoise(signal="radiance", blend=0.0, iterations=1))
    monkeypatch.setattr(denoising, "denoiser", lambda: blind)
    assert denoising.denoise(spot, me1("high")).figures["denoise.last_over_kornia"] < LATER


class Across(MotionBlur):
    """Broken: blurs across the motion."""

    def forward(self, frame: Frame) -> Frame:
        g = frame.gbuffer
        return super().forward(frame.replace(gbuffer=g.replace(motion=frame.read("motion").flip(1))))


class Elsewhere(DepthOfField):
    """Broken: focuses at half the distance."""

    def forward(self, frame: Frame, state: Any = None) -> Any:
        return DepthOfField(**{**self.tunables(), "focus_distance": (self.focus_distance or 0.0) / 2})(frame, state)


def test_lens_passes(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lens, "MOVING_FPS", 1.0)  # the court turns slowly, and
    monkeypatch.setattr(lens, "APERTURES", {"small": 1.5, "large": 2.5})  # is far away, and pixels are few
    blurred = lens.motion_blur(place(folder, "turning", time=-1.0), me1("high")).figures
    assert blurred["motion_blur.centred.gain"] >= 4.0
    assert blurred["motion_blur.trailing.gain"] >= 3.0
    assert blurred["motion_blur.trailing.gain_onscreen"] > 6.0
    assert 0.05 < blurred["motion_blur.trailing.offscreen"] < blurred["motion_blur.trailing.offscreen_error"] < 0.5
    focused = lens.depth_of_field(place(folder), me1("high")).figures
    assert focused["depth_of_field.small.gain"] >= 10.0
    assert focused["depth_of_field.large.gain"] >= 10.0
    assert focused["depth_of_field.large.gain_onscreen"] > 12.0
    assert 0.2 < focused["depth_of_field.large.offscreen"] < focused["depth_of_field.large.offscreen_error"] < 0.7
    named = [s.figures for s in SECTIONS if s.picture.startswith(("motion_blur", "depth_of_field"))]
    assert set(chain(*named)) <= {*blurred, *focused}, "the page shows every figure that it has words for"
    broken = Pipeline(given={"color"}, motion_blur=Across(), depth_of_field=Elsewhere())
    assert lens.motion_blur(place(folder, "turning", time=-1.0), broken).figures["motion_blur.centred.gain"] < 4.0
    assert lens.depth_of_field(place(folder), broken).figures["depth_of_field.small.gain"] < 10.0
