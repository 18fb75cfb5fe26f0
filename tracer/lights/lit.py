"""The lights of a scene as kernels take them: flat tables, their columns and rows."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

MIDDLE, FACING, REACH, POWER, CORNER, EDGE_U, EDGE_V, AREA, RADIANCE = 0, 3, 6, 7, 8, 11, 14, 17, 18
"""Columns of `Lit.lamps`."""
ZENITH, HORIZON, GROUND, TOWARD, IRRADIANCE, DISC, GLOW = 0, 1, 2, 3, 4, 5, 6
"""Rows of `Lit.sky`."""
NOTHING = (0.0, 0.0, 0.0)


class Lit(NamedTuple):
    """The lights of a scene.

    Args:
        picture: ``(h, w, 3)`` float32 lat-long radiance of the sky; no rows where the colours below say it.
        sky: ``(6 + G, 3)`` float64: radiance of zenith, horizon and ground; direction to the sun and its irradiance;
            the sine of its angular radius and 1, or 0 where there is none; share and g of each lobe of its glow.
        lamps: ``(R, 21)`` float32; no rows where there is no lamp.
        upto: ``(R,)`` float32 cumulative power of the lamps.
        slots: ``(C, SLOTS)`` int32; see `tracer.lights.lamp_table.LampTable`.
        counts: ``(C, SLOTS)`` int16.
        cells: ``(7,)`` float64: low corner, side and shape of the grid of cells.
        sky_upto: ``(D,)`` float32; see `tracer.lights.sky_table.SkyTable`. No rows where the sky is not sampled.
        sky_density: ``(D,)`` float32.
    """

    picture: np.ndarray
    sky: np.ndarray
    lamps: np.ndarray
    upto: np.ndarray
    slots: np.ndarray
    counts: np.ndarray
    cells: np.ndarray
    sky_upto: np.ndarray
    sky_density: np.ndarray
