"""The truth about the light of the sky: paths of light that are scattered as often as they are."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from gbufrt.atmosphere import Atmosphere

COLUMNS = (256, 512)  # heights, directions: the air on the way to the sun


def sky_truth(
    atmosphere: Atmosphere,
    direction: Sequence[float],
    ways: Tensor,
    *,
    height: float = 0.05,
    first: int = 0,
    bounces: int = 24,
    paths: int = 4096,
    seed: int = 0,
) -> Tensor:
    """Radiance of the sky along rays, by Monte Carlo integration of the same atmosphere as `gbufrt.atmosphere`'s.

    Args:
        atmosphere: the air.
        direction: toward the sun, a point here, of unit irradiance above the air.
        ways: ``(N, 3)`` unit directions, world space, y up.
        height: of the eye above the ground, kilometres, within the air.
        first: bounces that are left out: with 1 the light that is scattered once, which a quadrature knows better.
        bounces: most times that light is scattered or sent back by the ground.
        paths: for each direction and colour.
        seed: another seed, another noise.

    Returns:
        ``(N, 3)`` float32.

    Each ray of a path adds all light that it scatters once more from the sun, marched through a table of how much air
    lies between a place and the sun. Where a path is scattered is drawn by optical depth or by distance, so that paths
    climb above the shadow of the ground.

    Source: Pharr, Jakob and Humphreys, "Physically Based Rendering", 4th ed., 14.1 (the equation of transfer).
    """
    from gbufrt.compute.each import Each
    from tracer.truth.air_kernel import fill
    from tracer.truth.atmosphere_kernel import gather

    air = atmosphere
    toward = torch.tensor(list(direction), dtype=torch.float64)
    numbers = [air.radius, air.thickness, *air.rayleigh, air.rayleigh_height, air.mie, air.mie_absorption]
    numbers += [air.mie_height, air.mie_asymmetry, *air.ozone, air.ozone_height, air.ozone_width, air.ground_albedo]
    numbers += (toward / toward.norm()).tolist()
    out, table = torch.empty(3 * len(ways)), torch.tensor(numbers, dtype=torch.float64)
    columns = torch.empty(*COLUMNS, 3, dtype=torch.float64)
    Each(fill)(COLUMNS[0] * COLUMNS[1], columns, table)
    Each(gather)(len(out), out, ways.double().contiguous(), table, columns, height, first, bounces, paths, seed)
    return out.view(-1, 3)
