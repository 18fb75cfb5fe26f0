"""Which lamps matter to the pixels of a tile: the compiled form of `tracer.direct.choice_reference`.

Where a scene has many lamps, a tile first bounds what each may send to any of its pixels. Its pixels then look only at
the candidates: lamps that may be worth rays of their own. The others are drawn by what they send to one pixel of the
tile, so their light is noisier than in the reference, and as free of bias.
"""

from __future__ import annotations

import math

import numpy as np

from gbufrt.compute.kernel import contracted, inlined, scalar
from tracer.direct.choice_reference import DRAWS_PER_SHARE, FAINT, RAISE, SHARE_ALONE, SHARE_FINE, SHARE_FULL
from tracer.direct.kernel import CENTER, FACING, MEAN, OFFSET, RADIUS
from tracer.sampling.scatter_kernel import along, dot
from tracer.traversal.kernel import triple

TILE = 8  # pixels on a side
SIDES = 6  # of a cube: which a pixel faces; those of a tile that face one are apart from the others,
GROUPS = 2 * SIDES  # and so are those of which much more is known than of another in the tile
UNLIKE = 0.05  # of the bound counts too, for pixels that are unlike the one
FEW = 16  # so few lamps are candidates everywhere
MANY = 16  # of more candidates than that pixels share a list, up to
BLOCK = 4  # on a side, if they lie in a ball; more of them alone would take a lamp beside them for a faint one
CLOSE = 0.5  # of at most so much of the distance to any candidate,
FLAT = 1e-3  # their normals differ by no more than this,
EVEN = 2.0  # and what is known by no more than this factor
MOST_ALONE = math.ceil(1 / SHARE_ALONE) - 1
"""So many lamps at most give a pixel more than the share that earns rays of their own; one more by rounding."""


@inlined
def center_of(lamps, number):
    """The centre of a lamp."""
    return lamps[CENTER, number], lamps[CENTER + 1, number], lamps[CENTER + 2, number]


@scalar
def importance(sources, number, point, normal, reach):
    """See `tracer.direct.choice_reference`; with a ``reach``, zero only where no point within it gets light."""
    rectangles, lamps, first = sources.rectangles, sources.lamps, sources.first
    shown = 0.0
    for k in range(first[number], first[number + 1]):
        facing = triple(rectangles, k, FACING)
        area = math.sqrt(dot(facing, facing)) if reach > 0 else 0.0
        shown += max(dot(facing, point) - rectangles[k, OFFSET] + area * reach, 0.0)
    if shown <= 0:
        return 0.0
    way = along(center_of(lamps, number), point, -1.0)
    return shown * weight(way, normal, lamps[RADIUS, number] + reach, lamps[MEAN, number])


@inlined
def weight(way, normal, radius, mean):
    """What a lamp may send to a point for each unit that it sees of area times height, along the way to its centre."""
    square = way[0] * way[0] + way[1] * way[1] + way[2] * way[2]
    distance, limited = max(math.sqrt(square), 1e-6), max(square, radius * radius / 4)
    falloff = 1 / (distance * limited)
    inverse = falloff * limited  # of the distance: one division in place of three
    cosine = (way[0] * normal[0] + way[1] * normal[1] + way[2] * normal[2]) * inverse
    cosine = max(cosine, max(cosine + min(radius * inverse, 1.0), 0.0) / 4)
    return cosine * falloff * mean


@inlined
def _most_weight(way, reach, low, high, radius, mean):
    """The most that `weight` is within ``reach`` of a point, for normals between ``low`` and ``high``."""
    away = math.sqrt(way[0] * way[0] + way[1] * way[1] + way[2] * way[2])
    distance, above = max(away - reach, 1e-6), reach
    above += max(way[0] * low[0], way[0] * high[0])
    above += max(way[1] * low[1], way[1] * high[1])
    above += max(way[2] * low[2], way[2] * high[2])
    # behind the surface the highest cosine is that of the farthest point
    cosine = min(above / (distance if above > 0 else away + reach), 1.0)
    cosine = max(cosine, max(cosine + min(radius / distance, 1.0), 0.0) / 4)
    return cosine / (distance * max(distance * distance, radius * radius / 4)) * mean


@contracted
def weigh(sources, point, normal, center, reach, low, high, here, most):
    """For each lamp, into ``here``, its `importance` at a point, of many rectangles at most; and into ``most`` the most
    that it is within ``reach`` of a ``center``, for normals between ``low`` and ``high``.

    Rows of numbers let the compiler take several lamps in one instruction.
    """
    faces, lamps = sources.faces, sources.lamps
    for n in range(lamps.shape[1]):
        shown = most_shown = 0.0
        for k in range(SIDES):  # a constant, so that no loop is left in this one
            x, y, z, offset = faces[k, 0, n], faces[k, 1, n], faces[k, 2, n], faces[k, 3, n]
            moved, area = faces[k, 4, n], faces[k, 5, n]
            shown += max(x * point[0] + y * point[1] + z * point[2] - offset, 0.0)
            most_shown += max(x * center[0] + y * center[1] + z * center[2] - moved + area * reach, 0.0)
        x, y, z, radius, mean = lamps[0, n], lamps[1, n], lamps[2, n], lamps[RADIUS, n], lamps[MEAN, n]
        here[n] = shown * weight((x - point[0], y - point[1], z - point[2]), normal, radius, mean)
        way = x - center[0], y - center[1], z - center[2]
        most[n] = most_shown * _most_weight(way, reach, low, high, radius, mean)


@scalar
def extent(surface, width, tile, group, low, high):
    """The lit pixel nearest a tile's centre (-1 for none), how much is seen of the pixel of which most is, and the
    least and greatest ``known``; left in ``low`` and ``high``, six numbers each: the ranges of lit points and normals.

    Of a tile only pixels of one ``group`` count, see `tracer.direct.drivers.Direct.groups`.
    """
    points, normals, seen, known, groups = surface
    nearest, middle, clearest, least, greatest = np.inf, -1, 0.0, np.inf, 0.0
    low[:], high[:] = np.inf, -np.inf
    for y in range(tile[0], tile[1]):
        for x in range(tile[2], tile[3]):
            i = y * width + x
            if groups[i] == group:
                clearest, least, greatest = max(clearest, seen[i]), min(least, known[i]), max(greatest, known[i])
                away = (2 * y + 1 - tile[0] - tile[1]) ** 2 + (2 * x + 1 - tile[2] - tile[3]) ** 2
                if away < nearest:
                    nearest, middle = away, i
                for k in range(3):
                    low[k], high[k] = min(low[k], points[i, k]), max(high[k], points[i, k])
                    low[3 + k], high[3 + k] = min(low[3 + k], normals[i, k]), max(high[3 + k], normals[i, k])
    return middle, clearest, least, greatest


@scalar
def find_candidates(sources, few, point, normal, known, clearest, low, high, candidates, others, most):
    """Sort all lamps into candidates and others; up to ``few`` lamps are all candidates.

    ``point`` and ``normal`` are those of one pixel, the rest is as `extent` gives it; ``most`` is scratch. Left
    in ``others``: their numbers, and the sum of their weights up to each. Returned: the number of both, and what the
    others send to the pixel.
    """
    lamps = sources.lamps.shape[1]
    if lamps <= few:
        for number in range(lamps):
            candidates[number] = number
        return lamps, 0, 0.0
    center = ((low[0] + high[0]) / 2, (low[1] + high[1]) / 2, (low[2] + high[2]) / 2)
    corner = (high[0] - center[0], high[1] - center[1], high[2] - center[2])
    reach, lowest, highest = math.sqrt(dot(corner, corner)), (low[3], low[4], low[5]), (high[3], high[4], high[5])
    numbers, upto = others
    weigh(sources, point, normal, center, reach, lowest, highest, upto, most)
    total = known
    for number in range(lamps):
        total += upto[number]
    least = SHARE_ALONE * total / clearest
    found, count, rest, sent = 0, 0, 0.0, 0.0
    for number in range(lamps):
        here, most_here = upto[number], most[number]
        if most_here > least:
            candidates[found] = number
            found += 1
        elif most_here > 0:
            rest, sent = rest + here + UNLIKE * most_here, sent + here
            numbers[count], upto[count] = number, rest
            count += 1
    return found, count, sent


@inlined
def _draws(share, most):
    """How many lamps are drawn in the mean for a share of the light, at ``most``."""
    return min(max(DRAWS_PER_SHARE * share, min(max(FAINT * share, 1e-6), 1.0)), most)


@inlined
def _alone(power, total, sent, rays, drawn, marked):
    """Number of the lamps that get rays of their own, where at most so many ``rays`` are sent; their places come first
    in ``marked``."""
    count, whole, least, inverse = 0, sent, SHARE_ALONE * total, 1 / max(total, 1e-30)
    for k in range(len(power)):
        whole += power[k]
        if power[k] > least and count < len(marked):
            marked[count] = k
            count += 1
    while True:
        kept, rest = 0, whole
        for j in range(count):
            if power[marked[j]] > least:
                marked[kept] = marked[j]
                kept, rest = kept + 1, rest - power[marked[j]]
        count = kept
        if count + _draws(rest * inverse, drawn) <= rays:
            return count
        least *= RAISE


@scalar
def list_lamps(candidates, known, seen, sent, power, rays, drawn, marked):
    """List the candidates worth rays of their own; ``power``, their importance, becomes its running sum over the rest.

    A lamp for which ``marked`` has no room stays in the rest, and so do the faintest where more than so many ``rays``
    were due; of the rest at most so many are ``drawn``. Returned: the length of the list, and how many of the rest are
    drawn in the mean.
    """
    total = known + sent
    for k in range(len(candidates)):
        total += power[k]
    total /= seen
    count, rest, j = _alone(power, total, sent, rays, drawn, marked), 0.0, 0
    for k in range(len(candidates)):
        if j < count and marked[j] == k:
            level = 1 + (1 if power[k] > SHARE_FINE * total else 0) + (1 if power[k] > SHARE_FULL * total else 0)
            marked[j] = 4 * candidates[k] + level
            j += 1
        else:
            rest += power[k]
        power[k] = rest
    return count, _draws((rest + sent) / max(total, 1e-30), drawn)


@scalar
def _first_above(values, count, value):
    """Index of the first of ``count`` ascending values that is above a given one."""
    first = 0
    while count > 1:  # as many steps whatever the value is: no branch that processors would have to guess
        half = count // 2
        first += half if values[first + half - 1] <= value else 0
        count -= half
    return first + (1 if count > 0 and values[first] <= value else 0)


@scalar
def draw_rest(candidates, power, others, count, die, draws, chosen, scale):
    """Draw lamps of the rest: candidates by importance, others by weight; ``scale`` is the inverse of how often.

    ``power`` is as `list_lamps` leaves it. There are ``draws`` in the mean: each is a step further along the sum of the
    weights, from a first place by ``die``.
    """
    rest = power[len(candidates) - 1] if len(candidates) > 0 else 0.0
    total, draw = rest + (others[1][count - 1] if count > 0 else 0.0), 0
    while die + draw < draws and total > 0:
        place = min((die + draw) / draws, 1 - 1e-12) * total  # rounding must not lead past the end
        if place < rest:
            numbers, upto, k = candidates, power, _first_above(power, len(candidates), place)
        else:
            numbers, upto = others
            k = min(_first_above(upto, count, place - rest), count - 1)
        size = upto[k] - (upto[k - 1] if k > 0 else 0.0)
        chosen[draw], scale[draw] = numbers[k], total / (size * draws)
        draw += 1
