"""Minecraft worlds larger than memory: scenes of what is round the camera, and a flight over all there is."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import torch

from gbufrt.numeric import check_destination, check_path, check_three
from tracer.formats.minecraft.build import Blocks
from tracer.formats.minecraft.extent import Extent
from tracer.formats.minecraft.save import Box, Selection
from tracer.formats.minecraft.window import Window, reach_of
from tracer.scene.fog import Fog
from tracer.scene.scene import Haze, Scene, Sky, Sun
from tracer.scene.view import View
from tracer.scene.weather import Rain, Waves
from tracer.worlds.regions.height_map import caverns_of
from tracer.worlds.regions.landscape import EMBERS, ENDLESS, ROOFED, SKY, SMOKE, SUN, night
from tracer.worlds.regions.outlooks import best_view, panorama
from tracer.worlds.views import Point, loop

CLEAR = 0.5  # of the window's reach: where haze begins
CLEAR_END = 0.8  # likewise in the End, whose land ends in the same night anyway
SPEED = 10.0  # blocks a second
KNOT = 48.0  # blocks between two points of the flight's curve
MOST_KNOTS = 1024
PROBES = 3  # places between two knots at which the ground's height is asked for
OVER, DOWN = 16.0, 22.0  # the eye over the highest ground near by, and the eye over what it looks to
AHEAD = 0.55  # of the window's reach: how far ahead that is
LEAST = 0.3  # of half the land's extent: the flight's radius, where the window reaches farther than the land


@dataclass(frozen=True, eq=False, kw_only=True)
class Stream:
    """A world of which only a window of chunks round the camera is there; haze hides the window's border.

    Materials have their numbers by the order in which their blocks are met, so that ``material_id`` may differ between
    runs that begin at other places; nothing else does.

    Args:
        path: of a region file or a save folder.
        window: chunks along each side.
        selection: the part of the world beyond which nothing is taken.
        views: where to look from.
        sun: as of a `Scene`.
        sky: as of a `Scene`.
        haze: what hides more than the window's border, if anything does.
        rain: as of a `Scene`.
        waves: likewise.
        fog: as of a `Scene`.
        clear: share of the window's reach from which on haze is seen.
        device: where the voxels lie.
        pack: a resource pack with textures, if any.
    """

    path: Path
    window: int
    selection: Selection = field(default_factory=Selection)
    views: Mapping[str, View] = field(default_factory=dict)
    sun: Sun | None = SUN
    sky: Sky = SKY
    haze: Haze | None = None
    rain: Rain | None = None
    waves: Waves | None = None
    fog: Fog | None = None
    clear: float = CLEAR
    device: Any = "cpu"
    pack: str | PathLike[str] | None = None

    def around(self, eye: Sequence[float]) -> Scene:
        """The scene round a place, in the world's own coordinates: the same one as before where no chunk came or went.

        A scene given out before is no longer right when another one has been.

        Raises:
            TypeError: the place is not three numbers.
            ValueError: they are not finite.
        """
        check_three("eye", eye, "a camera")
        if not all(map(math.isfinite, eye)):
            raise ValueError(f"eye must be finite, in world units, got {tuple(map(float, eye))}")
        return self._scene(self._chunks.at(eye[0], eye[2]))

    @property
    def empty(self) -> bool:
        """Whether there are no chunks anywhere: `stream` refuses that."""
        return False

    def to(self, device: torch.device | str) -> Stream:
        """The same with its voxels on another device."""
        check_destination(device)
        return replace(self, device=device)

    @cached_property
    def _chunks(self) -> Window:
        return Window(self.path, chunks=self.window, selection=self.selection, device=self.device, pack=self.pack)

    @cached_property
    def _scene(self) -> Callable[[Blocks], Scene]:
        reach = reach_of(self.window)
        haze = Haze(begin=self.clear * reach, end=reach).and_also(self.haze)

        def scene(blocks: Blocks) -> Scene:
            return Scene(
                world=blocks.world,
                instances=blocks.instances,
                sun=self.sun,
                sky=self.sky,
                fog=self.fog,
                views=self.views,
                haze=haze,
                rain=self.rain,
                waves=self.waves,
            )

        return lru_cache(maxsize=1)(scene)


def stream(
    path: str | PathLike[str],
    *,
    window: int = 16,
    box: Box | None = None,
    around: tuple[int, int] | None = None,
    chunks: int | None = None,
    pack: str | PathLike[str] | None = None,
) -> Stream:
    """A Minecraft region file or save folder, of which only what is round the camera is ever in memory.

    Args:
        path: of the file or the folder.
        window: chunks along each side of what is round the camera, 4 to 64.
        box: as for `tracer.load`: nothing beyond is taken. By default the whole world is there to be flown over.
        around: likewise.
        chunks: likewise, with ``around``.
        pack: likewise.

    Returns:
        A `Stream` with the view ``flight``, a round over the land at 10 blocks a second; ``stream.around(eye)`` is the
        scene for a camera there. Under a roof of bedrock, as in the Nether, ``landscape`` and ``panorama`` in its
        stead, from within; there, and over land of end stone, the sky is that of `landscape`.

    Raises:
        TypeError: a path, or a number, is none.
        ValueError: the window is out of range, the path holds no chunks, or none in that part, or ``chunks`` is given
            without ``around``.
        FileNotFoundError: there is no such file or folder.
    """
    for name, given in {"path": path, **({} if pack is None else {"pack": pack})}.items():
        check_path(name, given)
    if chunks is not None and around is None:
        raise ValueError("chunks needs around where there is a window; leave it out to fly over all that is there")
    path, part = Path(path), Selection(box=box, around=around, chunks=chunks)
    Window(path, chunks=window, pack=pack)  # its errors now, rather than at the first frame
    extent = Extent.of(path, part).land()
    found = Stream(path=path, window=window, selection=part, pack=pack)
    if extent.topped("bedrock") > ROOFED and (inside := _inside(found, extent)) is not None:
        return replace(found, views=inside, sun=None, sky=EMBERS, haze=SMOKE)
    flown = replace(found, views={"flight": _flight(extent, reach_of(window))})
    end = Sky(picture=night(), dayless=True)
    return replace(flown, sun=None, sky=end, clear=CLEAR_END) if extent.topped("end_stone") > ENDLESS else flown


def _inside(world: Stream, extent: Extent) -> Mapping[str, View] | None:
    """Views from a cavern in the middle of land under a roof, where no way is clear; None where it has none."""
    caverns = caverns_of(world.around((extent.middle[0], 0.0, extent.middle[1])).world)
    if not np.isfinite(caverns.top).any():
        return None
    view = best_view(caverns)
    return {"landscape": view, "panorama": panorama(view)}


def _flight(extent: Extent, reach: float) -> View:
    """A round that keeps as far from the land's end as the window reaches, where the land is large enough."""
    x, z = extent.middle
    across, along = (max(half - reach, LEAST * half) for half in extent.half)
    around = math.pi * (3 * (across + along) - math.sqrt((3 * across + along) * (across + 3 * along)))  # Ramanujan's
    count = min(max(math.ceil(around / KNOT), 8), MOST_KNOTS)

    def place(n: float) -> tuple[float, float]:
        angle = 2 * math.pi * n / count
        return x + across * math.cos(angle), z + along * math.sin(angle)

    ground = np.array([extent.height(*place(n / PROBES)) for n in range(count * PROBES)])
    level = float(np.nanmedian(ground)) if np.isfinite(ground).any() else 64.0
    ground = np.where(np.isnan(ground), level, ground)
    near = range(-PROBES, PROBES + 1)
    tops = np.max([np.roll(ground, n)[::PROBES] for n in near], axis=0) + OVER
    smooth = np.maximum(tops, (np.roll(tops, 1) + tops + np.roll(tops, -1)) / 3)
    ahead = AHEAD * reach * count / max(around, 1.0)
    eyes, targets = list[Point](), list[Point]()
    for n in range(count):
        (ex, ez), (tx, tz), height = place(n), place(n + ahead), float(smooth[n])
        eyes.append((ex, height, ez))
        targets.append((tx, height - DOWN, tz))
    seconds = max(around, KNOT) / SPEED
    return View(
        eye=loop(eyes, seconds),
        target=loop(targets, seconds),
        fov_y=60.0,
        description=f"a round over the land, {seconds:.0f} s",
    )
