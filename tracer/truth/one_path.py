"""A frame whose light comes by one path a pixel, as real-time path tracers make it."""

from __future__ import annotations

import torch

from gbufrt import Frame
from tracer.scene.checks import check_frame_of
from tracer.scene.scene import Scene
from tracer.truth.path_tracer import path_trace


def one_path(scene: Scene, frame: Frame, *, bounces: int = 4) -> Frame:
    """The frame with all its light by one path a pixel, in place of direct light and open sky.

    Args:
        scene: that the frame shows.
        frame: as `tracer.render` gives it, with ``light_samples=0`` too; its index seeds the paths, its camera's jitter
            places them.
        bounces: see `tracer.path_trace`.

    Returns:
        The frame with noisy ``radiance`` of everything, what lies behind glass and water included, and without
        ``ambient``; so ``behind`` gives no light of its own.

    Raises:
        ValueError: see `tracer.path_trace`.
    """
    check_frame_of(scene, frame)
    camera = frame.gbuffer.camera
    light = path_trace(
        scene, camera, time=float(frame.time), bounces=bounces, samples=1, antialias=False, seed=int(frame.index)
    ).values["radiance"]
    behind = frame.behind
    if behind is not None:
        behind = behind.replace(radiance=torch.zeros_like(light), ambient=None, emitters_sampled=True)
    return frame.replace(radiance=light, ambient=None, emitters_sampled=True, behind=behind)
