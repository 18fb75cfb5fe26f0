"""A camera inside a block is told: its picture puzzles."""

from __future__ import annotations

import warnings

import pytest
from voxels import GLASS, STONE, WATER, world

from gbufrt.commands.flights.inside import tell_inside
from tracer.scene.scene import Scene

SCENE = Scene(
    world=world((8, 4, 8), (STONE, (0, 0, 0), (8, 2, 8)), (WATER, (4, 1, 4), (8, 2, 8)), (GLASS, (0, 2, 0), (1, 3, 1)))
)


def test_an_eye_in_rock_is_told():
    with pytest.warns(UserWarning, match=r"^--eye is inside a block of stone: what is seen are the backs of blocks$"):
        tell_inside(SCENE, (1.5, 0.5, 1.5), "--eye")


@pytest.mark.parametrize("eye", [(1.5, 2.1, 1.5), (5.0, 1.5, 5.0), (0.5, 2.5, 0.5), (-0.5, 0.5, 1.5), (1.5, 90.0, 1.5)])
def test_one_in_air_water_or_glass_is_not(eye: tuple[float, float, float]):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        tell_inside(SCENE, eye, "--eye")
