"""Shots that flights are cut into: all frames once, shots that take equally long."""

from __future__ import annotations

import pytest

from gbufrt.commands.flights.shots import cut


@pytest.mark.parametrize(
    ("frames", "workers", "lead_in"), [(8, 2, 2), (240, 2, 40), (240, 64, 40), (5, 9, 0), (1, 4, 40)]
)
def test_shots_cover_a_flight_and_take_equally_long(frames: int, workers: int, lead_in: int):
    shots = cut(frames, range(frames), workers=workers, lead_in=lead_in)
    assert [index for shot in shots for index in shot.wanted] == list(range(frames))
    assert [shot.begin for shot in shots] == [max(shot.wanted[0] - lead_in, 0) for shot in shots]
    lengths = [len(shot.frames) for shot in shots]
    assert max(lengths) - min(lengths) <= 2, "nobody waits for the last one"
    assert all(len(shot.wanted) >= lead_in // 2 for shot in shots[1:])
    assert len(shots) <= workers
    some = cut(frames, [frames - 1], workers=workers, lead_in=lead_in)
    assert [(shot.begin, shot.wanted) for shot in some] == [(shots[-1].begin, (frames - 1,))]


def test_a_flight_of_many_frames_has_shots_that_may_be_lost():
    assert max(len(shot.wanted) for shot in cut(5000, range(5000), workers=2, lead_in=40)) < 300
    assert len(cut(5000, range(5000), workers=2, lead_in=1000)) == 2


@pytest.mark.parametrize(("frames", "workers"), [(512, 2), (513, 2), (1025, 4), (2049, 8), (5000, 2)])
def test_a_long_flight_takes_little_longer_than_one_shot_a_worker(frames: int, workers: int):
    shots = cut(frames, range(frames), workers=workers, lead_in=48)
    lanes = [0] * workers
    for shot in shots:
        lanes[lanes.index(min(lanes))] += len(shot.frames)
    assert max(lanes) < 1.2 * (frames + (workers - 1) * 48) / workers
