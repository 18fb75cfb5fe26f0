"""The ME1 pipelines: their numbers, awkward frames, long paths, and what each stage is worth."""

from __future__ import annotations

import ast
import re
from pathlib import Path
from typing import Any

import boxes
import pytest
import torch

from gbufrt import Camera, Frame, Pipeline
from post import SSGI, DepthOfField, Temporal, me1
from post.presets import QUALITIES


def run(pipeline: Pipeline, frame: Frame, times: int = 1) -> Frame:
    with torch.no_grad():
        state, result = None, frame
        for step in range(times):
            result, state = pipeline(frame.replace(index=step), state)
    return result


def pair(size: tuple[int, int]) -> Camera:
    a, b = boxes.camera(size), boxes.camera(size, dx=0.4)
    return Camera(
        intrinsics=torch.cat([a.intrinsics, b.intrinsics]),
        world_from_view=torch.cat([a.world_from_view, b.world_from_view]),
        size=size,
        near=a.near,
        far=a.far,
    )


FRAMES = {
    "127x73": lambda: boxes.frame(boxes.camera((73, 127))),
    "batch of two": lambda: boxes.frame(pair((36, 48))),
    "orthographic": lambda: boxes.frame(boxes.camera((36, 48), orthographic=True)),
    "sky alone": lambda: boxes.frame(boxes.camera((36, 48)), boxes=boxes.ROOM + 500.0),
}


@pytest.mark.parametrize("case", FRAMES)
@pytest.mark.parametrize("preset", QUALITIES)
def test_every_preset_on_awkward_frames(preset, case):
    frame = FRAMES[case]()
    result = run(me1(preset), frame, times=2)
    for name in ("ao", "bent_normal", "gi", "reflection", "composite", "color", "image"):
        value = result.read(name)
        assert torch.isfinite(value).all(), name
        assert value.shape[0] == frame.gbuffer.batch
    image = result.read("image")
    assert image.min() >= 0
    assert image.max() <= 1
    if case == "sky alone":
        torch.testing.assert_close(result.read("composite"), frame.read("radiance"))


@pytest.mark.parametrize("mode", ["physical", "me1"])
def test_batch_equals_loop(mode):
    both = run(me1("low", composite=mode), boxes.frame(pair((36, 48))), times=3)
    for b, dx in enumerate((0.0, 0.4)):
        alone = run(me1("low", composite=mode), boxes.frame(boxes.camera((36, 48), dx=dx)), times=3)
        worst = (alone.read("image")[0] - both.read("image")[b]).abs().quantile(0.999)
        assert worst < 1e-3


def test_the_numbers_of_me1():
    rows = {name: me1(name, units_per_metre=2.0, composite="me1").all_tunables() for name in QUALITIES}
    assert [rows[p]["ao.estimate.directions"] for p in rows] == [1, 1, 2, 3]
    assert [rows[p]["ao.estimate.scales"] for p in rows] == [1, 2, 2, 3]
    assert [rows[p]["gi.estimate.bounces"] for p in rows] == [1, 2, 2, 3]
    assert [rows[p]["gi.estimate.distance"] for p in rows] == [60, 100, 140, 200]
    assert [rows[p]["reflection.estimate.steps"] for p in rows] == [48, 64, 96, 128]
    assert [rows[p]["reflection.estimate.distance"] for p in rows] == [80, 120, 150, 200]
    assert all(0.95 <= rows[p][f"{s}.accumulate.blend"] <= 0.97 for p in rows for s in ("ao", "gi", "reflection"))
    assert all(row["gi.estimate.bounce_loss"] == 0.6 for row in rows.values())
    assert all(row["depth_of_field.aperture_radius"] == 2 * DepthOfField().aperture_radius for row in rows.values())
    assert me1("high").all_tunables()["gi.estimate.bounce_loss"] == 1.0
    assert me1("high").all_tunables()["reflection.estimate.distance"] is None


def test_tunables_and_mistakes():
    assert me1("low", tunables={"gtao.radius": 3.0}).all_tunables()["ao.estimate.radius"] == 3.0
    with pytest.raises(ValueError, match=r"'hihg' \(did you mean high\?\)"):
        me1("hihg")
    with pytest.raises(ValueError, match="preset must be one of low, medium, high, ultra"):
        me1("extreme")
    with pytest.raises(ValueError, match="composite must be"):
        me1("low", composite="mixed")  # pyright: ignore[reportArgumentType]
    with pytest.raises(ValueError, match="units_per_metre must be positive"):
        me1("low", units_per_metre=0)


@pytest.mark.parametrize("path", ["ao", "gi", "reflection", "behind", "gi.accumulate", "taa", "fxaa", "exposure"])
def test_any_stage_can_be_left_out(path):
    frame = boxes.frame(boxes.camera((24, 32)))
    assert torch.isfinite(run(me1("low").without(path), frame).read("image")).all()


def test_stages_change_the_picture():
    frame = boxes.frame(boxes.camera((48, 64)))
    whole = run(me1("medium"), frame).read("composite")
    for path in ("gi", "reflection"):
        part = run(me1("medium").without(path), frame).read("composite")
        assert (part - whole).abs().mean() > 1e-3, path


def test_five_hundred_frames_do_not_drift():
    """Light fed back from the previous frame stays where it settles: the mean of many frames, early and late."""
    frame = boxes.frame(boxes.camera((18, 24)))
    hit = frame.gbuffer.hit.expand(-1, 3, -1, -1)
    light = Pipeline(estimate=SSGI(directions=2), accumulate=Temporal(signal=("gi", "sky_visibility"), blend=0.97))
    with torch.no_grad():
        frames = light.stream(frame.replace(index=step) for step in range(500))
        means = [out.read("gi")[hit].mean() for out in frames]
    early, late = torch.stack(means[40:90]), torch.stack(means[450:])
    assert float(late.mean()) == pytest.approx(float(early.mean()), rel=2e-3)
    assert float(late.std()) < 5e-3 * float(late.mean())


def test_a_long_path_leaves_no_trails():
    """32 frames of a sideways move: what the frame shows at the end is what a fresh start shows, noise aside."""
    size, pipeline, state = (54, 72), me1("low").without("motion_blur", "depth_of_field", "exposure"), None
    result = boxes.frame(boxes.camera(size))
    with torch.no_grad():
        for i in range(32):
            camera, previous = boxes.camera(size, dx=0.08 * i), boxes.camera(size, dx=0.08 * (i - 1))
            result, state = pipeline(boxes.frame(camera, previous=previous, index=i), state)
            assert torch.isfinite(result.read("image")).all(), i
    last = boxes.camera(size, dx=0.08 * 31)
    fresh = run(pipeline, boxes.frame(last), times=16)
    difference = (result.read("image") - fresh.read("image")).abs().amax(1)
    assert difference.mean() < 0.015
    assert difference.quantile(0.98) < 0.1


def test_gradient_reaches_the_light_and_the_depth():
    frame = boxes.frame(boxes.camera((16, 20)))
    radiance = frame.read("radiance").clone().requires_grad_()
    depth = frame.gbuffer.depth.clone().requires_grad_()
    frame = frame.replace(radiance=radiance, gbuffer=frame.gbuffer.replace(depth=depth))
    result, _ = me1("low").without("exposure")(frame)
    by_light, by_depth = torch.autograd.grad(result.read("image").square().mean(), (radiance, depth))
    assert torch.isfinite(by_light).all()
    assert torch.isfinite(by_depth).all()
    assert by_light.abs().max() > 0
    assert by_depth.abs().max() > 0


def test_tunables_that_the_readme_turns_are_not_set_so_already():
    text = (Path(__file__).parents[2] / "README.md").read_text()
    turned = ast.literal_eval(re.findall(r'me1\("high"\)[^\n]*\.with_tunables\((\{.*?\})\)', text)[0])
    given = me1("high").all_tunables()
    assert turned
    assert all(given[name] != value for name, value in turned.items())


@pytest.mark.parametrize(("composite", "counts"), [("physical", False), ("me1", True)])
def test_ao_darkens_in_the_composite_of_me1_alone(composite: Any, counts: bool):
    pipeline, frame = me1("low", composite=composite), boxes.frame(boxes.camera((36, 48)))
    picture, without = run(pipeline, frame).read("composite"), run(pipeline.without("ao"), frame).read("composite")
    assert (float((picture - without).abs().mean() / without.mean()) > 0.01) == counts
