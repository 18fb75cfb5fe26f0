"""Which lamps matter to the pixels of a picture: the torch reference of `tracer.direct.choice_kernel`.

Vectors are planes, ``(3, N)``, over the pixels of the picture.
"""

from __future__ import annotations

import torch
from torch import Tensor

from tracer.lights.emitters import Lamps
from tracer.lights.form_factor import dot
from tracer.lights.shadows import Surface

CHUNK = 1 << 13  # pixels at a time: bounds memory, and keeps planes in the cache
SHARE_ALONE = 1 / 96  # lamps that may give a pixel at most this share of its light are drawn;
RAYS, RAISE = 12, 1.25  # where more rays than 12 for each sample were due, the share is raised, step by step
DRAWS, DRAWS_PER_SHARE = 8, 40  # one ray for each 40th of the light that these give, at most eight, or `most_drawn`,
FAINT = 192  # and at least one in 192 pixels for each 192nd of it, up to one in each
SHARE_FINE = 1 / 32  # a lamp that may give a pixel at most this share gets a sixteenth of the samples,
SHARE_FULL = 1 / 16  # and one that may give at most this a quarter


def most_drawn(samples: int) -> int:
    """How many lamps are drawn at most: eight, or half as many as there are ``samples``."""
    return min(max(DRAWS, samples // 2), DRAWS_PER_SHARE)


def choices(lamps: Lamps, surface: Surface, known: Tensor, dice: Tensor, samples: int) -> tuple[Tensor, Tensor, Tensor]:
    """Which lamps matter where.

    Args:
        lamps: L of them.
        surface: N pixels of a picture.
        known: ``(N,)`` irradiance from elsewhere.
        dice: ``(N,)`` in [0, 1).
        samples: most rays to a lamp, as in `tracer.direct.lighting.light`.

    Returns:
        ``(L, N)`` uint8, how much each lamp matters, see `tracer.lights.shadows.FIRST`; and the numbers ``(D, N)``
        of lamps drawn from those of level 0, in proportion to what they send, with the ratios ``(D, N)`` of what
        all of these send to what each sends, over how many are drawn in the mean; 0 beyond these. All are 0 where
        a pixel is not lit.
    """
    levels = torch.zeros(len(lamps), len(known), dtype=torch.uint8, device=known.device)
    chosen = torch.zeros(most_drawn(samples), len(known), dtype=torch.long, device=known.device)
    scale = known.new_zeros(chosen.shape)
    faces, seen = [faces_of(lamps, lamp) for lamp in range(len(lamps))], surface.share
    for part in seen.nonzero()[:, 0].split(CHUNK):
        points, normals = surface.points[:, part], surface.normals[:, part]
        power = torch.stack([importance(lamps, lamp, faces[lamp], points, normals) for lamp in range(len(lamps))])
        total = (known[part] + power.sum(dim=0)) / seen[part]
        rest, draws = _rest(power, total, samples)
        levels[:, part] = (power > rest) * (1 + sum((power > s * total).byte() for s in (SHARE_FINE, SHARE_FULL)))
        upto = rest.cumsum(dim=0)
        for draw in range(len(chosen)):
            die = (dice[part] + draw) / draws
            which = (die.clamp_max(1) * upto[-1] >= upto).sum(dim=0).clamp_max(len(lamps) - 1)
            mine = rest.gather(0, which[None])[0]
            chosen[draw, part] = which
            drawn = (mine > 0) & (die < 1)
            scale[draw, part] = torch.where(drawn, upto[-1] / mine.clamp_min(1e-30) / draws, 0.0)
    return levels, chosen, scale


def _rest(power: Tensor, total: Tensor, samples: int) -> tuple[Tensor, Tensor]:
    """What lamps ``(L, n)`` that are drawn send, 0 for the others; and how many ``(n,)`` are drawn in the mean."""
    alone = SHARE_ALONE * torch.ones_like(total)
    while True:
        rest = torch.where(power > alone * total, 0.0, power)
        share = rest.sum(dim=0) / total.clamp_min(1e-30)
        draws = (FAINT * share).clamp(1e-6, 1).maximum(DRAWS_PER_SHARE * share).clamp_max(most_drawn(samples))
        many = (power > rest).sum(dim=0) + draws > RAYS * samples
        if not bool(many.any()):
            return rest, draws
        alone = torch.where(many, alone * RAISE, alone)


def faces_of(lamps: Lamps, lamp: int) -> list[tuple[list[float], float]]:
    """For every rectangle its outward normal, as long as its area, and the product of that with its corner."""
    outward = torch.linalg.cross(lamps.edge_u[lamp], lamps.edge_v[lamp])
    offsets = (outward * lamps.corner[lamp]).sum(dim=1).tolist()
    return [(n, offset) for n, offset in zip(outward.tolist(), offsets, strict=True) if any(n)]


def importance(
    lamps: Lamps, lamp: int, faces: list[tuple[list[float], float]], points: Tensor, normals: Tensor
) -> Tensor:
    """``(n,)``: roughly the unoccluded irradiance from a lamp; zero only where it gives none.

    The whole lamp counts as if at its centre. Where the centre is below the surface's horizon, the highest point of the
    bounding sphere still counts.
    """
    way = lamps.center[lamp][:, None] - points
    square = dot(way, way)
    distance = square.sqrt().clamp_min(1e-6)
    shown = torch.zeros_like(distance)
    for outward, offset in faces:  # most have one axis only: plane by plane that is cheap
        height = torch.full_like(shown, -offset)
        for axis, n in enumerate(outward):
            if n:
                height.add_(points[axis], alpha=n)
        shown += height.clamp_min_(0)
    cosine = dot(way, normals) / distance
    sine = (lamps.radius[lamp] / distance).clamp_max(1.0)
    cosine = torch.maximum(cosine, (cosine + sine).clamp_min(0) / 4)
    inside = lamps.radius[lamp] ** 2 / 4  # nearer than that it grows no further
    return shown * cosine / (distance * square.clamp_min(inside)) * lamps.radiance[lamp].mean()
