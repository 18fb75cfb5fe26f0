"""Frames without a history take more samples."""

from __future__ import annotations

from dataclasses import replace

import boxes
import pytest
import torch

from gbufrt import Frame, Pass
from post.passes.light.gtao import GTAO
from post.passes.light.ssgi import SSGI
from post.passes.light.ssr import SSR


@pytest.mark.parametrize(("stage", "read"), [(GTAO, "ao"), (SSGI, "sky_visibility")])
def test_a_frame_with_none_before_it_is_swept_with_more_directions(stage: type[Pass], read: str):
    frame = boxes.frame(boxes.camera((24, 32)))
    frame = frame.replace(radiance=torch.ones_like(frame.gbuffer.normal), ambient=None)
    later = frame.replace(previous=frame.as_previous())

    def swept(frame: Frame, **tunables: int) -> torch.Tensor:
        return stage(steps=4, **tunables)(frame).read(read)

    assert torch.equal(swept(frame, directions=1, fresh=3), swept(frame, directions=3))
    assert torch.equal(swept(later, directions=1, fresh=3), swept(later, directions=1))
    cut = later.replace(cut=torch.tensor([True]))
    assert torch.equal(swept(cut, directions=1, fresh=3), swept(cut, directions=3))
    assert not torch.equal(swept(frame, directions=1), swept(frame, directions=3))


@pytest.mark.parametrize(("samples", "half"), [(1, 1), (5, 3), (6, 3)])
def test_frames_with_one_before_them_send_half_as_many_reflected_rays(samples: int, half: int):
    frame = boxes.frame(boxes.camera((24, 32)))
    g = frame.gbuffer
    g = replace(g, roughness=torch.full_like(g.depth, 0.3), metallic=torch.ones_like(g.depth))
    frame = frame.replace(gbuffer=g)
    later = frame.replace(previous=frame.as_previous())

    def mirrored(frame: Frame, samples: int) -> torch.Tensor:
        return SSR(samples=samples)(frame).read("reflection")

    assert torch.equal(mirrored(later, samples), mirrored(frame, half))
    cut = later.replace(cut=torch.tensor([True]))
    assert torch.equal(mirrored(cut, samples), mirrored(frame, samples))
    assert samples == half or not torch.equal(mirrored(frame, samples), mirrored(frame, half))
