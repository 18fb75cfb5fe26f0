"""Movers leave no trails: passes that accumulate, on traced frames of a block that slides along a wall."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pytest
import torch
from court import court
from torch import Tensor
from voxels import pose

from gbufrt import Frame, GBuffer, Pipeline
from gbufrt.passes import Stage
from post import TAA, Denoise, Temporal
from tracer.gbuffers import gbuffer
from tracer.scene.scene import Instance, Scene
from tracer.scene.world import World

BLOCK, WALL = 1.0, 0.1
STEP = 0.6  # world units a frame


def sliding() -> Scene:
    scene = court(mirror=False)
    block = World.from_dense(torch.ones(3, 4, 2, dtype=torch.int16), scene.world.materials)
    return replace(scene, instances=(Instance(model=block, pose=lambda t: pose((5.0 + STEP * t, 2.0, 13.0))),))


def on_block(g: GBuffer) -> Tensor:
    return g.hit if g.object_id is None else (g.object_id > 0) & g.hit


def frames(count: int) -> Iterator[Frame]:
    """The block is bright and all else is dark, by any name that a pass may want."""
    scene = sliding()
    camera = scene.views["still"].camera(0.0, size=(48, 64))
    for number in range(count):
        now, before = float(number), float(number - 1)
        g = gbuffer(scene, camera, previous_camera=camera, time=now, previous_time=before)
        light = torch.where(on_block(g), BLOCK, WALL).expand(-1, 3, -1, -1)
        white = torch.where(g.hit, 0.8, 0.0).expand(-1, 3, -1, -1)
        yield Frame(gbuffer=g.replace(albedo=white, emission=None), index=number, gi=light, color=light)


@pytest.mark.parametrize(
    ("stage", "signal"),
    [(Temporal(signal="gi"), "gi"), (Denoise(signal="gi"), "gi"), (TAA(), "color")],
    ids=["Temporal", "Denoise", "TAA"],
)
def test_nothing_stays_behind_a_moving_block(stage: Stage, signal: str) -> None:
    worst, uncovered = 0.0, 0
    pipeline, previous = Pipeline(given={signal}, stage=stage), None
    sources = list(frames(10))
    for source, found in zip(sources, pipeline.stream(sources), strict=True):
        block = on_block(source.gbuffer)
        if previous is not None:
            uncovered += int((previous & ~block).sum())
        previous = block
        around = torch.nn.functional.max_pool2d(block.float(), 5, 1, 2) > 0
        wall = source.gbuffer.hit & ~around  # no filter of the present frame reaches so far
        worst = max(worst, float((found.read(signal) - source.read(signal)).abs().amax(1, keepdim=True)[wall].max()))
    assert uncovered > 50
    assert worst < 0.01
