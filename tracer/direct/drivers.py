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
from tracer.direct.near_kernel import gather, importances, new_near
from tracer.direct.pixel_kernel import LEVEL
from tracer.direct.ray_drivers import finish_all, first_all
from tracer.direct.reference import DRAWS
from tracer.direct.sources import sources_of
from tracer.lights.shadows import ALL, MOST, REACH, stages
from tracer.traversal.kernel import triple
from tracer.traversal.rays import grid_from_world

BAND = 1 << 17  # pixels whose samples are in memory together, and fewer
LONG = 32  # where their lists may have more entries than that


@scalar
def _list_tile(
    sources, surface, known, dice, start, width, few, lists, counts, chosen, scale, tile, candidates, others, scratch
):
    points, normals, seen = surface
    power, near = scratch
    i, clearest, low, high = extent(surface, start, width, tile)
    found, count, sent = 0, 0, 0.0
    if i >= 0:
        given = triple(points, i, 0), triple(normals, i, 0), known[i], clearest, low, high, candidates, others
        found, count, sent = find_candidates(sources, few, *given)
    used, power = candidates[:found], power[:found]
    gather(near, sources, used, low, high)
    for row in range(tile[0], tile[1]):
        for p in range(row * width + tile[2], row * width + tile[3]):
            i = start + p
            counts[p], scale[p, :] = 0, np.float32(0)
            if seen[i] > 0:
                importances(near, triple(points, i, 0), triple(normals, i, 0), power)
                counts[p], rest, draws = list_lamps(used, known[i], seen[i], sent, power, lists[p])
                draw_rest(used, power, rest, others, count, dice[i], draws, chosen[p], scale[p])


@driver
def list_all(sources, surface, known, dice, start, width, few, lists, counts, chosen, scale, lanes):
    lamps, height = len(sources.lamps), len(counts) // width
    across = (width + TILE - 1) // TILE
    for lane in prange(lanes):
        candidates, numbers = np.empty(lamps, np.int32), np.empty(lamps, np.int32)
        power, upto, near = np.empty(lamps), np.empty(lamps), new_near(sources)
        for n in range(lane, across * ((height + TILE - 1) // TILE), lanes):
            y, x = n // across * TILE, n % across * TILE
            tile, others = (y, min(y + TILE, height), x, min(x + TILE, width)), (numbers, upto)
            given = sources, surface, known, dice, start, width, few, lists, counts, chosen, scale
            _list_tile(*given, tile, candidates, others, (power, near))


@driver
def pack_all(lists, offsets, marked, lanes):
    for lane in prange(lanes):
        for p in range(lane, len(lists), lanes):
            for k in range(offsets[p], offsets[p + 1]):
                marked[k] = lists[p, k - offsets[p]]


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
                marked = np.empty(offsets[-1], np.int32)
                pack_all(lists, offsets, marked, threads())
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
        more, opened, out = np.empty_like(sums), np.zeros(len(marked), np.bool_), array(arrived)
        turned, counts = array(noise[:2].flatten(1)), (*stages(samples), samples)
        widest = int(np.diff(self._sources.first).max(initial=0))
        given = self._space, self._sources, widest, self._surface, turned, start, offsets, marked, counts, sums
        first_all(*given, out, threads())
        near = offsets, marked, sums, self.surface.size[1]
        finish_all(*given[:6], near, counts, rest, rows, more, opened, out, threads())

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
