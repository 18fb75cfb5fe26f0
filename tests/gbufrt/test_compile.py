"""`Pipeline.compile` makes every kernel that later frames need, says which, keeps them, and changes no frame."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import boxes
import pytest
import torch

import gbufrt
from gbufrt import Frame, History, Pipeline
from gbufrt.compute import cache
from gbufrt.specimen import specimen
from post import Bilateral, Exposure, me1

ROOT = Path(gbufrt.__file__).parents[1]
TWICE = """
from gbufrt import Pipeline
from post import ToneMap
pipeline = Pipeline(given={"color", "exposure"}, curve=ToneMap())
from gbufrt.specimen import specimen
import torch
frame = specimen()
frame = frame.replace(color=frame.radiance, exposure=torch.ones(1, 1, 1, 1))
print(*pipeline.compile(frame))
print(*pipeline.compile(frame))
"""
LATER = """
import torch, tracer
from gbufrt.compute import cache
from post import me1

scene = tracer.load("valley")
frames = []
for height, time in ((37, 0.0), (24, 0.5)):
    cameras = [scene.views["village"].camera(t, size=(height, 61)) for t in (time, time + 0.05)]
    frames.append(tracer.render(scene, cameras[1], previous_camera=cameras[0], light_samples=1))
pipelines = [me1(preset, composite=mode) for preset in ("low", "high") for mode in ("physical", "me1")]
for pipeline in pipelines:
    pipeline.compile()
forms = {driver: set(driver.overloads) for driver in cache._drivers}
with torch.no_grad():
    for pipeline in pipelines:
        for frame in frames:
            still = frame.replace(behind=None, environment=None)
            _, state = pipeline(frame)
            pipeline(still.replace(index=1), state)
print(*(cache._name(driver) for driver in cache._drivers if set(driver.overloads) - forms.get(driver, set())))
"""
AGAIN = """
import tracer
from gbufrt.compute import cache
from post import me1

with cache.watch(lambda compilation: print(compilation.kernel)):
    scene = tracer.load("valley")
    frame = tracer.render(scene, scene.views["village"].camera(0.0, size=(24, 61)), light_samples=1)
    me1("high")(frame)
"""


def process(code: str, **environment: str) -> tuple[str, str]:
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", code],
        env=os.environ | environment, cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout, done.stderr


def test_what_is_compiled_is_told_and_kept_for_later_processes(tmp_path: Path):
    out, err = process(TWICE, NUMBA_CACHE_DIR=str(tmp_path))
    assert out.splitlines() == ["post.display.drivers.agx_rows", ""], "once, also within a process"
    begun, ended = err.splitlines()
    assert begun == f"gbufrt: {cache.COMPILING}"
    assert ended.startswith("gbufrt: 1 compiled in ")
    assert "post.display.drivers.agx_rows" in ended
    assert process(TWICE, NUMBA_CACHE_DIR=str(tmp_path)) == ("\n\n", "")


def test_later_frames_of_any_size_and_later_processes_need_no_other_kernels():
    out, _ = process(LATER)
    assert out.split() == []
    assert process(AGAIN) == ("", "")


def test_a_compiled_pipeline_gives_the_same_frames():
    frame = boxes.frame()
    plain, compiled = me1("low"), me1("low")
    compiled.compile()
    with torch.no_grad():
        images = [[f.image for f in p.stream([frame, frame.replace(index=1)])] for p in (plain, compiled)]
    for one, other in zip(*images, strict=True):
        assert one is not None
        assert other is not None
        assert torch.equal(one, other)


def test_a_frame_stands_for_those_that_hold_more_than_the_tracer_gives():
    pipeline = Pipeline(given={"ao"}, denoise=Bilateral(signal="ao"))
    with pytest.raises(ValueError, match="frame must be one like those to come, because the pipeline reads ao"):
        pipeline.compile()
    frame = specimen()
    pipeline.compile(frame.replace(ao=frame.gbuffer.thickness))


def test_nothing_is_kept_of_the_frames_that_compile():
    seen: list[Frame] = []

    class Spy(Exposure):
        def forward(self, frame: Frame, state: History | None = None) -> tuple[Frame, History]:
            assert not torch.is_grad_enabled()
            seen.append(frame)
            return super().forward(frame, state)

    Pipeline(given={"color"}, exposure=Spy()).compile(specimen().replace(color=specimen().radiance))
    assert [frame.index for frame in seen] == [0, 1]
    assert seen[1].previous is not None
