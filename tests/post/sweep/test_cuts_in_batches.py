"""A camera cut in one picture of a batch leaves the others of it as they are alone."""

from __future__ import annotations

from dataclasses import replace

import boxes
import pytest
import torch

from gbufrt import Pass
from post import GTAO, SSGI, SSR

STAGES = {"GTAO": GTAO(fresh=3), "SSGI": SSGI(fresh=3, directions=1, bounces=2), "SSR": SSR()}


@pytest.mark.parametrize("stage", STAGES.values(), ids=STAGES.keys())
def test_only_what_begins_takes_more_samples(stage: Pass) -> None:
    size, cut = (24, 32), torch.tensor([False, True, False])
    pair = boxes.frame(boxes.cameras(3, size))
    pair = pair.replace(gi=0.1 * pair.gbuffer.depth.expand(-1, 3, -1, -1))
    found = stage(replace(pair, previous=pair.as_previous(), cut=cut))
    for place in range(3):
        one = boxes.frame(boxes.camera(size, dx=0.7 * place))
        one = one.replace(gi=0.1 * one.gbuffer.depth.expand(-1, 3, -1, -1))
        alone = stage(replace(one, previous=one.as_previous(), cut=cut[place : place + 1]))
        for name in sorted(stage.writes):
            assert torch.allclose(found.read(name)[place], alone.read(name)[0], atol=1e-5), f"{name} of {place}"
