"""One NaN or infinite pixel in any input of any pass stays where it is: the rest of the picture is as it was."""

from __future__ import annotations

from typing import Any

import boxes
import pytest
import torch
from stages import PASSES as ALL
from stages import dress, run, written
from torch import Tensor

import post
from gbufrt import CHANNELS, Frame, Pipeline, Stage, TemporalPass

SIZE = (72, 96)
AT = (40, 50)  # row and column, on the floor before the box
BAD = {"NaN": torch.nan, "inf": torch.inf, "-inf": -torch.inf}
PASSES = [c for c in ALL if c is not post.Pulse]  # whose input is one number a picture
REACH = {  # pixels from the bad one beyond which nothing may change, after two frames; None: see DRIFT
    "AerialPerspective": 0,
    "Atrous": 32,  # taps of the widest of its kernels
    "Bilateral": 5,
    "Composite": 0,
    "Denoise": 32,  # all taps of its four kernels, and those that tell noise from light
    "DepthOfField": 32,  # its largest radius
    "DisplayEncode": 0,
    "EstimateMissing": 3,
    "FXAA": 25,  # how far it looks along an edge
    "GTAO": 16,  # its radius there
    "Overlay": 0,
    "MotionBlur": 32,  # its largest path
    "TAA": 2,
    "Temporal": 4,
    "Vignette": 0,
    "ASVGF": None,
    "Exposure": None,
    "Fog": None,  # its wavelets at half resolution reach past the border
    "MarchGI": None,
    "SSGI": None,
    "SSR": None,
    "Upscale": None,  # larger than what it is given
    "ToneMap": 0,
}
SHARE = 0.01  # of the picture that may change by more than DRIFT where a pass looks all over it
DRIFT = 0.02  # of the largest value


def frame_of(stage: Stage) -> Frame:
    """A frame in motion with every channel except those that the pass estimates."""
    before = boxes.camera(SIZE, dx=0.05)
    frame = dress(boxes.frame(boxes.camera(SIZE), previous=before))
    if isinstance(stage, post.Atrous):
        frame = frame.write("gi_variance", frame.read("ao"))
    if isinstance(stage, post.EstimateMissing):
        bare = dict.fromkeys(("motion", "motion_z", "roughness", "metallic"))
        frame = frame.replace(gbuffer=frame.gbuffer.replace(**bare))
    return frame


def spoiled(frame: Frame, name: str, value: float) -> Frame:
    tensor = frame.read(name).clone()
    row, column = AT if tensor.shape[-2:] == SIZE else (3, 7)
    tensor[:, :, min(row, tensor.shape[-2] - 1), min(column, tensor.shape[-1] - 1)] = value
    if name in CHANNELS:
        return frame.replace(gbuffer=frame.gbuffer.replace(**{name: tensor}))
    return frame.write(name, tensor)


def inputs(stage: Stage, frame: Frame) -> list[str]:
    names = sorted(stage.reads | stage.optional)
    return [name for name in names if (t := frame.get(name)) is not None and t.is_floating_point()]


@pytest.fixture(params=PASSES, ids=lambda c: c.__name__)
def stage(request) -> Stage:
    return request.param()


@pytest.mark.parametrize("kind", BAD)
def test_a_bad_pixel_stays_where_it_is(stage, kind):
    good = frame_of(stage)
    clean = written(stage, run(stage, good))
    reach = REACH[type(stage).__name__]
    assert inputs(stage, good), "what a pass reads must be there"
    for name in inputs(stage, good):
        found = written(stage, run(stage, spoiled(good, name, BAD[kind])))
        assert found.keys() == clean.keys()
        for signal, value in found.items():
            what = f"{kind} in {name} makes {signal}"
            assert torch.isfinite(value).all(), f"{what} not finite"
            changed = beyond(value, clean[signal], 0 if name == "environment" else reach)
            if reach is None or name == "environment":
                assert changed <= SHARE, f"{what} change in {changed:.0%} of the picture"
            else:
                assert changed == 0, f"{what} change {reach} pixels away"


def beyond(found: Tensor, clean: Tensor, reach: int | None) -> float:
    """Share of the picture that has changed, farther from the bad pixel than ``reach``."""
    difference = (found - clean).abs().amax(dim=1)
    if reach is None or difference.shape[-2:] != SIZE:
        return float((difference > DRIFT * float(clean.abs().max())).float().mean())
    y, x = torch.arange(SIZE[0])[:, None] - AT[0], torch.arange(SIZE[1])[None] - AT[1]
    away = torch.maximum(y.abs(), x.abs()) > reach
    assert away.any()
    return float((difference[0][away] > 1e-5).float().mean())


@pytest.mark.parametrize("kind", BAD)
def test_histories_recover(stage, kind):
    """Where only the first of several frames is bad, the last one is finite, and its state too."""
    if not isinstance(stage, TemporalPass):
        pytest.skip("has no history")
    good = frame_of(stage)
    for name in inputs(stage, good):
        pipeline, state, result = Pipeline(given=stage.reads - set(CHANNELS), stage=stage), None, good
        for step in range(3):
            frame = spoiled(good, name, BAD[kind]) if step == 0 else good
            result, state = pipeline(frame.replace(index=step), state)
        for signal, value in written(stage, result).items():
            assert torch.isfinite(value).all(), f"{name}, {signal}"
        assert state is not None
        for signal, value in state.stages["stage"].signals.items():
            assert torch.isfinite(value).all(), f"{name}, state {signal}"


def test_good_frames_are_read_as_they_are(stage):
    given = []
    stage.register_forward_pre_hook(lambda _, arguments: given.append(arguments[0]))
    frame = frame_of(stage)
    stage(frame)
    assert given[0] is frame


@pytest.mark.parametrize("name", ["depth", "radiance", "environment"])
@pytest.mark.parametrize("kind", BAD)
def test_the_whole_pipeline_keeps_the_picture(name, kind):
    frame = boxes.frame(boxes.camera(SIZE))
    pipeline = post.me1("low")
    clean, _ = pipeline(frame)
    found, _ = pipeline(spoiled(frame, name, BAD[kind]))
    difference = (found.read("image") - clean.read("image")).abs().amax(1)
    assert torch.isfinite(found.read("image")).all()
    assert float((difference > 0.05).float().mean()) < 0.02
    assert float(found.read("image").mean()) == pytest.approx(float(clean.read("image").mean()), rel=0.02)


def test_every_pass_says_how_far_it_reaches():
    assert {c.__name__ for c in PASSES} == set(REACH)


def calls(frame: Frame) -> dict[str, Any]:
    """The functions that read the whole picture, or keep a history, by name."""
    g, color, env = frame.gbuffer, frame.read("radiance"), frame.read("environment")
    albedo, roughness, motion = (frame.read(name) for name in ("albedo", "roughness", "motion"))
    shape = (g.depth, g.normal, g.camera)
    return {
        "gtao": lambda: post.gtao(*shape, hit=g.hit)[0],
        "gtao horizon": lambda: post.gtao(*shape, hit=g.hit, method="horizon")[0],
        "gtao without hit": lambda: post.gtao(*shape)[0],
        "ssgi": lambda: post.ssgi(*shape, color, albedo, hit=g.hit)[0],
        "march_gi": lambda: post.march_gi(*shape, color, albedo, hit=g.hit)[0],
        "ssr": lambda: post.ssr(*shape, color, roughness, hit=g.hit, environment=env)[0],
        "exposure": lambda: post.exposure(color)[0],
        "motion_blur": lambda: post.motion_blur(color, g.depth, motion),
        "depth_of_field": lambda: post.depth_of_field(color, g.depth, g.camera, hit=g.hit, aperture_radius=0.5),
        "depth_of_field without hit": lambda: post.depth_of_field(color, g.depth, g.camera),
        "autofocus": lambda: post.autofocus(g.depth, g.camera)[:, None, None, None],
        "temporal": lambda: post.temporal(color, g, post.temporal(color, g)[1])[0],
        "taa": lambda: post.taa(color, g, post.taa(color, g)[1])[0],
    }


@pytest.mark.parametrize("kind", BAD)
def test_functions_hold_bad_pixels_too(kind):
    """Those that read the whole picture; the others reach as far as their taps, whatever the content."""
    frame = boxes.frame(boxes.camera(SIZE), previous=boxes.camera(SIZE, dx=0.05))
    good = calls(frame)
    for name in ("depth", "normal", "motion", "radiance", "environment"):
        bad = spoiled(frame, name, BAD[kind])
        for which, call in calls(bad).items():
            if which in ("temporal", "taa") and name in CHANNELS:
                continue  # a G-buffer is held where a frame enters its pass
            found, clean = call(), good[which]()
            assert torch.isfinite(found).all(), f"{kind} in {name} makes {which} not finite"
            assert beyond(found, clean, None) <= SHARE, f"{kind} in {name} spreads by {which}"


@pytest.mark.parametrize("kind", BAD)
def test_autofocus_looks_at_what_is_finite(kind):
    camera = boxes.camera((3, 3))
    depth = torch.full((1, 1, 3, 3), 5.0)
    depth[..., 1, 1] = BAD[kind]
    assert post.autofocus(depth, camera, region=1.0).tolist() == [5.0]
    alone = post.autofocus(depth, camera, hit=torch.ones_like(depth, dtype=torch.bool))
    assert alone.tolist() == [camera.far], "the middle is one pixel, which is none"
