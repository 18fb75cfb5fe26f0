"""Where rays meet waves, and how waves focus the sun, in plain torch: the definition, and the reference of
`tracer.weather.kernel`."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt.specular import DIELECTRIC_F0, schlick
from tracer.weather.water import Water

STEPS = 256
CLOSE, CLOSE_RELATIVE = 1e-4, 2e-6  # world units over the wave where a ray has met it, and part of the distance
CELLS = 2.5  # of water along the finest cell of the noise
MOST_CELLS = 14  # of water from the middle to each side
SPREAD = 8.0  # usual slopes, times the distance, within which what lights a point lies: four, and mirrors double them
BRIGHTEST = 30.0  # times the flat water's light that one cell may send to a point


def meet(water: Water, origins: Tensor, directions: Tensor, t: Tensor, end: Tensor) -> Tensor:
    """Where rays that enter still water meet the wave.

    Steps are as long as no slope of the waves can make them pass it.

    Args:
        water: with waves.
        origins: ``(n, 3)`` world space.
        directions: ``(n, 3)`` unit length, downward.
        t: ``(n,)`` where they enter.
        end: ``(n,)`` where they come to something else.

    Returns:
        ``(n,)`` the distance, ``end`` if that comes first.

    Source: Hart 1996.
    """
    found = t.clone()
    mean = (origins[:, 1] + directions[:, 1] * t).round() - water.waves.amplitude
    left = torch.arange(len(t), device=t.device)
    for _ in range(STEPS):
        if len(left) == 0:
            break
        o, d, now = origins[left], directions[left], found[left]
        points = o + d * now[:, None]
        gap = points[:, 1] - mean[left] - water.height(points[:, [0, 2]])
        steep = water.steepest(water.away(points[:, [0, 2]]))
        closing = d[:, 0].abs() * steep[0] + d[:, 2].abs() * steep[1] - d[:, 1]
        now = torch.minimum(now + (gap / closing).clamp_min(0), end[left])
        found[left] = now
        left = left[(gap > CLOSE + CLOSE_RELATIVE * now) & (now < end[left])]
    return found


def focused(water: Water, points: Tensor, normals: Tensor, levels: Tensor, sun: Tensor) -> Tensor:
    """Sunlight that waves mirror to points, over the sun's own on a surface that faces it.

    Cells of water round the place where still water would mirror the sun each send their light to a parallelogram on
    the surface, which the Jacobian of that mapping spans; a tent over it shares the light with the cells beside. So
    light is neither lost nor won where waves focus it, and several places of the water may light one point.

    Args:
        water: with waves.
        points: ``(n, 3)`` world space, over the water.
        normals: ``(n, 3)``.
        levels: ``(n,)`` height of the water's mean level, ``-inf`` where there is none, and no light.
        sun: ``(3,)`` toward the sun, unit length, above the horizon.

    Returns:
        ``(n,)``, at least 0; water that mirrors everything and lies flat would give the cosine on the surface.

    Source: Igehy 1999 and Schjoth et al. 2007 for the footprints of photons.
    """
    down = sun * sun.new_tensor([1.0, -1.0, 1.0])
    far = (points[:, 1] - levels) / sun[1]
    middle = (points + down * far[:, None])[:, [0, 2]]
    away = water.away(middle)
    along = F.normalize(sun[[0, 2]], dim=0) if float(sun[[0, 2]].norm()) > 1e-6 else sun.new_tensor([1.0, 0.0])
    across = torch.stack([-along[1], along[0]])
    reach = SPREAD * water.usual(away) * far
    size = finest(water)
    cell_a, cell_b = (torch.maximum(r, sun.new_tensor(size)) / MOST_CELLS for r in (reach / sun[1], reach))
    total = torch.zeros_like(far)
    for i in range(-MOST_CELLS, MOST_CELLS + 1):
        for j in range(-MOST_CELLS, MOST_CELLS + 1):
            one, other = along * cell_a[:, None], across * cell_b[:, None]
            places = middle + one * i + other * j
            slopes, bends = water.curvatures(places, away)
            total = total + _sent(places, levels, slopes, bends, one, other, points, normals, sun) * cell_a * cell_b
    return torch.where(levels.isinf(), 0.0, total * sun[1])


def finest(water: Water) -> float:
    """The least distance over which cells of water are spread, world units."""
    return 1.0 / max(water.waves.frequency * 8, 1e-3)


def _sent(
    places: Tensor,
    levels: Tensor,
    slopes: Tensor,
    bends: Tensor,
    one: Tensor,
    other: Tensor,
    points: Tensor,
    normals: Tensor,
    sun: Tensor,
) -> Tensor:
    """``(n,)`` share of its light that a cell with the sides ``one`` and ``other`` ``(n, 2)`` sends, by area."""
    level = torch.stack([-slopes[:, 0], torch.ones_like(levels), -slopes[:, 1]], dim=-1)
    long = level.norm(dim=-1, keepdim=True)
    facet = level / long
    cosine = (facet * sun).sum(dim=-1, keepdim=True)
    ray = 2 * cosine * facet - sun
    at = torch.stack([places[:, 0], levels, places[:, 1]], dim=-1)
    falls = (normals * ray).sum(dim=-1, keepdim=True)
    distance = (normals * (points - at)).sum(dim=-1, keepdim=True) / falls
    sides = []
    for side in (one, other):
        turned = torch.stack([bends[:, 0] * side[:, 0] + bends[:, 1] * side[:, 1], torch.zeros_like(levels),
                              bends[:, 1] * side[:, 0] + bends[:, 2] * side[:, 1]], dim=-1).neg()  # fmt: skip
        tilt = (turned - facet * (facet * turned).sum(dim=-1, keepdim=True)) / long
        turn = 2 * ((tilt * sun).sum(dim=-1, keepdim=True) * facet + cosine * tilt)
        step = torch.stack([side[:, 0], torch.zeros_like(levels), side[:, 1]], dim=-1)
        nearer = (normals * (step + distance * turn)).sum(dim=-1, keepdim=True) / falls
        sides.append(step + distance * turn - nearer * ray)
    off = at + distance * ray - points
    area = (normals * torch.linalg.cross(*sides)).sum(dim=-1)
    safe = torch.where(area.abs() < 1e-12, 1e-12, area)
    a = (normals * torch.linalg.cross(off, sides[1])).sum(dim=-1) / safe
    b = (normals * torch.linalg.cross(sides[0], off)).sum(dim=-1) / safe
    tent = (1 - a.abs()).clamp_min(0) * (1 - b.abs()).clamp_min(0)
    meets = (falls[:, 0] < -1e-3) & (distance[:, 0] > 0) & (cosine[:, 0] > 0)
    size = torch.linalg.cross(
        torch.stack([one[:, 0], one[:, 1], torch.zeros_like(levels)], dim=-1),
        torch.stack([other[:, 0], other[:, 1], torch.zeros_like(levels)], dim=-1),
    )[:, 2].abs()
    least = size * sun[1] / BRIGHTEST
    return torch.where(meets, tent * schlick(cosine[:, 0], DIELECTRIC_F0) / torch.maximum(area.abs(), least), 0.0)
