"""Frames without a history are swept more."""

from __future__ import annotations

import boxes
import pytest
import torch

from gbufrt import Frame, Pass
from post.passes.light.gtao import GTAO
from post.passes.light.ssgi import SSGI


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
