"""The compiled direct light of a picture: every pixel samples the sources that matter to it.

`tracer.lights.shadows.arriving` passes over the picture once for each source. Here each pixel lists its sources and
samples them together, so that work grows with what reaches a pixel, not with the number of lamps. Both forms send the
same rays where there are at most `FEW` lamps; where there are more, they draw the faint ones by other weights.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import Any

import numpy as np
import torch
from numba import prange
from torch import Tensor

from gbufrt.compute.kernel import array, driver, scalar, threads
from tracer.direct import reference
from tracer.direct.choice_kernel import FEW, MOST_ALONE, TILE, draw_rest, extent, find_candidates, list_lamps
from tracer.direct.kernel import Sources
from tracer.direct.pixel_kernel import LEVEL, first_rays, light_of_pixel
from tracer.direct.reference import DRAWS
from tracer.lights.emitters import Lamps
from tracer.lights.shadows import AGREE, ALL, MOST, REACH, stages
from tracer.scene.scene import Sun
from tracer.traversal.kernel import triple
from tracer.traversal.rays import grid_from_world

CHUNK = 64  # pixels handed out at a time
BAND = 1 << 17  # pixels whose samples are in memory together, and fewer
MANY = 8  # rectangles of a lamp from which on they are summed by where they face
ALIKE = 1e-6  # part of the sum of their areas by which facings that count as one may differ
LONG = 32  # where their lists may have more entries than that


@scalar
def _list_tile(
    sources, surface, known, dice, start, width, few, lists, counts, chosen, scale, tile, candidates, others, power
):
    points, normals, seen = surface
    i, clearest, low, high = extent(surface, start, width, tile)
    found, count, sent = 0, 0, 0.0
    if i >= 0:
        given = triple(points, i, 0), triple(normals, i, 0), known[i], clearest, low, high, candidates, others
        found, count, sent = find_candidates(sources, few, *given)
    used = candidates[:found]
    for row in range(tile[0], tile[1]):
        for p in range(row * width + tile[2], row * width + tile[3]):
            i = start + p
            counts[p], scale[p, :] = 0, np.float32(0)
            if seen[i] > 0:
                given = triple(points, i, 0), triple(normals, i, 0), known[i], seen[i], sent, power, lists[p]
                counts[p], rest, draws = list_lamps(sources, used, *given)
                draw_rest(used, power, rest, others, count, dice[i], draws, chosen[p], scale[p])


@driver
def list_all(sources, surface, known, dice, start, width, few, lists, counts, chosen, scale, lanes):
    lamps, height = len(sources.lamps), len(counts) // width
    across = (width + TILE - 1) // TILE
    for lane in prange(lanes):
        candidates, numbers = np.empty(lamps, np.int32), np.empty(lamps, np.int32)
        power, upto = np.empty(lamps), np.empty(lamps)
        for n in range(lane, across * ((height + TILE - 1) // TILE), lanes):
            y, x = n // across * TILE, n % across * TILE
            tile, others = (y, min(y + TILE, height), x, min(x + TILE, width)), (numbers, upto)
            given = sources, surface, known, dice, start, width, few, lists, counts, chosen, scale
            _list_tile(*given, tile, candidates, others, power)


@scalar
def _first_of(begin, end, space, sources, surface, turned, start, offsets, marked, counts, each, blockers, sums):
    points, normals, _ = surface
    for p in range(begin, end):
        i = start + p
        point, normal = triple(points, i, 0), triple(normals, i, 0)
        turn = (turned[0, i], turned[1, i])
        for k in range(offsets[p], offsets[p + 1]):
            first_rays(space, sources, marked[k] >> LEVEL, point, normal, turn, counts, each, blockers, sums[k])


@driver
def first_all(space, sources, widest, surface, turned, start, offsets, marked, counts, sums, lanes):
    pixels = len(offsets) - 1
    for lane in prange(lanes):
        each, blockers = np.empty(widest), np.full((len(sources.lamps) + 1, 4), -1, np.int32)
        for begin in range(lane * CHUNK, pixels, lanes * CHUNK):
            given = space, sources, surface, turned, start, offsets, marked, counts, each, blockers, sums
            _first_of(begin, min(begin + CHUNK, pixels), *given)


@scalar
def _finish(begin, end, space, sources, surface, turned, start, near, rest, counts, each, blockers, found, out):
    points, normals, seen = surface
    offsets, (chosen, scale) = near[0], rest
    for p in range(begin, end):
        i = start + p
        if offsets[p + 1] > offsets[p] or scale[p, 0] > 0:
            place = triple(points, i, 0), triple(normals, i, 0), (turned[0, i], turned[1, i])
            agree, one = AGREE / max(seen[i], 1e-6), (chosen[p], scale[p])
            light = light_of_pixel(space, sources, near, place, p, agree, one, counts, each, blockers, found)
            for c in range(3):
                out[c, i] += np.float32(light[c])


@driver
def finish_all(
    space, sources, widest, surface, turned, start, offsets, marked, counts, sums, rest, rows, width, out, lanes
):
    last = rows[1] * width
    for lane in prange(lanes):
        each, blockers = np.empty(widest), np.full((len(sources.lamps) + 1, 4), -1, np.int32)
        found = np.empty(sums.shape[1], np.float32)
        for begin in range(rows[0] * width + lane * CHUNK, last, lanes * CHUNK):
            near = offsets, marked, sums, width
            given = space, sources, surface, turned, start, near, rest, counts, each, blockers, found, out
            _finish(begin, min(begin + CHUNK, last), *given)


class Direct(reference.Direct):
    """See `tracer.direct.reference.Direct`."""

    def arriving(self, noise: Tensor, samples: int) -> Tensor:
        """See `tracer.direct.reference.Direct.arriving`."""
        size, lit = self.surface.size, self.surface.share > 0
        arrived = torch.zeros(3, lit.numel())
        if self.scene.sun is not None:
            for start, rows, pixels in self._bands(1):
                alone = lit[start : start + pixels].int()
                offsets = np.concatenate([[0], array(alone.cumsum(0))])
                marked = np.full(offsets[-1], (len(self.lamps) << LEVEL) + ALL, np.int32)
                none = np.zeros((pixels, DRAWS), np.int32), np.zeros((pixels, DRAWS), np.float32)
                self._sample(arrived, noise, samples, start, rows, offsets, marked, none)
        if len(self.lamps):
            known, dice = self._known(arrived), noise[2].flatten()
            for start, rows, pixels in self._bands(self._longest):
                lists, counts, rest = self.lists(known, dice, start, pixels)
                offsets = np.concatenate([[0], counts.cumsum()])
                marked = lists[np.arange(lists.shape[1]) < counts[:, None]]
                self._sample(arrived, noise, samples, start, rows, offsets, marked, rest)
        return arrived.view(3, *size)

    def _bands(self, longest: int) -> Iterator[tuple[int, tuple[int, int], int]]:
        """First pixel of each band, those of its rows that are finished with it, and its number of pixels.

        Lists of its pixels have at most ``longest`` entries.
        """
        height, width = self.surface.size
        tall = max(BAND * LONG // (max(longest, LONG) * width), 2 * REACH)
        for top in range(0, height, tall):
            first, last = max(top - REACH, 0), min(top + tall + REACH, height)
            yield first * width, (top - first, min(top + tall, height) - first), (last - first) * width

    def lists(self, known: Tensor, dice: Tensor, start: int, pixels: int) -> tuple[np.ndarray, np.ndarray, Any]:
        """Which lamps matter to ``pixels`` pixels P from ``start`` on; ``known`` and ``dice`` as in `choices`.

        Returns:
            ``(P, M)`` int32, lists as in `tracer.direct.pixel_kernel`; their lengths ``(P,)`` int64; the numbers
            ``(P, D)`` int32 of lamps drawn from the rest, with the inverse ``(P, D)`` float32 of how often each is.
        """
        lists = np.empty((pixels, self._longest), np.int32)
        counts, chosen = np.empty(pixels, np.int64), np.zeros((pixels, DRAWS), np.int32)
        scale = np.empty(chosen.shape, np.float32)
        given = array(known), array(dice), start, self.surface.size[1], FEW
        list_all(self._sources, self._surface, *given, lists, counts, chosen, scale, threads())
        return lists, counts, (chosen, scale)

    @property
    def _longest(self) -> int:
        """Entries of the longest list of a pixel."""
        return min(len(self.lamps), MOST_ALONE)

    def _sample(
        self,
        arrived: Tensor,
        noise: Tensor,
        samples: int,
        start: int,
        rows: tuple[int, int],
        offsets: np.ndarray,
        marked: np.ndarray,
        rest: tuple[np.ndarray, np.ndarray],
    ) -> None:
        sums = np.empty((len(marked), MOST + 1), np.float32)
        turned, counts = array(noise[:2].flatten(1)), (*stages(samples), samples)
        widest = int(np.diff(self._sources.first).max(initial=0))
        given = self._space, self._sources, widest, self._surface, turned, start, offsets, marked, counts, sums
        first_all(*given, threads())
        finish_all(*given, rest, rows, self.surface.size[1], array(arrived), threads())

    @cached_property
    def _surface(self) -> tuple[np.ndarray, ...]:
        surface = self.surface
        return array(surface.points.T), array(surface.normals.T), array(surface.share)

    @cached_property
    def _space(self) -> tuple[np.ndarray, ...]:
        transforms = grid_from_world(self.scene, self.poses, self.poses.device)[0]
        return array(transforms), *(array(grid) for grid in self.scene.grids.tensors)

    @cached_property
    def _sources(self) -> Sources:
        return sources_of(self.lamps, self.scene.sun)


def sources_of(lamps: Lamps, sun: Sun | None) -> Sources:
    """Lamps and sun as `tracer.direct.kernel` reads them."""
    used = lamps.edge_u.abs().sum(dim=2) > 0
    corner, edge_u, edge_v = (t[used].double() for t in (lamps.corner, lamps.edge_u, lamps.edge_v))
    facing = torch.linalg.cross(edge_u, edge_v)
    offset = (facing * corner).sum(dim=1, keepdim=True)
    first = torch.cat([torch.zeros(1, dtype=torch.long), used.sum(dim=1).cumsum(0)])
    ball = torch.cat([lamps.center, lamps.radius[:, None], lamps.radiance.mean(dim=1, keepdim=True)], dim=1)
    sine, basis = (0.0, torch.eye(3)) if sun is None else reference.sun_frame(sun)
    color = torch.zeros(1, 3) if sun is None else torch.tensor([sun.irradiance])
    return Sources(
        rectangles=array(torch.cat([corner, edge_u, edge_v, facing, offset], dim=1)),
        first=array(first),
        sides=array(_sides(used, facing, offset)),
        lamps=array(ball.double()),
        sun=array(torch.cat([basis.T, torch.full((1, 3), sine)]).double()),
        colors=array(torch.cat([lamps.radiance, color])),
    )


def _sides(used: Tensor, facing: Tensor, offset: Tensor) -> Tensor:
    """`Sources.sides` of lamps with rectangles where ``used`` ``(L, K)`` is set; see `Sources` for the other two."""
    lamp, area = used.nonzero()[:, 0], facing.norm(dim=1, keepdim=True)
    axis = facing.abs().argmax(dim=1)
    up = facing.gather(1, axis[:, None])[:, 0] > 0
    sums = facing.new_zeros(6 * len(used), 5)
    sums.index_add_(0, 6 * lamp + 2 * axis + up, torch.cat([facing, offset, area], dim=1))
    unlike = sums[:, 4] - sums[:, :3].norm(dim=1) > ALIKE * sums[:, 4]
    sides = sums.view(-1, 6, 5)
    alone = unlike.view(-1, 6).any(dim=1) | (used.sum(dim=1) < MANY)
    sides[alone, 0, 4] = -1.0
    return sides
