"""`tracer.dispatch` with a plain hit program, beside `tracer.trace` of the same rays."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

import torch
from torch import Tensor

from gbufrt.commands.ablation.place import Place
from gbufrt.commands.ablation.subjects import Outcome

if TYPE_CHECKING:
    from tracer.traversal.hits import Place as Met
    from tracer.traversal.programs import Launch

SIZE = (270, 480)
TURNS = 5


@dataclass
class Distance:
    """The payload: ``(..., 1)`` of the hit, -1 where there is none."""

    value: Tensor


def judge(place: Place) -> Outcome:
    """Processor time over `trace`'s, each the least of `TURNS` in turn; the largest difference of what they find."""
    from tracer import HitGroup, RayType, dispatch, trace

    scene, camera = place.scene, place.scene.views[place.view].camera(0.0, size=SIZE)
    poses, (origins, directions) = scene.poses([0.0])[0], camera.rays()

    def met(launch: Launch, hits: Met, payload: Distance) -> Distance:
        return Distance(hits.found.t[:, None])

    rays = {"plain": RayType(groups={"*": HitGroup(closest_hit=met)}, mask=1)}
    start = Distance(torch.full((*origins.shape[:-1], 1), -1.0))
    runs = {
        "dispatch": lambda: dispatch(
            scene, lambda launch: launch.trace("plain", origins, directions, start), rays, poses=poses
        ),
        "trace": lambda: trace(scene, origins, directions, poses=poses),
    }
    found = {name: run() for name, run in runs.items()}  # compiled, and compared
    least = dict.fromkeys(runs, float("inf"))
    for _ in range(TURNS):
        for name, run in runs.items():
            begun = time.process_time()
            run()
            least[name] = min(least[name], time.process_time() - begun)
    hits = found["trace"]
    off = (found["dispatch"].value[..., 0] - torch.where(hits.hit, hits.t, -1.0)).abs().max()
    ms = {f"dispatch.{name}_ms": seconds * 1e3 for name, seconds in least.items()}
    return Outcome(figures={**ms, "dispatch.times": least["dispatch"] / least["trace"], "dispatch.off": float(off)})
