"""The compiled form of `post.march.rays.march_rays`: one screen-space ray as a scalar body.

Names and steps are those of the torch reference in `post.march.reference`, which is the definition. ``q`` is
nearness: 1 / z for a perspective camera, -z for an orthographic one. Along a ray and over a plane it is linear in the
picture. Numbers are float32: positions are then good to 1e-4 pixels, and nearness to a hundredth of `TOLERANCE`.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from gbufrt.compute.kernel import inlined, scalar
from post.march import constants
from post.march.constants import BEHIND, BLOCKED, HIT, LEFT, SPENT

ZERO, QUARTER, HALF, ONE, TWO = np.float32(0), np.float32(0.25), np.float32(0.5), np.float32(1), np.float32(2)
TOLERANCE = np.float32(constants.TOLERANCE)

Line = namedtuple("Line", "x y q dx dy dq flat steep")
"""A ray in the picture, from its origin to its end; ``flat + steep |q|`` is a pixel's side as a difference of q."""
Ending = namedtuple("Ending", "x y distance agreement status")
"""How a ray ended; see `post.march.rays.Hits`."""


@inlined
def _front(plane, q, x, y, ix, iy):
    """How far a point at (x, y) with nearness q is in front of pixel i's plane."""
    return q - (plane[0] + plane[1] * (x - np.float32(ix) - HALF) + plane[2] * (y - np.float32(iy) - HALF))


@inlined
def _intersect(planes, line, ix, iy, jx, jy, share, leave):
    """Intersect a ray, between two of its shares, with pixel i's surface: status, part of the way, agreement.

    The ray comes from pixel j.
    """
    plane = planes[iy, ix]
    ax, ay, qa = line.x + share * line.dx, line.y + share * line.dy, line.q + share * line.dq
    bx, by, qb = line.x + leave * line.dx, line.y + leave * line.dy, line.q + leave * line.dq
    front_a, front_b = _front(plane, qa, ax, ay, ix, iy), _front(plane, qb, bx, by, ix, iy)
    tolerance = TOLERANCE * abs(plane[0])
    if front_a >= -tolerance:
        if front_b >= -tolerance:
            return LEFT, ZERO, ZERO
        return HIT, front_a / (front_a - front_b), ONE
    beside, back = planes[jy, jx], plane[3]
    crack = abs(plane[1]) + abs(plane[2]) + abs(beside[1]) + abs(beside[2]) + line.flat + line.steep * abs(plane[0])
    step = _front(beside, qa, ax, ay, jx, jy) - front_a
    if front_a > -crack and step < crack:
        if front_b < front_a:
            return HIT, ZERO, min(ONE, TWO * (ONE + front_a / crack))
        return LEFT, ZERO, ZERO  # it leaves a round body over its rim
    if qa > back or qb > back:
        return BLOCKED, ZERO, min(ONE, max(ZERO, (qa - back) / (qa - front_a - back)))
    return BEHIND, ZERO, ZERO


@inlined
def _continued(planes, line, ix, iy, share, leave):
    """Where the ray, between two of its shares, crosses pixel i's plane continued out of that pixel; -1 if nowhere."""
    plane = planes[iy, ix]
    x, y, q = line.x + leave * line.dx, line.y + leave * line.dy, line.q + leave * line.dq
    front_b = _front(plane, q, x, y, ix, iy)
    if front_b >= -TOLERANCE * abs(plane[0]):
        return -ONE
    x, y, q = line.x + share * line.dx, line.y + share * line.dy, line.q + share * line.dq
    front_a = max(_front(plane, q, x, y, ix, iy), ZERO)
    return share + front_a / (front_a - front_b) * (leave - share)


@scalar
def _traverse(planes, pyramid, table, line, steps):
    """Traverse the cells that the ray passes: status, share of the ray, pixel column and row, agreement.

    The pixel is the one that the ray hit or, if it hit nothing, the last one that it was in front of.
    """
    height, width, top = planes.shape[0], planes.shape[1], table.shape[0] - 1
    if not (ZERO <= line.x < np.float32(width) and ZERO <= line.y < np.float32(height)):
        return LEFT, ZERO, np.int64(np.floor(line.x)), np.int64(np.floor(line.y)), ZERO
    ix, iy, level, share, pixels = np.int64(line.x), np.int64(line.y), 0, ZERO, -1
    per_x, per_y = ONE / line.dx, ONE / line.dy
    right, down, sideways = 1 if line.dx >= ZERO else 0, 1 if line.dy >= ZERO else 0, False
    hx, hy, status = -1, -1, LEFT  # the pixel from which the ray went behind something
    while pixels < steps:
        cx, cy = ix >> level, iy >> level
        leave_x = (np.float32((cx + right) << level) - line.x) * per_x
        leave_y = (np.float32((cy + down) << level) - line.y) * per_y
        leave = min(min(leave_x, leave_y), ONE)
        jx, jy = (ix + 1 - 2 * right, iy) if sideways else (ix, iy + 1 - 2 * down)
        behind = False
        if level > 0:
            qa, qb = line.q + share * line.dq, line.q + leave * line.dq
            cell = pyramid[table[level, 0] + cy * table[level, 1] + cx]
            if not (min(qa, qb) > cell[0] or max(qa, qb) < cell[1]):
                level -= 1
                continue
            behind = min(qa, qb) <= cell[0]
        else:
            pixels += 1
            if pixels > 0:  # not compared with the pixel that it starts in
                event, part, agreement = _intersect(planes, line, ix, iy, jx, jy, share, leave)
                if event in (HIT, BLOCKED):
                    return event, max(share + part * (leave - share), ZERO), ix, iy, agreement
                behind = event == BEHIND
        if behind:
            if hx < 0:
                hx, hy = jx, jy
            crossing = _continued(planes, line, hx, hy, share, leave)
            if crossing >= ZERO:
                return BLOCKED, crossing, hx, hy, ZERO
        else:
            hx = -1
        share = leave
        if leave >= ONE:
            status = SPENT
            break
        sideways = leave_x < leave_y
        if sideways:
            ix = ((cx + right) << level) + right - 1
            iy = min(max(np.int64(line.y + share * line.dy), cy << level), ((cy + 1) << level) - 1)
        else:
            iy = ((cy + down) << level) + down - 1
            ix = min(max(np.int64(line.x + share * line.dx), cx << level), ((cx + 1) << level) - 1)
        if ix < 0 or ix >= width or iy < 0 or iy >= height:
            break
        if level < top and ((ix >> (level + 1)) != (cx >> 1) or (iy >> (level + 1)) != (cy >> 1)):
            level += 1
    if hx >= 0:
        ix, iy = hx, hy
    return status, share, min(max(ix, 0), width - 1), min(max(iy, 0), height - 1), ZERO


@scalar
def _same_surface(planes, line, ix, iy, jx, jy):
    """Whether pixel j continues the plane of pixel i."""
    if jx < 0 or jy < 0 or jx >= planes.shape[1] or jy >= planes.shape[0]:
        return True  # reads beyond the border repeat pixel i
    q = planes[iy, ix, 0]
    expected = q + planes[iy, ix, 1] * np.float32(jx - ix) + planes[iy, ix, 2] * np.float32(jy - iy)
    return abs(planes[jy, jx, 0] - expected) <= QUARTER * (line.flat + line.steep * abs(q))


@scalar
def _snap(planes, line, ix, iy, x, y):
    """The position in pixel i nearest to (x, y) where a bilinear read mixes in no other surface."""
    left, upper = np.float32(ix), np.float32(iy)
    x, y = min(max(x, left), left + ONE), min(max(y, upper), upper + ONE)
    ox, oy = x - left - HALF, y - upper - HALF
    jx, jy = ix + (1 if ox > ZERO else -1), iy + (1 if oy > ZERO else -1)
    keep_x, keep_y = _same_surface(planes, line, ix, iy, jx, iy), _same_surface(planes, line, ix, iy, ix, jy)
    if keep_x and keep_y and not _same_surface(planes, line, ix, iy, jx, jy):
        keep_x, keep_y = abs(ox) >= abs(oy), abs(ox) < abs(oy)
    return (x if keep_x else left + HALF), (y if keep_y else upper + HALF)


@scalar
def off_edge(planes, lens, orthographic, end, x, y):
    """See `post.march.rays.off_edge`: of one ray that ended hidden and began at the place (x, y) in the picture."""
    along, down = end.x - x, end.y - y
    step = (ONE if end.agreement > ZERO else -ONE) / max(abs(along), abs(down))
    jx, jy = np.int64(np.floor(end.x + step * along)), np.int64(np.floor(end.y + step * down))
    if not (0 <= jx < planes.shape[1] and 0 <= jy < planes.shape[0]):
        return end
    flat, steep = (ONE / np.float32(lens[1]), ZERO) if orthographic else (ZERO, ONE / np.float32(lens[1]))
    line = Line(x, y, ZERO, along, down, ZERO, flat, steep)
    if not _same_surface(planes, line, np.int64(end.x), np.int64(end.y), jx, jy):
        return end
    return Ending(np.float32(jx) + HALF, np.float32(jy) + HALF, end.distance, end.agreement, end.status)


@scalar
def trace(planes, pyramid, table, lens, origin, direction, near, orthographic, distance, steps):
    """One ray from a view-space origin along a unit direction (triples): its `Ending`."""
    ox, oy, oz = origin
    dx, dy, dz = direction
    if dx * dx + dy * dy + dz * dz < HALF or (oz <= near and not orthographic):
        return Ending(ZERO, ZERO, ZERO, ZERO, LEFT)
    fx, fy, cx, cy = np.float32(lens[0]), np.float32(lens[1]), np.float32(lens[2]), np.float32(lens[3])
    length = distance
    if dz < ZERO and not orthographic:
        length = min(length, (near - oz) / dz)
    ex, ey, ez = ox + length * dx, oy + length * dy, oz + length * dz
    if orthographic:
        q0, q1, flat, steep = -oz, -ez, ONE / fy, ZERO
        x0, y0, x1, y1 = ox * fx + cx, oy * fy + cy, ex * fx + cx, ey * fy + cy
    else:
        q0, q1, flat, steep = ONE / oz, ONE / ez, ZERO, ONE / fy
        x0, y0, x1, y1 = ox * q0 * fx + cx, oy * q0 * fy + cy, ex * q1 * fx + cx, ey * q1 * fy + cy
    line = Line(x0, y0, q0, x1 - x0, y1 - y0, q1 - q0, flat, steep)
    status, share, ix, iy, agreement = _traverse(planes, pyramid, table, line, steps)
    travelled = length * share if orthographic else length * share * q1 / (q0 + share * line.dq)
    if status == HIT:
        x, y = _snap(planes, line, ix, iy, x0 + share * line.dx, y0 + share * line.dy)
    else:
        x, y = np.float32(ix) + HALF, np.float32(iy) + HALF
    return Ending(x, y, travelled, agreement, status)


@scalar
def march(i, out, planes, pyramid, table, lens, origins, directions, near, orthographic, distance, steps):
    """See `post.march.op.march_rays_cpu`: one ray, written to its place in ``out``."""
    b = 0 if origins.shape[0] == 1 else i // origins.shape[2]
    k = i - b * origins.shape[2]
    origin = (origins[b, 0, k], origins[b, 1, k], origins[b, 2, k])
    direction = (directions[b, 0, k], directions[b, 1, k], directions[b, 2, k])
    near, distance = np.float32(near), np.float32(distance)
    end = trace(planes[b], pyramid[b], table, lens[b], origin, direction, near, orthographic, distance, steps)
    out[b, 0, k] = end.x
    out[b, 1, k] = end.y
    out[b, 2, k] = end.distance
    out[b, 3, k] = end.agreement
    out[b, 4, k] = end.status
