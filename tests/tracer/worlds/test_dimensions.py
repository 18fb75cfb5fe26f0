"""Windows over saves of the Nether and the End: no sun, and in the Nether an eye below its roof."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("nbtlib", reason="needs gbufrt[worlds]")

import numpy as np
from traversals import looks_free
from writers.region import chunk, section, write_region

import tracer
from gbufrt.commands.arguments.world import DayOptions
from gbufrt.commands.flights.day import under
from tracer.worlds.regions.landscape import EMBERS, SUN
from tracer.worlds.regions.stream import stream

STATES = ("minecraft:air", "minecraft:netherrack", "minecraft:bedrock", "minecraft:lava", "minecraft:end_stone")
SIDE = 8  # chunks


def _save(folder: Path, blocks_of) -> Path:
    made = {}
    for x, z in np.ndindex(SIDE, SIDE):
        parts = [section("1.18", n, blocks_of(x, 16 * n, z), STATES) for n in range(4)]
        made[x, z] = chunk("1.18", x, z, parts)
    write_region(folder / "region" / "r.0.0.mca", made)
    return folder


def _nether(cx: int, low: int, cz: int) -> np.ndarray:
    """A hall with pillars between a sea of lava and a roof, 64 high."""
    y, z, x = np.indices((16, 16, 16)) + np.array([low, 16 * cz, 16 * cx]).reshape(3, 1, 1, 1)
    floor = 12 + 5 * np.sin(x / 9.0) + 4 * np.cos(z / 7.0)
    rock = (y < floor) | (y > 46 + 4 * np.sin(z / 8.0)) | ((x % 40 < 4) & (z % 36 < 4))
    return np.where((y == 63) | (y == 0), 2, np.where(rock, 1, np.where(y < 10, 3, 0)))


def _end(cx: int, low: int, cz: int) -> np.ndarray:
    y, z, x = np.indices((16, 16, 16)) + np.array([low, 16 * cz, 16 * cx]).reshape(3, 1, 1, 1)
    thick = 20 - np.hypot(x - 64, z - 64) / 4
    return np.where(np.abs(y - 30) < thick, 4, 0)


def test_under_a_roof_the_eye_is_in_a_cavern(tmp_path: Path) -> None:
    flown = stream(_save(tmp_path / "nether", _nether), window=6)
    assert sorted(flown.views) == ["landscape", "panorama"]
    assert (flown.sun, flown.sky) == (None, EMBERS)
    scene = flown.around(flown.views["landscape"].eye(0.0))
    assert scene.haze is not None
    assert scene.haze.end < 6 * 8
    for name, time in (("landscape", 0.0), ("panorama", 9.0), ("panorama", 20.0)):
        assert 8 < flown.views[name].eye(time)[1] < 52
        looks_free(scene, name, time, near=1.0)


def test_over_end_stone_there_is_no_sun_but_a_flight(tmp_path: Path) -> None:
    flown = stream(_save(tmp_path / "end", _end), window=6)
    assert list(flown.views) == ["flight"]
    assert flown.sun is None
    assert flown.sky.picture is not None
    assert float(flown.sky.picture.max()) < 0.1
    haze = flown.around((64.0, 60.0, 64.0)).haze
    assert haze
    assert haze.begin == pytest.approx(0.8 * haze.end), "a small window is not to be all haze"
    granite = stream(_save(tmp_path / "other", lambda *at: np.minimum(_end(*at), 1)), window=6)
    assert (granite.sun, granite.sky.picture) == (SUN, None)


@pytest.mark.parametrize("blocks", [_nether, _end])
@pytest.mark.parametrize("window", [None, 6])
def test_where_there_is_no_day_hours_and_rain_change_nothing(tmp_path: Path, blocks, window: int | None) -> None:
    """The Nether had the haze of a blue sky under its roof, and the End an earthly night."""
    save = _save(tmp_path / "save", blocks)
    scene = tracer.load(save) if window is None else stream(save, window=window)
    for day in (DayOptions(hour=12.0), DayOptions(rain=0.5)):
        with pytest.warns(UserWarning, match="the Nether and the End have no day, and know no (hours|rain)"):
            assert under(scene, day) is scene


def test_land_under_the_sky_has_hours(tmp_path: Path) -> None:
    scene = tracer.load(_save(tmp_path / "other", lambda *at: np.minimum(_end(*at), 1)))
    later = under(scene, DayOptions(hour=21.0))
    assert later.sky.picture is not None
