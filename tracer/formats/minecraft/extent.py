"""How far a world goes, from the tables of its region files, and how high its ground is at a place."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from tracer.formats.minecraft.region import SIDE, Place, Region, region_files, region_place
from tracer.formats.minecraft.save import WIDTH, Selection, chunk_sections
from tracer.formats.minecraft.sections import Section
from tracer.formats.minecraft.shapes import is_nothing, parse_state

SAMPLES = 14  # along each side


@dataclass(frozen=True, eq=False, kw_only=True)
class Extent:
    """What there is of a world, or of a part of it.

    Args:
        files: the region files by their place.
        part: that may be taken.
        low: the first chunk along x and z.
        high: the one after the last.
    """

    files: Mapping[Place, Path]
    part: Selection
    low: Place
    high: Place

    @staticmethod
    def of(path: Path, part: Selection) -> Extent:
        """The extent of a region file or save folder.

        Raises:
            ValueError: there are no chunks in that part.
            FileNotFoundError: there is no such file or folder.
        """
        files = {region_place(file): file for file in region_files(path)}
        ends = list[Place]()
        for file in files.values():
            if places := [place for place in Region.of(file).sectors if part.takes(place)]:
                ends += [(min(x for x, _ in places), min(z for _, z in places))]
                ends += [(max(x for x, _ in places) + 1, max(z for _, z in places) + 1)]
        if not ends:
            raise ValueError(f"{path} has no chunks{'' if part == Selection() else ' in that part'}")
        low, high = np.min(ends, axis=0).tolist(), np.max(ends, axis=0).tolist()
        return Extent(files=files, part=part, low=(low[0], low[1]), high=(high[0], high[1]))

    def land(self) -> Extent:
        """The extent of what has blocks, by samples: the game keeps chunks round it that it has only begun to make."""
        places = [
            (x, z)
            for x in np.linspace(self.low[0], self.high[0] - 1, SAMPLES).round().astype(int).tolist()
            for z in np.linspace(self.low[1], self.high[1] - 1, SAMPLES).round().astype(int).tolist()
            if not math.isnan(self.height(WIDTH * x, WIDTH * z))
        ]
        if not places:
            return self
        low, high = np.min(places, axis=0).tolist(), (np.max(places, axis=0) + 1).tolist()
        found = replace(self, low=(low[0], low[1]), high=(high[0], high[1]))
        found._tops.update(self._tops)
        return found

    @property
    def middle(self) -> tuple[float, float]:
        """x and z, blocks."""
        return WIDTH * (self.low[0] + self.high[0]) / 2, WIDTH * (self.low[1] + self.high[1]) / 2

    @property
    def half(self) -> tuple[float, float]:
        """Half the sides along x and z, blocks."""
        return WIDTH * (self.high[0] - self.low[0]) / 2, WIDTH * (self.high[1] - self.low[1]) / 2

    def height(self, x: float, z: float) -> float:
        """Upper side of the highest block of the chunk at a place; nan where there is none that can be read."""
        place = math.floor(x / WIDTH), math.floor(z / WIDTH)
        if place not in self._tops:
            self._tops[place] = self._highest(place)
        return self._tops[place][0]

    def topped(self, name: str) -> float:
        """The share of the chunks whose height was asked for that have a block of that name highest; nan for none."""
        tops = [top for height, top in self._tops.values() if not math.isnan(height)]
        return (
            sum(any(block.rpartition(":")[2] == name for block in top) for top in tops) / len(tops)
            if tops
            else math.nan
        )

    @cached_property
    def _tops(self) -> dict[Place, tuple[float, frozenset[str]]]:
        return {}

    @cached_property
    def _open(self) -> dict[Place, Region]:
        return {}

    def _highest(self, place: Place) -> tuple[float, frozenset[str]]:
        """The upper side of the highest block of a chunk, and the names of the blocks of that layer."""
        none, key = (math.nan, frozenset[str]()), (place[0] // SIDE, place[1] // SIDE)
        if key not in self.files or not self.part.takes(place):
            return none
        if key not in self._open:
            self._open.clear()  # one at a time
            self._open[key] = Region.of(self.files[key])
        region = self._open[key]
        if place not in region.sectors:
            return none
        try:
            parts = chunk_sections(region, place, self.part.box)
        except ValueError:
            return none
        found = [(16 * section.y + top, names) for section, _ in parts for top, names in [_top(section)] if top]
        return max(found, key=lambda layer: layer[0], default=none)


def _top(section: Section) -> tuple[int, frozenset[str]]:
    """How many layers of a section lie up to its highest block, 0 where there is none, and what that layer is of."""
    names = [parse_state(state)[0] for state in section.states]
    solid = np.array([not is_nothing(name) for name in names])
    blocks = np.broadcast_to(section.blocks, 4096).reshape(16, -1)
    layers = solid[blocks].any(axis=1)
    if not layers.any():
        return 0, frozenset()
    last = int(np.flatnonzero(layers)[-1])
    return last + 1, frozenset(names[n] for n in np.unique(blocks[last]) if solid[n])
