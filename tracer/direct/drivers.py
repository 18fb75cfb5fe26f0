"""The compiled direct light of a picture: every pixel samples the sources that matter to it.

`tracer.lights.shadows.arriving` passes over the picture once for each source. Here each pixel lists its sources and
samples them together, so that work grows with what reaches a pixel, not with the number of lamps. Both forms send the
same rays where there are at most `FEW` lamps; where there are more, they draw the faint ones by other weights.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import Any

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt.compute.dispatch import simulated
from gbufrt.compute.kernel import array, replaced, threads
from tracer.direct import reference
from tracer.direct.choice_kernel import EVEN, FEW, GROUPS, MANY, MOST_ALONE, SIDES, TILE
from tracer.direct.choice_reference import RAYS, most_drawn
from tracer.direct.kernel import Sources
from tracer.direct.list_drivers import candidates_each, list_all, list_each, pack_each
from tracer.direct.pixel_kernel import LEVEL
from tracer.direct.ray_drivers import finish_all, finish_each, first_all, first_each
from tracer.direct.sources import tables_of
from tracer.lights.shadows import ALL, MOST, REACH, stages
from tracer.traversal.rays import grid_from_world

BAND = 1 << 17  # pixels whose samples are in memory together, and fewer
WIDER = 8  # times as many on a GPU: an H100 runs 80,000 pixels at once, and waits for the longest of them
LONG = 32  # where their lists may have more entries than that


class Direct(reference.Direct):
    """See `tracer.direct.reference.Direct`."""

    def arriving(self, noise: Tensor, samples: int) -> Tensor:
        """See `tracer.direct.reference.Direct.arriving`."""
        size, lit = self.surface.size, self.surface.share > 0
        arrived = self.surface.points.new_zeros(3, lit.numel())
        if self.scene.sun is not None:
            for start, rows, pixels in self._bands(1):
                offsets = F.pad(lit[start : start + pixels].cumsum(0), (1, 0))
                marked = offsets.new_full((pixels,), (len(self.lamps) << LEVEL) + ALL, dtype=torch.int32)
                none = marked.new_zeros(pixels, 1), arrived.new_zeros(pixels, 1)  # nothing is drawn beside the sun
                self._sample(arrived, noise, samples, start, rows, offsets, marked, none, 1)
        if len(self.lamps):
            known, dice = self._known(arrived), noise[2].flatten()
            for start, rows, pixels in self._bands(max(self._longest(samples), self._room)):
                lists, counts, rest = self.lists(known, dice, start, pixels, samples)
                offsets = F.pad(counts.cumsum(0), (1, 0))
                marked = lists.new_empty(lists.numel() if self._on_gpu else int(offsets[-1]))
                pack_each(pixels, lists, offsets, marked)
                self._sample(arrived, noise, samples, start, rows, offsets, marked, rest, self._widest)
        return arrived.view(3, *size)

    def _bands(self, longest: int) -> Iterator[tuple[int, tuple[int, int], int]]:
        """First pixel of each band, those of its rows that are finished with it, and its number of pixels.

        Lists of its pixels have at most ``longest`` entries.
        """
        height, width = self.surface.size
        band = BAND * WIDER if self._on_gpu else BAND
        tall = max(band * LONG // (max(longest, LONG) * width), 2 * REACH)
        for top in range(0, height, tall):
            first, last = max(top - REACH, 0), min(top + tall + REACH, height)
            yield first * width, (top - first, min(top + tall, height) - first), (last - first) * width

    def lists(self, known: Tensor, dice: Tensor, start: int, pixels: int, samples: int) -> tuple[Tensor, Tensor, Any]:
        """Which lamps matter to ``pixels`` pixels P from ``start`` on.

        Args:
            known: ``(N,)`` as in `tracer.direct.choice_reference`, of the whole picture.
            dice: ``(N,)``, see ``known``.
            start: first pixel.
            pixels: how many.
            samples: most rays to a lamp.

        Returns:
            ``(P, M)`` int32, lists as in `tracer.direct.pixel_kernel`; their lengths ``(P,)`` int64; the numbers
            ``(P, D)`` int32 of lamps drawn from the rest, with the inverse ``(P, D)`` float32 of how often each is.
        """
        width, lamps = self.surface.size[1], len(self.lamps)
        lists = known.new_empty(pixels, self._longest(samples), dtype=torch.int32)
        counts, chosen = known.new_empty(pixels, dtype=torch.int64), lists.new_zeros(pixels, most_drawn(samples))
        out = lists, counts, chosen, known.new_empty(chosen.shape)
        rows = slice(start, start + pixels)
        surface = *(t[rows] for t in (*self._surface, known)), self.groups(known, rows)
        dice = dice[rows]
        if not self._on_gpu:
            given = *replaced((surface, dice), array), width, FEW, MANY, RAYS * samples
            list_all(self._sources, *given, *map(array, out), threads())
            return lists, counts, out[2:]
        count = GROUPS * -(-width // TILE) * -(-(pixels // width) // TILE)
        candidates, numbers = (lists.new_empty(count, lamps) for _ in range(2))
        upto, most, sent = (known.new_empty(count, *n, dtype=torch.float64) for n in ((lamps,), (lamps,), ()))
        tiles = candidates, numbers, upto, most, counts.new_empty(count, 2), sent
        candidates_each(count, self._tables, surface, width, FEW, pixels, *tiles)
        power = upto.new_empty(pixels, lamps)
        given = self._tables, surface, dice, width, MANY, RAYS * samples
        list_each(pixels, *given, tiles, power, *out)
        return lists, counts, out[2:]

    def groups(self, known: Tensor, rows: slice) -> Tensor:
        """``(P,)`` int8: which pixels of a tile are listed apart from the others; -1 where none is lit.

        They face another side, and together they would bound hardly anything; or they know much more light than
        another, as lamps do before a dark wall, and would share no list with it.
        """
        width, lit, normals = self.surface.size[1], self.surface.share[rows] > 0, self.surface.normals[:, rows]
        sizes = normals.abs()
        most = sizes.amax(dim=0)
        axes = torch.arange(0, SIDES, 2, dtype=torch.int8, device=most.device)[:, None]
        side = ((sizes >= most) * axes).amax(dim=0) + (normals.amax(dim=0) >= most)
        dark = torch.where(lit, -known[rows], -torch.inf).view(1, 1, -1, width)
        dark = F.max_pool2d(dark, TILE, ceil_mode=True).repeat_interleave(TILE, 2).repeat_interleave(TILE, 3)
        least = -dark[..., : len(known[rows]) // width, :width].flatten()
        return torch.where(lit, side + SIDES * (known[rows] > EVEN * least), -1).to(torch.int8)

    def _sample(
        self,
        arrived: Tensor,
        noise: Tensor,
        samples: int,
        start: int,
        rows: tuple[int, int],
        offsets: Tensor,
        marked: Tensor,
        rest: tuple[Tensor, Tensor],
        widest: int,
    ) -> None:
        """Add the light of listed and drawn sources of up to ``widest`` rectangles to the pixels of a band."""
        width, counts = self.surface.size[1], (*stages(samples), samples)
        sums = arrived.new_empty(len(marked), MOST + 1)
        more, opened = torch.empty_like(sums), sums.new_zeros(len(marked), dtype=torch.bool)
        given = self._surface, noise[:2].flatten(1), start
        near = offsets, marked, sums, width
        if self._on_gpu:
            each = arrived.new_empty(len(offsets) - 1, widest, dtype=torch.float64)
            lit = self._space, self._tables, each, *given
            first_each(len(each), *lit, offsets, marked, counts, sums, arrived)
            finish_each((rows[1] - rows[0]) * width, *lit, near, counts, rest, rows, more, opened, arrived)
            return
        lit = replaced(self._space, array), self._sources, widest, *replaced(given, array)
        first_all(*lit, *replaced((offsets, marked, counts, sums, arrived), array), threads())
        finish_all(*lit, *replaced((near, counts, rest, rows, more, opened, arrived), array), threads())

    @property
    def _on_gpu(self) -> bool:
        return simulated() or self.surface.points.is_cuda

    def _longest(self, samples: int) -> int:
        """Entries of the longest list of a pixel."""
        return min(len(self.lamps), MOST_ALONE, RAYS * samples)

    @property
    def _widest(self) -> int:
        """Rectangles of the lamp that has most."""
        return self.lamps.edge_u.shape[1]

    @property
    def _room(self) -> int:
        """Further numbers that a pixel has in memory: threads of a GPU share none."""
        return max(len(self.lamps), self._widest) if self._on_gpu else 0

    @cached_property
    def _surface(self) -> tuple[Tensor, ...]:
        surface = self.surface
        return surface.points.T.contiguous(), surface.normals.T.contiguous(), surface.share.contiguous()

    @cached_property
    def _space(self) -> tuple[Tensor, ...]:
        transforms = grid_from_world(self.scene, self.poses, self.poses.device)[0]
        return transforms.contiguous(), *self.scene.grids.tensors

    @cached_property
    def _tables(self) -> tuple[Tensor, ...]:
        return tuple(table.contiguous() for table in tables_of(self.lamps, self.scene.sun))

    @cached_property
    def _sources(self) -> Sources:
        return Sources(*map(array, self._tables))
