"""Every pass that `post` exports, a frame on which any of them runs, and how it runs."""

from __future__ import annotations

import inspect

import torch
from torch import Tensor

import post
from gbufrt import CHANNELS, Frame, Pipeline, Stage

PASSES = sorted(
    (v for v in vars(post).values() if inspect.isclass(v) and issubclass(v, Stage) and not inspect.isabstract(v)),
    key=lambda c: c.__name__,
)


def dress(frame: Frame) -> Frame:
    """Fill every signal, so that any pass can run on its own."""
    shape, generator = frame.gbuffer.depth.shape, torch.Generator().manual_seed(5)

    def noise(channels: int) -> Tensor:
        one = torch.rand(1, channels, *shape[2:], generator=generator, dtype=torch.float64)
        return one.to(frame.gbuffer.depth).expand(shape[0], -1, -1, -1).contiguous()

    assert frame.radiance is not None
    lit = frame.radiance + 0.1
    return frame.replace(
        ao=noise(1),
        sky_visibility=noise(1),
        bent_normal=frame.gbuffer.normal,
        gi=0.2 * noise(3),
        reflection=0.2 * noise(3),
        reflection_confidence=noise(1),
        reflection_distance=1 + noise(1),
        composite=lit,
        color=lit,
        image=lit.clamp(0, 1),
        diffuse=noise(3),
        specular=0.2 * noise(3),
        replayed=torch.ones_like(frame.gbuffer.depth),
        replayed_diffuse=noise(3),
        replayed_specular=0.2 * noise(3),
        fog_light=noise(3)[..., ::2, ::2],
        fog_transmittance=noise(1),
    )


def run(stage: Stage, frame: Frame, times: int = 2) -> Frame:
    """A few frames through one pass; temporal passes keep their state."""
    pipeline, state = Pipeline(given=stage.reads - set(CHANNELS), stage=stage), None
    result = frame
    for step in range(times):
        result, state = pipeline(frame.replace(index=frame.index + step), state)
    return result


def written(stage: Stage, frame: Frame) -> dict[str, Tensor]:
    return {name: frame.read(name) for name in sorted(stage.writes) if frame.get(name) is not None}
