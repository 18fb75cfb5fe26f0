"""How the command line runs a pipeline over frames: warm-up, cuts, frames without results."""

from __future__ import annotations

import boxes
import torch
from command_line import fake_me1

from gbufrt.commands.session import Runner, bare
from gbufrt.noise.noise import blue_noise


def test_runner_starts_anew_where_frames_do_not_follow():
    runner = Runner(fake_me1(), warmup=3)
    first = boxes.frame(boxes.camera((16, 24)), index=5)
    follower = boxes.frame(boxes.camera((16, 24), dx=0.1), previous=boxes.camera((16, 24)), index=6)
    stranger = boxes.frame(boxes.camera((16, 24), dx=9.0), index=7)
    lengths = [float(runner(frame).read("ao_length").max()) for frame in (first, follower, stranger)]
    assert lengths == [4, 5, 4]
    cut = follower.replace(index=8, cut=torch.tensor([True]))
    assert float(runner(cut).read("ao_length").max()) == 4


def test_warm_up_takes_the_noise_of_the_frames_before():
    frame = boxes.frame(boxes.camera((16, 24)), index=1)
    mean = torch.stack([blue_noise(16, 24, index=index) for index in (-2, -1, 0, 1)]).mean(0)
    assert torch.allclose(Runner(fake_me1(), warmup=3)(frame).read("ao")[0], mean * 0.8, atol=1e-5)


def test_bare_frames_hold_no_results():
    frame = boxes.frame(boxes.camera((16, 24)))
    full = frame.replace(
        ao=frame.gbuffer.roughness, behind=frame.replace(ao=frame.gbuffer.roughness), extra={"x": frame.gbuffer.depth}
    )
    clean = bare(full)
    assert clean.behind is not None
    assert clean.present == clean.behind.present == frame.present
