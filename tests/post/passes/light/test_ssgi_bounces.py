"""Light that SSGI gathers after several bounces: over frames, within one, and after a cut."""

from __future__ import annotations

from itertools import pairwise

import boxes
import torch

from gbufrt import Camera, Frame, Pipeline
from post.passes.light.ssgi import SSGI

SIZE = (24, 32)


def facing_walls() -> Frame:
    """A wall and a floor of albedo 0.8, filling the picture: many bounces."""
    camera = Camera.look_at((0, 1.0, 1.0), (0, 0.7, -3), size=SIZE, far=100.0)
    frame = boxes.frame(
        camera, boxes=torch.tensor([[[-9.0, -1.0, -9.0], [9.0, 0.0, 9.0]], [[-9.0, 0, -4.0], [9.0, 9.0, -3.0]]])
    )
    albedo = torch.full((1, 3, *SIZE), 0.8)
    return frame.replace(gbuffer=frame.gbuffer.replace(albedo=albedo), ambient=None, radiance=torch.ones(1, 3, *SIZE))


def test_bounces_add_up_over_frames_and_converge() -> None:
    frame = facing_walls()
    once = [f.read("gi").mean() for f in Pipeline(gi=SSGI(bounces=1, directions=1, steps=6)).stream([frame] * 2)]
    assert torch.equal(once[0], once[1])
    many = [f.read("gi").mean() for f in Pipeline(gi=SSGI(bounces=2, directions=1, steps=6)).stream([frame] * 6)]
    settled, lone = many[-1], many[0]
    assert float(settled - once[0]) > 0.1 * float(settled), "further bounces count"
    assert abs(float(lone - settled)) < 0.1 * float(settled - once[0]), "and are there from the first frame on"
    steps = [abs(float(b - a)) for a, b in pairwise(many)]
    assert steps[-1] < 1e-4 * float(settled), "where they stay"
    more = SSGI(bounces=4, directions=1, steps=6)(frame).read("gi").mean()
    assert abs(float(more - settled)) < 0.1 * abs(float(lone - settled)), "a longer series is closer"
    damped = SSGI(bounces=2, directions=1, steps=6, bounce_loss=0.6)(frame).read("gi").mean()
    assert once[0] < damped < lone


def test_a_cut_forgets_the_bounces_before() -> None:
    frame = facing_walls()
    stage = Pipeline(gi=SSGI(bounces=2, directions=1, steps=6))
    first, state = stage(frame)
    after, _ = stage(frame.replace(cut=torch.tensor([True])), state)
    assert torch.equal(after.read("gi"), first.read("gi"))
