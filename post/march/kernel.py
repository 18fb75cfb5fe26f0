"""The compiled form of `post.march.rays.march_rays`: one screen-space ray as a scalar body.

Names and steps are those of the torch reference in `post.march.reference`, which is the definition. ``q`` is
nearness: 1 / z for a perspective camera, -z for an orthographic one. Along a ray and over a plane it is linear in the
picture.
"""

from __future__ import annotations

import math

import numpy as np

from gbufrt.compute.kernel import scalar
from post.march.constants import BEHIND, BLOCKED, HIT, LEFT, SPENT, TOLERANCE


@scalar
def _intersect(planes, ix, iy, jx, jy, ax, ay, qa, bx, by, qb, flat, steep):
    """Intersect a ray from (ax, ay, qa) in pixel j to (bx, by, qb) with pixel i's surface: status, share, agreement."""
    q, gx, gy, back = planes[iy, ix, 0], planes[iy, ix, 1], planes[iy, ix, 2], planes[iy, ix, 3]
    front_a = qa - (q + gx * (ax - ix - 0.5) + gy * (ay - iy - 0.5))
    front_b = qb - (q + gx * (bx - ix - 0.5) + gy * (by - iy - 0.5))
    tolerance = TOLERANCE * abs(q)
    if front_a >= -tolerance:
        if front_b >= -tolerance:
            return LEFT, 0.0, 0.0
        return HIT, front_a / (front_a - front_b), 1.0
    h, hx, hy = planes[jy, jx, 0], planes[jy, jx, 1], planes[jy, jx, 2]
    crack = abs(gx) + abs(gy) + abs(hx) + abs(hy) + flat + steep * abs(q)
    step = (qa - front_a) - (h + hx * (ax - jx - 0.5) + hy * (ay - jy - 0.5))
    if front_b < front_a and front_a > -crack and step < crack:
        return HIT, 0.0, min(1.0, 2.0 * (1.0 + front_a / crack))
    if qa > back or qb > back:
        return BLOCKED, 0.0, min(1.0, max(0.0, (qa - back) / (qa - front_a - back)))
    return BEHIND, 0.0, 0.0


@scalar
def _continued(planes, ix, iy, x0, y0, dx, dy, share, leave, qa, qb):
    """Where the ray, between two of its shares, crosses pixel i's plane continued out of that pixel; -1 if nowhere."""
    if ix < 0:
        return -1.0
    q, gx, gy = planes[iy, ix, 0], planes[iy, ix, 1], planes[iy, ix, 2]
    front_b = qb - (q + gx * (x0 + leave * dx - ix - 0.5) + gy * (y0 + leave * dy - iy - 0.5))
    if front_b >= -TOLERANCE * abs(q):
        return -1.0
    front_a = max(qa - (q + gx * (x0 + share * dx - ix - 0.5) + gy * (y0 + share * dy - iy - 0.5)), 0.0)
    return share + front_a / (front_a - front_b) * (leave - share)


@scalar
def _traverse(planes, pyramid, table, x0, y0, q0, dx, dy, dq, flat, steep, steps):
    """Traverse the cells that the ray passes: status, share of the ray, pixel column and row, agreement.

    The pixel is the one that the ray hit or, if it hit nothing, the last one that it was in front of.
    """
    height, width, top = planes.shape[0], planes.shape[1], table.shape[0] - 1
    ix, iy, level, share, pixels = math.floor(x0), math.floor(y0), 0, 0.0, -1
    if ix < 0 or ix >= width or iy < 0 or iy >= height:
        return LEFT, 0.0, ix, iy, 0.0
    per_x, per_y = 1.0 / dx, 1.0 / dy
    right, down, sideways = 1 if dx >= 0.0 else 0, 1 if dy >= 0.0 else 0, False
    hx, hy, status = -1, -1, LEFT  # the pixel from which the ray went behind something
    while pixels < steps:
        cx, cy = ix >> level, iy >> level
        leave_x, leave_y = (((cx + right) << level) - x0) * per_x, (((cy + down) << level) - y0) * per_y
        leave = min(min(leave_x, leave_y), 1.0)
        qa, qb = q0 + share * dq, q0 + leave * dq
        jx, jy = (ix + 1 - 2 * right, iy) if sideways else (ix, iy + 1 - 2 * down)
        behind = False
        if level > 0:
            cell = table[level, 0] + cy * table[level, 1] + cx
            if not (min(qa, qb) > pyramid[cell, 0] or max(qa, qb) < pyramid[cell, 1]):
                level -= 1
                continue
            behind = min(qa, qb) <= pyramid[cell, 0]
        else:
            pixels += 1
            if pixels > 0:  # not compared with the pixel that it starts in
                ax, ay, bx, by = x0 + share * dx, y0 + share * dy, x0 + leave * dx, y0 + leave * dy
                event, part, agreement = _intersect(planes, ix, iy, jx, jy, ax, ay, qa, bx, by, qb, flat, steep)
                if event in (HIT, BLOCKED):
                    return event, max(share + part * (leave - share), 0.0), ix, iy, agreement
                behind = event == BEHIND
        hx, hy = (hx if hx >= 0 else jx, hy if hx >= 0 else jy) if behind else (-1, -1)
        crossing = _continued(planes, hx, hy, x0, y0, dx, dy, share, leave, qa, qb)
        if crossing >= 0.0:
            return BLOCKED, crossing, hx, hy, 0.0
        share = leave
        if leave >= 1.0:
            status = SPENT
            break
        sideways = leave_x < leave_y
        if sideways:
            ix = ((cx + 1) << level) if right else (cx << level) - 1
            iy = min(max(math.floor(y0 + share * dy), cy << level), ((cy + 1) << level) - 1)
        else:
            iy = ((cy + 1) << level) if down else (cy << level) - 1
            ix = min(max(math.floor(x0 + share * dx), cx << level), ((cx + 1) << level) - 1)
        if ix < 0 or ix >= width or iy < 0 or iy >= height:
            break
        if level < top and ((ix >> (level + 1)) != (cx >> 1) or (iy >> (level + 1)) != (cy >> 1)):
            level += 1
    if hx >= 0:
        ix, iy = hx, hy
    return status, share, min(max(ix, 0), width - 1), min(max(iy, 0), height - 1), 0.0


@scalar
def _same_surface(planes, ix, iy, jx, jy, flat, steep):
    """Whether pixel j continues the plane of pixel i."""
    if jx < 0 or jy < 0 or jx >= planes.shape[1] or jy >= planes.shape[0]:
        return True  # reads beyond the border repeat pixel i
    q = planes[iy, ix, 0]
    expected = q + planes[iy, ix, 1] * (jx - ix) + planes[iy, ix, 2] * (jy - iy)
    return abs(planes[jy, jx, 0] - expected) <= 0.25 * (flat + steep * abs(q))


@scalar
def _snap(planes, ix, iy, x, y, flat, steep):
    """The position in pixel i nearest to (x, y) where a bilinear read mixes in no other surface."""
    x, y = min(max(x, ix + 0.0), ix + 1.0), min(max(y, iy + 0.0), iy + 1.0)
    ox, oy = x - ix - 0.5, y - iy - 0.5
    jx, jy = ix + (1 if ox > 0 else -1), iy + (1 if oy > 0 else -1)
    keep_x = _same_surface(planes, ix, iy, jx, iy, flat, steep)
    keep_y = _same_surface(planes, ix, iy, ix, jy, flat, steep)
    if keep_x and keep_y and not _same_surface(planes, ix, iy, jx, jy, flat, steep):
        keep_x, keep_y = abs(ox) >= abs(oy), abs(ox) < abs(oy)
    return (x if keep_x else ix + 0.5), (y if keep_y else iy + 0.5)


@scalar
def _ray(planes, pyramid, table, lens, ox, oy, oz, dx, dy, dz, near, orthographic, distance, steps):
    """One ray from view-space origin and unit direction: px x, px y, distance, agreement, status."""
    if dx * dx + dy * dy + dz * dz < 0.5 or (oz <= near and not orthographic):
        return 0.0, 0.0, 0.0, 0.0, LEFT
    fx, fy, cx, cy = lens[0], lens[1], lens[2], lens[3]
    length = distance
    if dz < 0.0 and not orthographic:
        length = min(length, (near - oz) / dz)
    ex, ey, ez = ox + length * dx, oy + length * dy, oz + length * dz
    if orthographic:
        q0, q1, flat, steep = -oz, -ez, 1.0 / fy, 0.0
        x0, y0, x1, y1 = ox * fx + cx, oy * fy + cy, ex * fx + cx, ey * fy + cy
    else:
        q0, q1, flat, steep = 1.0 / oz, 1.0 / ez, 0.0, 1.0 / fy
        x0, y0, x1, y1 = ox * q0 * fx + cx, oy * q0 * fy + cy, ex * q1 * fx + cx, ey * q1 * fy + cy
    status, share, ix, iy, agreement = _traverse(
        planes, pyramid, table, x0, y0, q0, x1 - x0, y1 - y0, q1 - q0, flat, steep, steps
    )
    travelled = length * share if orthographic else length * share * q1 / (q0 + share * (q1 - q0))
    x, y = x0 + share * (x1 - x0), y0 + share * (y1 - y0)
    if status == HIT:
        x, y = _snap(planes, ix, iy, x, y, flat, steep)
    else:
        x, y = ix + 0.5, iy + 0.5
    return x, y, travelled, agreement, status


@scalar
def march(i, out, planes, pyramid, table, lens, origins, directions, near, orthographic, distance, steps):
    """See `post.march.op.march_rays_cpu`: one ray, written to its place in ``out``."""
    b = 0 if origins.shape[0] == 1 else i // origins.shape[2]
    k = i - b * origins.shape[2]
    px, py, travelled, agreement, status = _ray(
        planes[b],
        pyramid[b],
        table,
        lens[b],
        np.float64(origins[b, 0, k]),
        np.float64(origins[b, 1, k]),
        np.float64(origins[b, 2, k]),
        np.float64(directions[b, 0, k]),
        np.float64(directions[b, 1, k]),
        np.float64(directions[b, 2, k]),
        near,
        orthographic,
        distance,
        steps,
    )
    out[b, 0, k] = px
    out[b, 1, k] = py
    out[b, 2, k] = travelled
    out[b, 3, k] = agreement
    out[b, 4, k] = status
