"""The height of water with waves, at a moment and for a camera."""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from gbufrt.compute.resident import resident
from tracer.scene.weather import Waves
from tracer.weather.noise import Lattice

OCTAVES = ((1, 1.0, math.inf, math.inf), (2, 0.5, 60.0, 68.0), (4, 0.25, 30.0, 34.0))
"""Scale of the frequency, weight, and distances from the camera from which on it fades and is gone."""
WHOLE = 2 * 4 / 7  # of the sum of octaves to twice the amplitude
ALONG = (1.0, 2.0)  # frequency along x and z
TOP = 3  # the face +y of a voxel
DRIFT = 0.75  # of time, through the noise
STEEPEST, USUAL = 1.875, 0.38  # slope of the noise along an axis: the most, and its root mean square


@dataclass(frozen=True, eq=False, kw_only=True)
class Water:
    """The water of a scene at one moment, as one camera has it.

    Args:
        waves: how high and fast.
        lattice: of the noise, at that moment.
        shift: cells by which it has gone on.
        eye: ``(3,)`` of the camera, from which fine waves end.
    """

    waves: Waves
    lattice: Lattice
    shift: float
    eye: Tensor

    @staticmethod
    def of(waves: Waves, time: float, eye: Tensor) -> Water:
        """The water at a time, seconds."""
        shift = time * waves.speed
        return Water(waves=waves, lattice=Lattice.of(shift * DRIFT, eye.device), shift=shift, eye=eye)

    def height(self, places: Tensor) -> Tensor:
        """``(...)`` of the wave over the mean level, at most the amplitude, at x and z ``(..., 2)``."""
        total = torch.zeros_like(places[..., 0])
        for at, weight in self._octaves(places):
            total = total + weight * (self.lattice.value(at[0]) - 0.5)
        return total * (WHOLE * self.waves.amplitude)

    def slopes(self, places: Tensor) -> Tensor:
        """``(..., 2)`` of the wave along x and z."""
        total = torch.zeros_like(places)
        for at, weight in self._octaves(places):
            total = total + weight[..., None] * at[1] * self.lattice.slopes(at[0])
        return total * (WHOLE * self.waves.amplitude)

    def steepest(self, distances: Tensor) -> tuple[Tensor, Tensor]:
        """The most that the slopes along x and z can be at distances from the camera."""
        total = torch.zeros_like(distances)
        for scale, weight, *ends in OCTAVES:
            total = total + scale * weight * _left(distances, *ends)
        most = STEEPEST * WHOLE * self.waves.amplitude * self.waves.frequency * total
        return most * ALONG[0], most * ALONG[1]

    def curvatures(self, places: Tensor, distances: Tensor) -> tuple[Tensor, Tensor]:
        """Slopes along x and z ``(..., 2)`` and their derivatives, by x, both, and z ``(..., 3)``.

        Octaves are as fine as they are at ``distances`` ``(...)`` from the camera.
        """
        slopes, bends = torch.zeros_like(places), torch.zeros(*places.shape[:-1], 3).to(places)
        for at, weight in self._octaves(places, distances):
            slope, bend = self.lattice.curvatures(at[0])
            slopes = slopes + weight[..., None] * at[1] * slope
            bends = bends + weight[..., None] * torch.stack([at[1][0] ** 2, at[1].prod(), at[1][1] ** 2]) * bend
        size = WHOLE * self.waves.amplitude
        return slopes * size, bends * size

    def usual(self, distances: Tensor) -> Tensor:
        """``(...)`` root mean square of the slope along z, the steeper, at distances from the camera."""
        total = torch.zeros_like(distances)
        for scale, weight, *ends in OCTAVES:
            total = total + (scale * weight * _left(distances, *ends)) ** 2
        return total.sqrt() * (USUAL * WHOLE * self.waves.amplitude * self.waves.frequency * ALONG[1])

    def away(self, places: Tensor) -> Tensor:
        """``(...)`` distance from the camera, along the ground."""
        return (places - self.eye[::2].to(places)).square().sum(dim=-1).sqrt()

    def _octaves(self, places: Tensor, distances: Tensor | None = None) -> list[tuple[tuple[Tensor, Tensor], Tensor]]:
        """Of each: coordinates in the lattice and their frequency, and the weight there."""
        distances = self.away(places) if distances is None else distances
        found = []
        for scale, weight, *ends in OCTAVES:
            often = resident(ALONG, places) * (self.waves.frequency * scale)
            found.append(((places * often + self.shift, often), weight * _left(distances, *ends)))
        return found


def _left(distances: Tensor, begin: float, end: float) -> Tensor:
    """The share of an octave that is left; around its mean, so that the level of far water is the same."""
    if math.isinf(end):
        return torch.ones_like(distances)
    t = ((distances - begin) / (end - begin)).clamp(0.0, 1.0)
    return 1 - t * t * (3 - 2 * t)
