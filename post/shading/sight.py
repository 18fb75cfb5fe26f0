"""How far one sees: fog of the colour of darkness that swallows all light beyond a distance."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt import Frame
from gbufrt.directions import length


def clarity(distance: Tensor, sight: float, begin: float) -> Tensor:
    """The share of light left after a way through the fog.

    Args:
        distance: of any shape, world units.
        sight: distance from which on nothing is left, world units.
        begin: share of ``sight`` up to which nothing is lost.

    Returns:
        Of the same shape, in [0, 1], linear in between.

    Raises:
        ValueError: ``sight`` is not positive, or ``begin`` is outside [0, 1).
    """
    if not sight > 0:
        raise ValueError(f"sight must be positive, in world units, or None, got {sight}")
    if not 0 <= begin < 1:
        raise ValueError(f"sight_begin must lie in [0, 1), got {begin}")
    return (1 - (distance / sight - begin) / (1 - begin)).clamp(0, 1)


def within_sight(frame: Frame, sight: float, begin: float) -> Frame:
    """The frame with what light is left of each part after its whole way to the eye.

    What is seen directly, and what stands behind a clear surface, comes from its own distance; what is mirrored has
    gone to the mirror first. The sky is infinitely far: none of it is left, in mirrors neither, where it is the part
    of the reflection that was not found on screen.

    Args:
        frame: with ``radiance``, and whatever other light it has.
        sight: see `clarity`, as ``begin``.

    Raises:
        ValueError: see `clarity`.
    """
    g = frame.gbuffer
    way = g.depth if g.camera.orthographic else length(g.camera.unproject(g.depth))
    clear = torch.where(g.hit, clarity(way, sight, begin), 0.0)
    parts = {name: part * clear for name in ("radiance", "ambient", "gi") if (part := frame.get(name)) is not None}
    if frame.reflection is not None:
        further = 0.0 if frame.reflection_distance is None else frame.reflection_distance
        found = 1.0 if frame.reflection_confidence is None else frame.reflection_confidence
        mirrored = torch.where(g.hit, clarity(way + further, sight, begin), 0.0)
        parts["reflection"] = frame.reflection * found * mirrored
    emission = None if g.emission is None else g.emission * clear
    behind = None if frame.behind is None else within_sight(frame.behind, sight, begin)
    return frame.replace(gbuffer=g.replace(emission=emission), behind=behind, **parts)
