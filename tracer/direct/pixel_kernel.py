"""The compiled form of `tracer.direct.reference.Direct.arriving`: one pixel and its list of sources.

A list holds the numbers of sources in rising order, each shifted left by `LEVEL` bits, which say how much the source
matters; see `tracer.lights.shadows.FIRST`.
"""

from __future__ import annotations

import numpy as np

from gbufrt.compute.kernel import inlined, scalar
from tracer.direct.kernel import send, unblocked
from tracer.lights.shadows import ALL, LEAST, MOST, NEXT, QUARTER, REACH, UNBLOCKED, WEIGHT

LEVEL = 2  # bits


@inlined
def first_rays(shadows, space, sources, number, place, counts, each, k):
    """Queue the first of ``counts`` rays to the source of entry ``k``."""
    begin, sums = _begin(sources, number, counts[2]), shadows.sums[k]
    energy = unblocked(sources, number, place[0], place[1], each)
    sums[:] = np.float32(0)
    sums[UNBLOCKED], sums[LEAST] = energy, np.float32(1)
    send(shadows, space, sources, number, place, begin, begin + counts[0], each, energy, k, 0.0)


@scalar
def _begin(sources, number, samples):
    """The number of a source's first point in the R2 sequence."""
    return 0 if number == sources.lamps.shape[1] else number * samples


@scalar
def _differs(near, p, k, reach, agree):
    """Whether the first rays to source ``k`` of pixel ``p`` differ, among themselves or from those within reach.

    So they do where none was sent, see `tracer.lights.shadows.arriving`.
    """
    offsets, marked, sums, width = near
    if sums[k, WEIGHT] <= 0 and sums[k, UNBLOCKED] > 0:
        return True
    number, least, most = marked[k] >> LEVEL, sums[k, LEAST], sums[k, MOST]
    place, column = k - offsets[p], p % width
    for dy in range(-reach, reach + 1):
        for dx in range(-reach, reach + 1):
            q = p + dy * width + dx
            if 0 <= column + dx < width and 0 <= q < len(offsets) - 1:
                j, end = offsets[q] + place, offsets[q + 1]
                if j >= end or marked[j] >> LEVEL != number:  # most lists are alike
                    j = offsets[q]
                    while j < end and marked[j] >> LEVEL < number:
                        j += 1
                if j < end and marked[j] >> LEVEL == number:
                    least, most = min(least, sums[j, LEAST]), max(most, sums[j, MOST])
        if most - least > agree:
            return True
    return False


@inlined
def second_rays(shadows, space, sources, near, place, p, agree, rest, counts, each, opened):
    """Queue for pixel ``p`` the rays to what was drawn of the rest, and where transmission differs by more than
    ``agree`` the second part of ``counts``: there ``opened`` is set."""
    offsets, marked, sums, _ = near
    point, normal, _ = place
    first, second, samples = counts
    for k in range(offsets[p], offsets[p + 1]):
        number, level = marked[k] >> LEVEL, marked[k] & ALL
        opened[k] = samples > first and level >= QUARTER and _differs(near, p, k, REACH, agree)
        if opened[k]:
            begin, more = _begin(sources, number, samples), shadows.sums[k]
            for row in range(MOST + 1):
                more[row] = sums[k, row]
            energy = unblocked(sources, number, point, normal, each)
            send(shadows, space, sources, number, place, begin + first, begin + second, each, energy, k, 0.0)
    chosen, scale, i = rest
    for draw in range(len(chosen)):
        if scale[draw] > 0:
            number, begin = chosen[draw], sources.lamps.shape[1] * samples + draw
            energy = unblocked(sources, number, point, normal, each)
            send(shadows, space, sources, number, place, begin, begin + 1, each, energy, ~i, energy * scale[draw])


@inlined
def last_rays(shadows, space, sources, near, place, p, agree, counts, each, opened):
    """Queue the rest of the rays where the second part of them differ too."""
    offsets, marked, _, _ = near
    _, second, samples = counts
    for k in range(offsets[p], offsets[p + 1]):
        if opened[k] and marked[k] & ALL >= ALL:
            more = shadows.sums[k]
            if more[MOST] - more[LEAST] > agree or _differs(near, p, k, NEXT, agree):
                number = marked[k] >> LEVEL
                begin = _begin(sources, number, samples)
                energy = unblocked(sources, number, place[0], place[1], each)
                send(shadows, space, sources, number, place, begin + second, begin + samples, each, energy, k, 0.0)


@scalar
def gathered(sources, near, p, more, opened):
    """Irradiance of pixel ``p`` from the sources of its list: unblocked irradiance times mean transmission."""
    offsets, marked, first, _ = near
    red = green = blue = 0.0
    for k in range(offsets[p], offsets[p + 1]):
        sums, color = more[k] if opened[k] else first[k], sources.colors[marked[k] >> LEVEL]
        share = sums[UNBLOCKED] / max(sums[WEIGHT], 1e-20)
        red += sums[1] * share * color[0]
        green += sums[2] * share * color[1]
        blue += sums[3] * share * color[2]
    return red, green, blue
