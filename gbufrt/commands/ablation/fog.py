"""Fog of a still against brute force."""

from __future__ import annotations

import torch

from gbufrt.camera import Camera
from gbufrt.frame import Frame

SEEDS = (0, 1)


def fog_error(scene: object, camera: Camera, *, time: float = 0.0, frames: int = 16, steps: int = 1024) -> float:
    """Relative RMSE of the light that fog adds, after static frames, over all pixels and colours.

    It is ``sqrt(mean((x - truth)^2)) / mean(truth)`` of ``fog``. The square is the product of the differences from two
    independent truths, so that their own noise cancels in the mean.

    Args:
        scene: a `tracer.Scene` with fog.
        camera: one.
        time: seconds of the scene, which stands still.
        frames: static frames that are accumulated.
        steps: of `tracer.fog_truth`, in each of two truths.
    """
    import tracer
    from post.passes.light.fog import Fog
    from tracer.direct.fog import foggy

    assert isinstance(scene, tracer.Scene)
    gbuffer = tracer.gbuffer(scene, camera, previous_camera=camera, time=time, previous_time=time)
    poses, smooth, state = scene.poses([time]), Fog(), None
    frame = Frame(gbuffer=gbuffer)
    with torch.no_grad():
        for index in range(frames):
            frame, state = smooth(foggy(scene, Frame(gbuffer=gbuffer, index=index), poses=poses, index=index), state)
    first, second = (tracer.fog_truth(scene, gbuffer, poses=poses, steps=steps, seed=seed)["fog"] for seed in SEEDS)
    found, mean = frame.read("fog"), float(first.mean() + second.mean()) / 2
    return float(((found - first) * (found - second)).mean().clamp_min(0).sqrt()) / mean
