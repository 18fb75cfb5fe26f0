"""The definition of `post.march.rays.march_rays` in torch: all rays at once, one cell per step.

The compiled form in `post.march.kernel` follows it step by step.
"""

from __future__ import annotations

import torch
from torch import Tensor

from post.march.constants import BEHIND, BLOCKED, HIT, LEFT, SPENT, TOLERANCE


def march_rays_reference(
    planes: Tensor,
    pyramid: Tensor,
    table: Tensor,
    lens: Tensor,
    origins: Tensor,
    directions: Tensor,
    near: float,
    orthographic: bool,
    distance: float,
    steps: int,
) -> Tensor:
    """``(B, 5, h, w)`` float32: px x, px y, distance, agreement, status.

    Args:
        planes: see `post.march.rays.Hierarchy`.
        pyramid: likewise.
        table: likewise.
        lens: ``(B, 4)`` float64: focal lengths and principal point in pixels, jitter subtracted.
        origins: ``(B, 3, h, w)`` view space.
        directions: ``(B, 3, h, w)`` view space, unit or zero.
        near: view z at which rays toward the eye end.
        orthographic: whether ``q`` is -z rather than 1 / z.
        distance: world units a ray may go.
        steps: number of pixels whose surface a ray may be compared with.
    """
    rays = _Rays(lens, origins.double(), directions.double(), near, orthographic, distance)
    status, share, ix, iy, agreement = _traverse(planes, pyramid, table, rays, steps)
    x, y = rays.x + share * rays.dx, rays.y + share * rays.dy
    travelled = rays.length * share
    if not orthographic:
        travelled = travelled * (rays.q + rays.dq) / (rays.q + share * rays.dq)
    sx, sy = _snap(planes, rays, ix, iy, x, y)
    x, y = torch.where(status == HIT, sx, ix + 0.5), torch.where(status == HIT, sy, iy + 0.5)
    out = torch.stack([x, y, travelled, agreement, status.double()], dim=1)
    return (
        torch.where(rays.alive[:, None], out, 0.0)
        .view(origins.shape[0], *origins.shape[2:], 5)
        .permute(0, 3, 1, 2)
        .float()
    )


class _Rays:
    """Rays as straight lines in (px x, px y, q), from share 0 to share 1; each ``(R,)`` float64."""

    def __init__(self, lens, origins, directions, near, orthographic, distance) -> None:
        batch, _, height, width = origins.shape
        self.batch = torch.arange(batch, device=origins.device).repeat_interleave(height * width)
        o, d = origins.permute(1, 0, 2, 3).flatten(1), directions.permute(1, 0, 2, 3).flatten(1)
        self.alive = (d * d).sum(0) >= 0.5
        self.length = torch.full_like(o[2], distance)
        if not orthographic:
            self.alive &= o[2] > near
            toward = d[2] < 0
            eye = (near - o[2]) / torch.where(toward, d[2], -1.0)
            self.length = torch.where(toward, torch.minimum(self.length, eye), self.length)
        e = o + self.length * d
        fx, fy, cx, cy = lens[self.batch].unbind(1)
        if orthographic:
            start, end = torch.ones_like(o[2]), torch.ones_like(o[2])
            self.q, self.dq = -o[2], o[2] - e[2]
            self.flat, self.steep = 1 / fy, torch.zeros_like(fy)
        else:
            start, end = 1 / torch.where(self.alive, o[2], 1.0), 1 / torch.where(self.alive, e[2], 1.0)
            self.q, self.dq = start, end - start
            self.flat, self.steep = torch.zeros_like(fy), 1 / fy
        self.x, self.y = o[0] * start * fx + cx, o[1] * start * fy + cy
        self.dx, self.dy = e[0] * end * fx + cx - self.x, e[1] * end * fy + cy - self.y

    def pixel(self, q: Tensor) -> Tensor:
        """The length of a pixel's side where nearness is ``q``, as a difference of nearness."""
        return self.flat + self.steep * q.abs()


def _traverse(planes: Tensor, pyramid: Tensor, table: Tensor, rays: _Rays, steps: int) -> tuple[Tensor, ...]:
    height, width, top = planes.shape[1], planes.shape[2], table.shape[0] - 1
    ix, iy = rays.x.floor().clamp(-1, width).long(), rays.y.floor().clamp(-1, height).long()
    level, share = torch.zeros_like(ix), torch.zeros_like(rays.x)
    status, agreement = torch.full_like(ix, LEFT), torch.zeros_like(rays.x)
    running = rays.alive & (ix >= 0) & (ix < width) & (iy >= 0) & (iy < height)
    right, down = (rays.dx >= 0).long(), (rays.dy >= 0).long()
    pixels, sideways = torch.full_like(ix, -1), torch.zeros_like(rays.alive)
    hx, hy = torch.full_like(ix, -1), torch.full_like(iy, -1)  # the pixel from which a ray went behind something
    while bool(running.any()):
        size, cx, cy = 1 << level, ix >> level, iy >> level
        leave_x, leave_y = ((cx + right) * size - rays.x) / rays.dx, ((cy + down) * size - rays.y) / rays.dy
        leave = torch.minimum(leave_x, leave_y).clamp_max(1.0)
        qa, qb = rays.q + share * rays.dq, rays.q + leave * rays.dq
        cell = torch.where(running & (level > 0), table[level, 0] + cy * table[level, 1] + cx, 0)
        front, back = pyramid[rays.batch, cell].unbind(1)
        skips = (torch.minimum(qa, qb) > front) | (torch.maximum(qa, qb) < back)
        descends = running & (level > 0) & ~skips
        jx, jy = torch.where(sideways, ix + 1 - 2 * right, ix), torch.where(sideways, iy, iy + 1 - 2 * down)
        event, part, agrees = _intersect(planes, rays, ix, iy, jx, jy, share, leave, qa, qb)
        pixels = pixels + (running & (level == 0)).long()
        compared = running & (level == 0) & (pixels > 0)  # not in the pixel that it starts in
        ends = compared & ((event == HIT) | (event == BLOCKED))
        behind = torch.where(
            level > 0, running & skips & (torch.minimum(qa, qb) <= front), compared & (event == BEHIND)
        )
        goes = behind & (hx < 0)
        hx, hy = torch.where(goes, jx, torch.where(behind | descends | ~running, hx, -1)), torch.where(goes, jy, hy)
        crosses, along = _continued(planes, rays, hx, hy, share, leave, qa, qb)
        crosses &= behind
        event, part, agrees = (torch.where(crosses, a, b) for a, b in ((BLOCKED, event), (along, part), (0.0, agrees)))
        ix, iy, ends = torch.where(crosses, hx, ix), torch.where(crosses, hy, iy), ends | crosses
        status, agreement = torch.where(ends, event, status), torch.where(ends, agrees, agreement)
        share = torch.where(ends, (share + part * (leave - share)).clamp_min(0.0), share)
        moves = running & ~descends & ~ends
        share = torch.where(moves, leave, share)
        spent = moves & (leave >= 1.0)
        status = torch.where(spent, SPENT, status)
        moves = moves & ~spent
        beside, above = (
            _within(cy * size, size, rays.y + share * rays.dy),
            _within(cx * size, size, rays.x + share * rays.dx),
        )
        sideways = torch.where(moves, leave_x < leave_y, sideways)
        nx = torch.where(sideways, (cx + right) * size - 1 + right, above)
        ny = torch.where(sideways, beside, (cy + down) * size - 1 + down)
        ix, iy = torch.where(moves, nx, ix), torch.where(moves, ny, iy)
        running = running & ~ends & ~spent & (ix >= 0) & (ix < width) & (iy >= 0) & (iy < height) & (pixels < steps)
        rises = moves & (level < top) & (((ix >> (level + 1)) != (cx >> 1)) | ((iy >> (level + 1)) != (cy >> 1)))
        level = level + rises.long() - descends.long()
    hidden, lost = hx >= 0, (status == LEFT) | (status == SPENT)  # pixel that lost rays were last in front of
    last_x, last_y = torch.where(hidden, hx, ix).clamp(0, width - 1), torch.where(hidden, hy, iy).clamp(0, height - 1)
    ix, iy = torch.where(lost, last_x, ix), torch.where(lost, last_y, iy)
    return status, share, ix, iy, agreement


def _within(first: Tensor, size: Tensor, place: Tensor) -> Tensor:
    """The pixel at ``place``, clamped to those of a cell."""
    pixel = place.floor().clamp(-1e9, 1e9).long()
    return torch.minimum(torch.maximum(pixel, first), first + size - 1)


def _look(planes: Tensor, rays: _Rays, ix: Tensor, iy: Tensor) -> Tensor:
    """``(4, R)``: plane and back of each ray's pixel."""
    x, y = ix.clamp(0, planes.shape[2] - 1), iy.clamp(0, planes.shape[1] - 1)
    return planes[rays.batch, y, x].double().T


def _intersect(planes, rays, ix, iy, jx, jy, share, leave, qa, qb) -> tuple[Tensor, Tensor, Tensor]:
    """Intersect rays entering pixel i at ``share`` from pixel j with its plane: status, part of the way, agreement."""
    q, gx, gy, back = _look(planes, rays, ix, iy)
    ox, oy = rays.x - ix - 0.5, rays.y - iy - 0.5
    front_a = qa - (q + gx * (ox + share * rays.dx) + gy * (oy + share * rays.dy))
    front_b = qb - (q + gx * (ox + leave * rays.dx) + gy * (oy + leave * rays.dy))
    tolerance = TOLERANCE * q.abs()
    before = front_a >= -tolerance
    crosses = before & (front_b < -tolerance)
    h, hx, hy, _ = _look(planes, rays, jx, jy)
    # adjoining pieces of plane differ by up to a crack, which no ray may pass; a silhouette's step is not a crack
    crack = gx.abs() + gy.abs() + hx.abs() + hy.abs() + rays.pixel(q)
    beside = h + hx * (rays.x + share * rays.dx - jx - 0.5) + hy * (rays.y + share * rays.dy - jy - 0.5)
    joined = ~before & (front_a > -crack) & (qa - front_a - beside < crack)
    falls, leaves = joined & (front_b < front_a), joined & (front_b >= front_a)  # these go over a round body's rim
    blocks = ~before & ~joined & ((qa > back) | (qb > back))
    gap = front_a - front_b
    part = torch.where(crosses, front_a / torch.where(crosses, gap, 1.0), 0.0)
    behind = qa - front_a - back
    near = ((qa - back) / torch.where(blocks, behind, 1.0)).clamp(0.0, 1.0)
    agreement = torch.where(
        crosses, 1.0, torch.where(falls, (2 + 2 * front_a / crack).clamp_max(1.0), torch.where(blocks, near, 0.0))
    )
    passes = torch.where(before | leaves, LEFT, BEHIND)
    return torch.where(crosses | falls, HIT, torch.where(blocks, BLOCKED, passes)), part, agreement


def _continued(planes, rays, ix, iy, share, leave, qa, qb) -> tuple[Tensor, Tensor]:
    """Whether and where, as part of the way, rays cross pixel i's plane continued out of that pixel."""
    q, gx, gy, _ = _look(planes, rays, ix, iy)
    ox, oy = rays.x - ix - 0.5, rays.y - iy - 0.5
    front_a = (qa - (q + gx * (ox + share * rays.dx) + gy * (oy + share * rays.dy))).clamp_min(0.0)
    front_b = qb - (q + gx * (ox + leave * rays.dx) + gy * (oy + leave * rays.dy))
    crosses = front_b < -TOLERANCE * q.abs()
    return crosses, front_a / torch.where(crosses, front_a - front_b, 1.0)


def _same_surface(planes: Tensor, rays: _Rays, ix: Tensor, iy: Tensor, jx: Tensor, jy: Tensor) -> Tensor:
    """Whether pixel j continues the plane of pixel i; beyond the border, reads repeat pixel i."""
    outside = (jx < 0) | (jy < 0) | (jx >= planes.shape[2]) | (jy >= planes.shape[1])
    q, gx, gy, _ = _look(planes, rays, ix, iy)
    expected = q + gx * (jx - ix) + gy * (jy - iy)
    return outside | ((_look(planes, rays, jx, jy)[0] - expected).abs() <= 0.25 * rays.pixel(q))


def _snap(planes: Tensor, rays: _Rays, ix: Tensor, iy: Tensor, x: Tensor, y: Tensor) -> tuple[Tensor, Tensor]:
    """The positions in pixels i nearest to (x, y) where a bilinear read mixes in no other surface."""
    ox, oy = (x - ix - 0.5).clamp(-0.5, 0.5), (y - iy - 0.5).clamp(-0.5, 0.5)
    jx, jy = torch.where(ox > 0, ix + 1, ix - 1), torch.where(oy > 0, iy + 1, iy - 1)
    keep_x, keep_y = _same_surface(planes, rays, ix, iy, jx, iy), _same_surface(planes, rays, ix, iy, ix, jy)
    corner = keep_x & keep_y & ~_same_surface(planes, rays, ix, iy, jx, jy)
    wide = ox.abs() >= oy.abs()
    keep_x, keep_y = keep_x & (~corner | wide), keep_y & (~corner | ~wide)
    return ix + 0.5 + torch.where(keep_x, ox, 0.0), iy + 0.5 + torch.where(keep_y, oy, 0.0)
