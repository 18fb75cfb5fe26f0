"""Trivial answers, measured beside the passes: a bound that one of them reaches is no bound."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt.frame import Frame
from gbufrt.gbuffer import GBuffer


def untouched(frame: Frame) -> Tensor:
    """Direct light, plus the sky's light without occlusion where there is any."""
    direct = frame.read("radiance")
    return direct if frame.ambient is None else direct + frame.ambient


def constant_per_object(truth: Tensor, gbuffer: GBuffer, mask: Tensor | None = None) -> Tensor:
    """The best answer from object and material ids alone: the truth's mean over each."""
    ids = torch.zeros_like(gbuffer.depth, dtype=torch.int64)
    for channel in (gbuffer.object_id, gbuffer.material_id):
        if channel is not None:
            ids = ids * (int(channel.max()) + 1) + channel
    counted = gbuffer.hit if mask is None else mask
    flat, weight = torch.unique(ids, return_inverse=True)[1].flatten(), counted.flatten().to(truth)
    count = torch.zeros(int(flat.max()) + 1, dtype=truth.dtype).index_add_(0, flat, weight).clamp_min(1)
    result = torch.empty_like(truth)
    for channel in range(truth.shape[1]):
        value = truth[:, channel].flatten()
        mean = torch.zeros_like(count).index_add_(0, flat, value * weight) / count
        result[:, channel] = mean[flat].view_as(result[:, channel])
    return result


def reflected_sky(frame: Frame) -> Tensor:
    """What each surface would reflect if there were only sky."""
    from gbufrt.environment import lookup_environment
    from gbufrt.specular import schlick
    from post.shading.ggx import specular_f0

    g = frame.gbuffer
    eye = g.camera.rotate_to_world(g.camera.to_eye(g.points_view()))
    cosine = (eye * g.normal).sum(1, keepdim=True).clamp_min(0.0)
    sky = lookup_environment(frame.read("environment"), 2 * cosine * g.normal - eye)
    return sky * schlick(cosine, specular_f0(frame.read("albedo"), frame.read("metallic")))
