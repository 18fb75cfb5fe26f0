"""What a file rounds to half, and a frame as it is after that: passes that see the rounded frame can be run again."""

from __future__ import annotations

from typing import Literal, get_args

import torch
from torch import Tensor

from gbufrt.frame import SIGNALS, Frame
from gbufrt.gbuffer import CHANNELS

Precision = Literal["half", "float"]
PRECISIONS: tuple[str, ...] = get_args(Precision)
EXACT = frozenset(
    {"depth", "normal", "normal_geo", "motion", "motion_z", "thickness", "reflection_distance", "exposure"}
)
"""Geometry, of which half would lose what shows: positions, plane tests, motion of a fraction of a pixel."""
MOST_HALF = 65504.0


def is_half(name: str, tensor: Tensor, precision: Precision) -> bool:
    """Whether a file of ``precision`` rounds the channel or signal: colours and shares, nothing of unknown meaning."""
    known = name in CHANNELS or name in SIGNALS
    return precision == "half" and known and name not in EXACT and tensor.is_floating_point()


def to_half(tensor: Tensor) -> Tensor:
    """Rounded to float16; finite numbers stay finite."""
    bounded = torch.where(tensor.isfinite(), tensor.clamp(-MOST_HALF, MOST_HALF), tensor)
    return bounded.to(torch.float16)


def as_stored(frame: Frame, precision: Precision) -> Frame:
    """The frame as it comes back from a file of ``precision``, and the same of what lies behind; types stay."""

    def rounded(names: tuple[str, ...]) -> dict[str, Tensor]:
        present = {name: tensor for name in names if (tensor := frame.get(name)) is not None}
        return {n: to_half(t).to(t.dtype) for n, t in present.items() if is_half(n, t, precision)}

    behind = None if frame.behind is None else as_stored(frame.behind, precision)
    gbuffer = frame.gbuffer.replace(**rounded(tuple(CHANNELS)))
    return frame.replace(gbuffer=gbuffer, behind=behind, **rounded(tuple(SIGNALS)))
