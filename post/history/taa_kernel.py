"""The compiled form of temporal anti-aliasing: pixels ``first`` to ``end`` of a row as a body.

Names and steps are those of the torch reference in `post.history.taa_reference`, the definition. Only reading the
history gathers; every other loop becomes vector instructions. The 3x3 windows are sums of three rows, then of three
columns. Colours are tone-mapped.
"""

from __future__ import annotations

import math

import numpy as np

from gbufrt.compute.kernel import inlined, scalar
from post.history import constants
from post.history.color_kernel import luminance, ycocg

ZERO, HALF, ONE = np.float32(0), np.float32(0.5), np.float32(1)
THREE_HALVES, TWO, FIVE_HALVES, NINTH = np.float32(1.5), np.float32(2), np.float32(2.5), np.float32(1 / 9)
IN_FRONT, BODY, GRAZING = np.float32(constants.IN_FRONT), np.float32(constants.BODY), np.float32(constants.GRAZING)
QUARTER_SHARP = np.float32(constants.SHARP / 4)
TINY, LEAST, BRIGHTEST = np.float32(1e-12), np.float32(1e-6), np.float32(constants.BRIGHTEST)
NONE, NOWHERE = np.float32(-np.inf), np.float32(np.inf)


@scalar
def tone_row(toned, color, y, first, end):
    """Colours over 1 + their luminance."""
    red, green, blue = color[0, y, first:end], color[1, y, first:end], color[2, y, first:end]
    new_red, new_green, new_blue = toned[0, y, first:end], toned[1, y, first:end], toned[2, y, first:end]
    for x in range(red.shape[0]):
        level = ONE + max(luminance(red[x], green[x], blue[x]), ZERO)
        new_red[x], new_green[x], new_blue[x] = red[x] / level, green[x] / level, blue[x] / level


@scalar
def resample_row(out, column, toned, weights, y, first, end):
    """Colours at pixel centres; ``weights`` are those of three columns and of three rows of the window."""
    (_, height, width), count = toned.shape, end - first
    begin, stop = max(first - 1, 0), min(end + 1, width)  # of what the windows read
    rows, (left, middle, right) = weights[1], weights[0]
    total = ZERO
    for dy in range(-1, 2):
        total += rows[dy + 1] if 0 <= y + dy < height else ZERO
    column[0], column[count + 1] = ZERO, ZERO
    for c in range(3):
        read, new = column[begin - first + 1 : stop - first + 1], out[c]
        read[:] = ZERO
        for dy in range(-1, 2):
            if 0 <= y + dy < height:
                row, weight = toned[c, y + dy, begin:stop], rows[dy + 1]
                for x in range(row.shape[0]):
                    read[x] += weight * row[x]
        befores, sums, afters = column[:count], column[1 : count + 1], column[2 : count + 2]
        for x in range(count):
            known = middle + (left if first + x > 0 else ZERO) + (right if first + x + 1 < width else ZERO)
            new[x] = (left * befores[x] + middle * sums[x] + right * afters[x]) / (total * known)


@scalar
def box_row(mean, extent, sums, toned, current, y, first, end, gamma):
    """Centre and half size, in YCoCg, of the box to which the history is clipped."""
    (_, height, width), count = toned.shape, end - first
    begin, stop = max(first - 1, 0), min(end + 1, width)  # of what the windows read
    low, high = begin - first + 1, stop - first + 1
    sums[:] = ZERO
    s0, s1, s2 = sums[0, low:high], sums[1, low:high], sums[2, low:high]
    s3, s4, s5 = sums[3, low:high], sums[4, low:high], sums[5, low:high]
    for dy in range(-1, 2):
        row = min(max(y + dy, 0), height - 1)
        red, green, blue = toned[0, row, begin:stop], toned[1, row, begin:stop], toned[2, row, begin:stop]
        for x in range(red.shape[0]):
            luma, orange, green_shift = ycocg(red[x], green[x], blue[x])
            s0[x] += luma
            s1[x] += orange
            s2[x] += green_shift
            s3[x] += luma * luma
            s4[x] += orange * orange
            s5[x] += green_shift * green_shift
    red, green, blue = current[0], current[1], current[2]
    for c in range(3):
        for k in (c, c + 3):
            if first == 0:
                sums[k, 0] = sums[k, 1]
            if end == width:
                sums[k, count + 1] = sums[k, count]
        l0, m0, r0 = sums[c, :count], sums[c, 1 : count + 1], sums[c, 2 : count + 2]
        l1, m1, r1 = sums[c + 3, :count], sums[c + 3, 1 : count + 1], sums[c + 3, 2 : count + 2]
        center, size = mean[c], extent[c]
        for x in range(count):
            average = (l0[x] + m0[x] + r0[x]) * NINTH
            square = (l1[x] + m1[x] + r1[x]) * NINTH
            luma, orange, green_shift = ycocg(red[x], green[x], blue[x])
            own = luma if c == 0 else orange if c == 1 else green_shift
            spread = math.sqrt(max(square - average * average, ZERO) + TINY)
            center[x], size[x] = average, max(gamma * spread, abs(own - average))


@scalar
def front_row(which, farthest, limit, depth, normal, rays, parallel, y, first, end):
    """Which of the 3x3 pixels around is the farthest of the body in front of each pixel's plane, in rows of three."""
    height, width = depth.shape
    here, line = depth[y, first:end], np.float32(y)
    nx, ny, nz = normal[0, y, first:end], normal[1, y, first:end], normal[2, y, first:end]
    ax, ay, az, bx, by, bz = rays[0, 0], rays[1, 0], rays[2, 0], rays[0, 1], rays[1, 1], rays[2, 1]
    cx, cy, cz = rays[0, 2], rays[1, 2], rays[2, 2]
    for x in range(end - first):
        across, down = nx[x] * ax + ny[x] * ay + nz[x] * az, nx[x] * bx + ny[x] * by + nz[x] * bz
        along = nx[x] * cx + ny[x] * cy + nz[x] * cz
        along += ZERO if parallel else np.float32(first + x) * across + line * down
        facing, slope = abs(along) + GRAZING, abs(across) + abs(down)
        lean = slope / facing if slope >= ZERO else ZERO  # not a number counts as none
        limit[x] = IN_FRONT * (here[x] - lean if parallel else here[x] / (ONE + lean))
    nearest = farthest
    nearest[: end - first] = NOWHERE
    for k in range(9):
        row, dx = y + k // 3 - 1, k % 3 - 1
        begin, stop = max(-dx, first), min(width - dx, end)
        if 0 <= row < height and begin < stop:
            there, least = depth[row, begin + dx : stop + dx], nearest[begin - first : stop - first]
            for i in range(least.shape[0]):
                least[i] = there[i] if there[i] < least[i] else least[i]
    for x in range(end - first):
        body = nearest[x] * BODY
        limit[x] = body if body < limit[x] else limit[x]
        farthest[x], which[x] = NONE, 4
    for k in range(9):
        row, dx = y + k // 3 - 1, k % 3 - 1
        begin, stop, index = max(-dx, first), min(width - dx, end), np.int32(k)
        if 0 <= row < height and begin < stop:
            there, below = depth[row, begin + dx : stop + dx], limit[begin - first : stop - first]
            found, best = which[begin - first : stop - first], farthest[begin - first : stop - first]
            for i in range(best.shape[0]):
                better = there[i] < below[i] and there[i] > best[i]
                found[i], best[i] = index if better else found[i], there[i] if better else best[i]


@inlined
def _weights(f):
    """Catmull-Rom weights of the taps at -1, 0, 1 and 2."""
    return (
        f * (-HALF + f * (ONE - HALF * f)),
        ONE + f * f * (-FIVE_HALVES + THREE_HALVES * f),
        f * (HALF + f * (TWO - THREE_HALVES * f)),
        f * f * (-HALF + HALF * f),
    )


@scalar
def fetch_row(old, age, which, motion, before, ages, y, first):
    """The history where the surfaces in front were, as `catmull_rom.catmull_rom` reads it, and its age or 0."""
    _, height, width = before.shape
    for x in range(age.shape[0]):
        row, column = y + which[x] // 3 - 1, first + x + which[x] % 3 - 1
        at_x = np.float32(first + x) + HALF + motion[0, row, column]
        at_y = np.float32(y) + HALF + motion[1, row, column]
        age[x] = ZERO
        if at_x >= ZERO and at_x < np.float32(width) and at_y >= ZERO and at_y < np.float32(height):
            age[x] = ages[np.int64(at_y), np.int64(at_x)]
        if not age[x] > ZERO:
            old[0, x], old[1, x], old[2, x] = ZERO, ZERO, ZERO
            continue
        left, top = math.floor(at_x - HALF), math.floor(at_y - HALF)
        fx, fy = at_x - (np.float32(left) + HALF), at_y - (np.float32(top) + HALF)
        x0, y0 = np.int64(left), np.int64(top)
        if fx == ZERO and fy == ZERO:
            old[0, x], old[1, x], old[2, x] = before[0, y0, x0], before[1, y0, x0], before[2, y0, x0]
            continue
        age[x] = min(age[x], QUARTER_SHARP / (fx * (ONE - fx) + fy * (ONE - fy)) - ONE)
        a, b, c, d = _weights(fx)
        e, f, g, h = _weights(fy)
        total = ONE / ((a + b + c + d) * (f + g) + (b + c) * (e + h))
        xa, xb, xc, xd = max(x0 - 1, 0), max(x0, 0), min(x0 + 1, width - 1), min(x0 + 2, width - 1)
        ye, yf, yg, yh = max(y0 - 1, 0), max(y0, 0), min(y0 + 1, height - 1), min(y0 + 2, height - 1)
        for k in range(3):
            plane = before[k]
            outer = e * (b * plane[ye, xb] + c * plane[ye, xc]) + h * (b * plane[yh, xb] + c * plane[yh, xc])
            upper = a * plane[yf, xa] + b * plane[yf, xb] + c * plane[yf, xc] + d * plane[yf, xd]
            lower = a * plane[yg, xa] + b * plane[yg, xb] + c * plane[yg, xc] + d * plane[yg, xd]
            old[k, x] = (outer + f * upper + g * lower) * total


@scalar
def mix_row(toned, lengths, current, old, age, mean, extent, longest, y, first, end):
    """The new history: the old one, clipped to its box, with this frame in it."""
    luma, orange, green_shift = mean[0], mean[1], mean[2]
    size0, size1, size2 = extent[0], extent[1], extent[2]
    red, green, blue = current[0], current[1], current[2]
    old_red, old_green, old_blue = old[0], old[1], old[2]
    new_red, new_green, new_blue = toned[0, y, first:end], toned[1, y, first:end], toned[2, y, first:end]
    length = lengths[y, first:end]
    for x in range(age.shape[0]):
        a0, a1, a2 = ycocg(old_red[x], old_green[x], old_blue[x])
        a0, a1, a2 = a0 - luma[x], a1 - orange[x], a2 - green_shift[x]
        outside = max(abs(a0) / max(size0[x], LEAST), abs(a1) / max(size1[x], LEAST))
        outside = max(max(outside, abs(a2) / max(size2[x], LEAST)), ONE)
        a0, a1, a2 = luma[x] + a0 / outside, orange[x] + a1 / outside, green_shift[x] + a2 / outside
        r, g, b = max(a0 + a1 - a2, ZERO), max(a0 + a2, ZERO), max(a0 - a1 - a2, ZERO)
        frames = min(age[x] + ONE, longest)
        share, visible = ONE / frames, age[x] > ZERO
        length[x] = frames
        new_red[x] = r + (red[x] - r) * share if visible else red[x]
        new_green[x] = g + (green[x] - g) * share if visible else green[x]
        new_blue[x] = b + (blue[x] - b) * share if visible else blue[x]


@scalar
def light_row(out, toned, y, first, end):
    """The inverse of `tone_row`."""
    red, green, blue = toned[0, y, first:end], toned[1, y, first:end], toned[2, y, first:end]
    new_red, new_green, new_blue = out[0, y, first:end], out[1, y, first:end], out[2, y, first:end]
    for x in range(red.shape[0]):
        level = ONE - min(max(luminance(red[x], green[x], blue[x]), ZERO), BRIGHTEST)
        new_red[x], new_green[x], new_blue[x] = red[x] / level, green[x] / level, blue[x] / level
