"""The compiled form of an open shutter: pixels ``first`` to ``end`` of a row as a body.

Names and steps are those of the torch reference in `post.lens.shutter_reference`, the definition. Where points come
from and how much they count are loops that become vector instructions. Loops that gather do not, so they do nothing
else; the channels of a pixel lie side by side for them.
"""

from __future__ import annotations

import math

import numpy as np

from gbufrt.compute.kernel import contracted, inlined, scalar
from post.lens import constants

ZERO, HALF, ONE, TWO = np.float32(0), np.float32(0.5), np.float32(1), np.float32(2)
TOLERANCE, RELATIVE = np.float32(constants.LANDING_TOLERANCE), np.float32(constants.LANDING_RELATIVE)
ALIKE = np.float32(constants.ALIKE**2)
STILL, OWN_WEIGHT = np.float32(constants.STILL**2), np.float32(constants.OWN_WEIGHT)
TINY, SHORTEST = np.float32(1e-12), np.float32(1e-30)
TOGETHER = 3  # channels that lie side by side for each pixel
U1, U2, U3, U4, U5 = (np.uint32(i) for i in range(1, 6))


@scalar
def moves(path, y, first, end):
    """Whether anything near pixels moves so far that it is blurred."""
    along, down = path[0, y, first:end], path[1, y, first:end]
    longest = ZERO
    for x in range(along.shape[0]):
        longest = max(longest, along[x] * along[x] + down[x] * down[x])
    return longest > STILL


@scalar
def time_row(time, noise, opening, i, samples, y, first):
    """Moment ``i`` of the exposure for each pixel, in frames."""
    row, step, before = noise[y, first : first + time.shape[0]], ONE / np.float32(samples), np.float32(i)
    for x in range(row.shape[0]):
        time[x] = np.float32(opening) + (before + row[x]) * step


@scalar
def start_row(sums, weight, color, own, y, first):
    """Each pixel's own colour."""
    for c in range(color.shape[0]):
        row, total = color[c, y, first : first + weight.shape[0]], sums[c]
        for x in range(row.shape[0]):
            total[x] = own * row[x]
    weight[:] = own


@inlined
def _in_front(near, far, softness):
    scale = TWO * softness * max(abs(min(near, far)), TINY)
    return min(max(HALF + (far - near) / scale, ZERO), ONE)


@inlined
def _length(x, y):
    return math.sqrt(max(x * x + y * y, SHORTEST))


@contracted
def aim_row(at_x, at_y, place, along, down, time, size, y, first):
    """Where the points that paths bring to pixels are now, and which pixels show them; outside, the border does."""
    right, bottom, row = np.float32(size[1] - 1), np.float32(size[0] - 1), np.float32(y)
    width = np.int32(size[1])
    for x in range(time.shape[0]):
        from_x, from_y = np.float32(np.int32(first + x)) - along[x] * time[x], row - down[x] * time[x]
        at_x[x], at_y[x] = from_x, from_y
        near_x, near_y = min(max(from_x, ZERO), right) + HALF, min(max(from_y, ZERO), bottom) + HALF
        place[x] = np.int32(near_y) * width + np.int32(near_x)


@scalar
def look_row(moved_x, moved_y, place, known):
    """The paths of pixels."""
    across, down = known[1], known[2]
    for x in range(place.shape[0]):
        k = np.uint32(place[x])
        moved_x[x], moved_y[x] = across[k], down[k]


@scalar
def look_at_row(found, moved_x, moved_y, place, known):
    """The depths and paths of pixels."""
    depth, across, down = known[0], known[1], known[2]
    for x in range(place.shape[0]):
        k = np.uint32(place[x])
        found[x], moved_x[x], moved_y[x] = depth[k], across[k], down[k]


@contracted
def land_row(lands, behind, at_x, at_y, found, moved_x, moved_y, depth, along, down, time, softness, y, first):
    """Whether points land on the pixels, and whether they lie behind what is there now."""
    height, width = depth.shape
    own = depth[y, first : first + time.shape[0]]
    right, bottom = np.float32(width - 1), np.float32(height - 1)
    for x in range(time.shape[0]):
        step_x, step_y = along[x] * time[x], down[x] * time[x]
        miss = _length(moved_x[x] * time[x] - step_x, moved_y[x] * time[x] - step_y)
        landed = TWO - miss / (TOLERANCE + RELATIVE * _length(step_x, step_y))
        lands[x] = min(max(landed, ZERO), ONE)
        behind[x] = TWO * max(_in_front(own[x], found[x], softness) - HALF, ZERO)
        at_x[x] = min(max(at_x[x], ZERO), right)
        at_y[x] = min(max(at_y[x], ZERO), bottom)


@contracted
def place_row(place, dominant, time, size, y, first, end):
    """As `aim_row`, the pixels alone."""
    along, down = dominant[0, y, first:end], dominant[1, y, first:end]
    right, bottom, row = np.float32(size[1] - 1), np.float32(size[0] - 1), np.float32(y)
    width = np.int32(size[1])
    for x in range(time.shape[0]):
        from_x, from_y = np.float32(np.int32(first + x)) - along[x] * time[x], row - down[x] * time[x]
        near_x, near_y = min(max(from_x, ZERO), right) + HALF, min(max(from_y, ZERO), bottom) + HALF
        place[x] = np.int32(near_y) * width + np.int32(near_x)


@contracted
def guess_row(along, down, own_x, own_y):
    """Guesses that are hardly unlike a pixel's own path become that; returns whether others are left."""
    most = ZERO
    for x in range(along.shape[0]):
        off_x, off_y = along[x] - own_x[x], down[x] - own_y[x]
        unlike = off_x * off_x + off_y * off_y
        alike = unlike < ALIKE
        along[x] = own_x[x] if alike else along[x]
        down[x] = own_y[x] if alike else down[x]
        most = max(most, unlike)
    return most >= ALIKE


@scalar
def candidate_row(
    at_x, at_y, found, lands, behind, place, moved_x, moved_y, known, depth, along, down, time, softness, y, first
):
    """The points that paths bring to pixels; ``known`` are depth and path of the picture, a row each."""
    aim_row(at_x, at_y, place, along, down, time, depth.shape, y, first)
    look_at_row(found, moved_x, moved_y, place, known)
    land_row(lands, behind, at_x, at_y, found, moved_x, moved_y, depth, along, down, time, softness, y, first)


@contracted
def weigh_row(a, b, a_found, b_found, a_behind, b_behind, softness):
    """From whether points land, ``a`` and ``b`` become their weights."""
    for x in range(a.shape[0]):
        front = _in_front(a_found[x], b_found[x], softness)
        bare = (ONE - a[x]) * (ONE - b[x]) / max(a_behind[x] + b_behind[x], ONE)
        share = a[x] * (ONE - b[x] * (ONE - front)) + bare * a_behind[x]
        b[x] = b[x] * (ONE - a[x] * front) + bare * b_behind[x]
        a[x] = share


@contracted
def weigh_alone_row(b, b_behind):
    """As `weigh_row` for two points that are one: the weight of both."""
    for x in range(b.shape[0]):
        free = ONE - b[x]
        bare = free * free / max(TWO * b_behind[x], ONE)
        b[x] = b[x] * (TWO - b[x]) + TWO * bare * b_behind[x]


@contracted
def tap_row(place, taps, weight, at_x, at_y, share, width):
    """The upper left of the four pixels around each point, and the weights of the four."""
    q, r, s, t = taps[0], taps[1], taps[2], taps[3]
    for x in range(share.shape[0]):
        left, top = np.int32(at_x[x]), np.int32(at_y[x])
        part_x, part_y = at_x[x] - np.float32(left), at_y[x] - np.float32(top)
        upper, lower = share[x] * (ONE - part_y), share[x] * part_y
        place[x] = (top * np.int32(width) + left) * np.int32(TOGETHER)
        q[x], r[x], s[x], t[x] = upper * (ONE - part_x), upper * part_x, lower * (ONE - part_x), lower * part_x
        weight[x] += share[x]


@contracted
def add_row(red, green, blue, picture, a_place, a_taps, b_place, b_taps, width):
    """Add the weighted colours of two points between pixels."""
    a_q, a_r, a_s, a_t = a_taps[0], a_taps[1], a_taps[2], a_taps[3]
    b_q, b_r, b_s, b_t = b_taps[0], b_taps[1], b_taps[2], b_taps[3]
    lower = picture[width * TOGETHER :]
    for x in range(red.shape[0]):
        k, q, r, s, t = np.uint32(a_place[x]), a_q[x], a_r[x], a_s[x], a_t[x]
        first = q * picture[k] + r * picture[k + U3] + s * lower[k] + t * lower[k + U3]
        second = q * picture[k + U1] + r * picture[k + U4] + s * lower[k + U1] + t * lower[k + U4]
        third = q * picture[k + U2] + r * picture[k + U5] + s * lower[k + U2] + t * lower[k + U5]
        k, q, r, s, t = np.uint32(b_place[x]), b_q[x], b_r[x], b_s[x], b_t[x]
        first += q * picture[k] + r * picture[k + U3] + s * lower[k] + t * lower[k + U3]
        second += q * picture[k + U1] + r * picture[k + U4] + s * lower[k + U1] + t * lower[k + U4]
        third += q * picture[k + U2] + r * picture[k + U5] + s * lower[k + U2] + t * lower[k + U5]
        red[x] += first
        green[x] += second
        blue[x] += third


@contracted
def add_alone_row(red, green, blue, picture, place, taps, width):
    """Add the weighted colours of one point between pixels."""
    upper_left, upper_right, lower_left, lower_right = taps[0], taps[1], taps[2], taps[3]
    lower = picture[width * TOGETHER :]
    for x in range(red.shape[0]):
        k, q, r, s, t = np.uint32(place[x]), upper_left[x], upper_right[x], lower_left[x], lower_right[x]
        red[x] += q * picture[k] + r * picture[k + U3] + s * lower[k] + t * lower[k + U3]
        green[x] += q * picture[k + U1] + r * picture[k + U4] + s * lower[k + U1] + t * lower[k + U4]
        blue[x] += q * picture[k + U2] + r * picture[k + U5] + s * lower[k + U2] + t * lower[k + U5]


@scalar
def finish_row(out, color, sums, weight, path, y, first, end):
    """Write pixels; those that nothing moves over stay as they are."""
    along, down = path[0, y, first:end], path[1, y, first:end]
    for c in range(color.shape[0]):
        new, old, total = out[c, y, first:end], color[c, y, first:end], sums[c]
        for x in range(new.shape[0]):
            moving = along[x] * along[x] + down[x] * down[x] > STILL
            new[x] = total[x] / weight[x] if moving else old[x]
