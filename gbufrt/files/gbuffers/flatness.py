"""By how much planes bend where depth is read in a wrong way, and what tells depth that is normalised."""

from __future__ import annotations

from collections.abc import Iterable

import torch
from torch import Tensor

from gbufrt.directions import length
from gbufrt.gbuffer import GBuffer
from gbufrt.validation.geometry import FEW, flat

BEND = 2e-6  # relative second difference of 1 / z on a plane, below which a bend is rounding
STEPS = 32  # of second differences across the picture: those of neighbours are too small in large pictures
FLATTEST = 0.25  # share of the pixels that are taken to lie on planes
MOST = 1.001  # of a share: filters of pixels and halves overshoot by less
NEARER = 0.5  # of the bend of planes: another kind of depth that comes so close is the right one
ENDED = 0.01  # share of the surfaces at the end of normalised depth, from which on that is told
SHARES = [(n / 50) ** 2 for n in range(45)]  # of the far distance: near ones that are tried


def bend_of(depth: Tensor, inside: Tensor, *, orthographic: bool) -> float:
    """Relative second difference of 1 / z where the picture is flattest; of z in orthographic ones.

    Args:
        depth: ``(B, 1, H, W)`` taken to be planar, world units.
        inside: ``(B, 1, H, W)`` bool: pixels that count, where those a step beside them do too.
        orthographic: whether the camera is.

    Returns:
        The bend, 0 where nothing is left to tell it by.
    """
    value, step = depth.double() if orthographic else 1 / depth.double(), max(min(depth.shape[-2:]) // STEPS, 1)
    for dim in (2, 3):
        inside = inside & inside.roll(step, dim) & inside.roll(-step, dim)
    bends = [(value.roll(step, dim) - 2 * value + value.roll(-step, dim)).abs() / value for dim in (2, 3)]
    middle = (..., slice(step, -step), slice(step, -step))
    found = torch.maximum(*bends)[middle][inside[middle]]
    return float(found.sort().values[int(FLATTEST * found.numel())]) if found.numel() else 0.0


def normalised_line(g: GBuffer, kind: str, others: Iterable[Tensor] = ()) -> str:
    """What to say of depth within 0 and 1 by whose own kind planes bend, and do not as a share; else nothing.

    The scale cannot be told: planes are flat in any unit.

    Args:
        g: with depth as it was read.
        kind: by which it was read.
        others: depth by other kinds.
    """
    if kind in ("device", "normalised") or g.camera.orthographic or not bool(g.hit.any()):
        return ""
    stored = 1 / g.depth if kind == "reciprocal" else g.depth
    if kind == "ray":
        stored = stored * length(g.camera.unproject(torch.ones_like(stored)))
    ends = (float(stored[g.hit].min()), float(stored[g.hit].max()))
    inside = flat(g) & (stored < 1)
    if ends[1] > MOST or int(inside.sum()) < FEW:
        return ""
    now = _curvature(g.depth, inside)
    known = min([now, *(_curvature(depth, inside) for depth in others)])
    readings = {(near, back): _read(stored, near, back) for near in SHARES for back in (False, True)}
    bends = {reading: _curvature(depth, inside) for reading, depth in readings.items()}
    near, back = min(bends, key=lambda reading: bends[reading])
    if bend_of(g.depth, inside, orthographic=False) <= BEND or bends[near, back] >= NEARER * known:
        ended = float((stored[g.hit] == 1).float().mean())
        return (
            f"depth is exactly 1 at {ended:.0%} of the surfaces, as normalised depth is where it ends; set sky = 1 in "
            "a profile if they are the sky, and depth_scale to the distance of its white"
            if ended > ENDED
            else ""
        )
    more = ", reversed = true" if back else ""
    return (
        f'depth lies within {ends[0]:.2g} and {ends[1]:.2g}; depth_kind = "normalised"{more} fits better: with near '
        f"= {near:.2g} of far planes bend {now / max(bends[near, back], BEND):.2g} times less; set near and far to the "
        "distances of its black and white, or write depth in world units"
    )


def _curvature(depth: Tensor, inside: Tensor) -> float:
    """The bend of planes as a share of how 1 / z varies: depth that is all but the same bends less by any reading."""
    value = 1 / depth.double()[inside]
    return bend_of(depth, inside, orthographic=False) / max(float(value.std() / value.mean()), BEND)


def _read(stored: Tensor, near: float, back: bool) -> Tensor:
    """Planar depth in units of the far distance."""
    share = 1 - stored if back else stored
    return (near + share * (1 - near)).clamp_min(torch.finfo(stored.dtype).tiny)
