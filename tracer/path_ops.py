"""Steps of light paths, and whole ones: compiled on the CPU, the torch reference elsewhere."""

from __future__ import annotations

import torch
from torch import Tensor

from tracer import light_paths, paths
from tracer.light_samples import Lights
from tracer.paths import FINE, MOST_PASS, Met, Vertices
from tracer.scene import MASK_SECONDARY, Scene


def meet(
    scene: Scene,
    origins: Tensor,
    directions: Tensor,
    u: Tensor,
    *,
    poses: Tensor,
    inside: Tensor | None = None,
    mask: int = MASK_SECONDARY,
    t_max: Tensor | float = torch.inf,
    most: float = MOST_PASS,
) -> Met:
    """See `tracer.paths.meet`."""
    given = {"poses": poses, "inside": inside, "mask": mask, "t_max": t_max, "most": most}
    if not origins.is_cpu:
        return paths.meet(scene, origins, directions, u, **given)
    from tracer import path_drivers as compiled

    return compiled.meet(scene, origins, directions, u, **given)


def gathered(scene: Scene, lights: Lights, start: Vertices, u: Tensor, bounces: int, poses: Tensor) -> Tensor:
    """See `tracer.light_paths.gathered`."""
    if not u.is_cpu:
        return light_paths.gathered(scene, lights, start, u, bounces, poses)
    from tracer import path_drivers as compiled

    return compiled.gathered(scene, lights, start, u, bounces, poses)


def mirrored_lamps(
    scene: Scene, lights: Lights, at: Vertices, u: Tensor, poses: Tensor
) -> tuple[Tensor, Tensor, Tensor]:
    """See `tracer.light_paths.mirrored_lamps`."""
    if not u.is_cpu:
        return light_paths.mirrored_lamps(scene, lights, at, u, poses)
    from tracer import path_drivers as compiled

    return compiled.mirrored_lamps(scene, lights, at, u, poses)


def radiance(
    scene: Scene,
    lights: Lights,
    origins: Tensor,
    directions: Tensor,
    u: Tensor,
    *,
    bounces: int,
    poses: Tensor,
    t_min: Tensor | float = 0.0,
    t_max: Tensor | float = torch.inf,
    detail: Tensor | float = FINE,
    spreads: bool = False,
    next_event: bool = True,
) -> Tensor:
    """See `tracer.light_paths.radiance`."""
    given = {"bounces": bounces, "poses": poses, "t_min": t_min, "t_max": t_max}
    given |= {"detail": detail, "spreads": spreads, "next_event": next_event}
    if not origins.is_cpu:
        return light_paths.radiance(scene, lights, origins, directions, u, **given)
    from tracer import path_drivers as compiled

    return compiled.radiance(scene, lights, origins, directions, u, **given)
