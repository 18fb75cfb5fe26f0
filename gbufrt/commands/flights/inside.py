"""Whether a camera was put inside a block, which shows nothing but the backs of blocks."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tracer.scene.scene import Scene
    from tracer.worlds.regions.stream import Stream


def tell_inside(scene: Scene | Stream, eye: Sequence[float], option: str) -> None:
    """Warn where an eye, in world units and from an option, is in a block that light does not pass."""
    import torch

    there = scene.around(eye)
    cell = torch.tensor([math.floor(value) for value in eye], device=there.device)
    which = int(there.world.at(cell))
    if which and float(there.materials.opacity[which]) >= 1.0:
        name = there.materials.names[which]
        warnings.warn(f"{option} is inside a block of {name}: what is seen are the backs of blocks", stacklevel=2)
