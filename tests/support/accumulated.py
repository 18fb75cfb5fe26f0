"""Noise round a known truth, as temporal accumulation receives it, and how much is left."""

from __future__ import annotations

import boxes
import torch
from torch import Tensor

from gbufrt import Frame
from post.passes.denoising.temporal import Temporal

SIZE = (36, 48)


def truth_of(frame: Frame) -> Tensor:
    g = frame.gbuffer
    return torch.where(g.hit, 0.3 + 0.5 * g.normal[:, 1:2].abs(), 1.0)


def noisy(frame: Frame, generator: torch.Generator, kind: str = "gauss") -> Frame:
    truth, shape = truth_of(frame), frame.gbuffer.depth.shape
    if kind == "gauss":
        noise = 1 + 0.3 * torch.randn(shape, generator=generator)
    elif kind == "exponential":
        noise = torch.empty(shape).exponential_(generator=generator)
    else:  # one sample in twenty hits the lamp
        noise = 20.0 * (torch.rand(shape, generator=generator) < 0.05)
    return frame.replace(ao=torch.where(frame.gbuffer.hit, truth * noise, truth))


def still(stage: Temporal, frames: int, kind: str = "gauss", frame: Frame | None = None) -> tuple[Frame, list[Tensor]]:
    frame = frame or boxes.frame(boxes.camera(SIZE))
    generator, state, errors, out = torch.Generator().manual_seed(0), None, [], frame
    for _ in range(frames):
        out, state = stage(noisy(frame, generator, kind), state)
        errors.append((out.read("ao") - truth_of(frame))[frame.gbuffer.hit])
    return out, errors


def rms(error: Tensor) -> float:
    return float((error**2).mean().sqrt())
