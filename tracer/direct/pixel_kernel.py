"""The compiled form of `tracer.direct.reference.Direct.arriving`: one pixel and its list of sources.

A list holds the numbers of sources in rising order, each shifted left by `LEVEL` bits, which say how much the source
matters; see `tracer.lights.shadows.FIRST`.
"""

from __future__ import annotations

from gbufrt.compute.kernel import scalar
from tracer.direct.kernel import aim, send
from tracer.lights.shadows import ALL, LEAST, MOST, NEXT, QUARTER, REACH, UNBLOCKED, WEIGHT

LEVEL = 2  # bits


@scalar
def first_rays(space, sources, number, point, normal, turn, counts, each, blockers, sums):
    """The first of ``counts`` rays to one source."""
    begin = _begin(sources, number, counts[2])
    aim(sources, number, point, normal, each, sums)
    send(space, sources, number, point, normal, turn, begin, begin + counts[0], each, blockers, sums)


@scalar
def _begin(sources, number, samples):
    """The number of a source's first point in the R2 sequence."""
    return 0 if number == len(sources.lamps) else number * samples


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


@scalar
def _gathered(light, sums, color, scale):
    """``light`` and that of a source: unblocked irradiance times the mean transmission of its rays."""
    share = sums[UNBLOCKED] * scale / max(sums[WEIGHT], 1e-20)
    return (
        light[0] + sums[1] * share * color[0],
        light[1] + sums[2] * share * color[1],
        light[2] + sums[3] * share * color[2],
    )


@scalar
def light_of_pixel(space, sources, near, place, p, agree, rest, counts, each, blockers, found):
    """Irradiance of pixel ``p`` from the sources of its list and the rest, with more rays where transmission differs by
    more than ``agree``."""
    offsets, marked, sums, _ = near
    point, normal, turn = place
    first, second, samples = counts
    light = (0.0, 0.0, 0.0)
    for k in range(offsets[p], offsets[p + 1]):
        number, level = marked[k] >> LEVEL, marked[k] & ALL
        if samples > first and level >= QUARTER and _differs(near, p, k, REACH, agree):
            begin = _begin(sources, number, samples)
            given = space, sources, number, point, normal, turn
            aim(sources, number, point, normal, each, found)
            for row in range(1, MOST + 1):
                found[row] = sums[k, row]
            send(*given, begin + first, begin + second, each, blockers, found)
            if level >= ALL and (found[MOST] - found[LEAST] > agree or _differs(near, p, k, NEXT, agree)):
                send(*given, begin + second, begin + samples, each, blockers, found)
            light = _gathered(light, found, sources.colors[number], 1.0)
        else:
            light = _gathered(light, sums[k], sources.colors[number], 1.0)
    chosen, scale = rest
    for draw in range(len(chosen)):
        number = chosen[draw]
        if scale[draw] > 0:
            begin = len(sources.lamps) * samples + draw
            aim(sources, number, point, normal, each, found)
            send(space, sources, number, point, normal, turn, begin, begin + 1, each, blockers, found)
            light = _gathered(light, found, sources.colors[number], scale[draw])
    return light
