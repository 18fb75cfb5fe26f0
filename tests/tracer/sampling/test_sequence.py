"""Points of paths, rotated at each pixel."""

from __future__ import annotations

import torch

from gbufrt.noise.noise import TILE, blue_noise
from tracer.sampling.sequence import BELOW_ONE, Sequence

CPU = torch.device("cpu")


def test_every_pixel_has_the_blue_noise_of_the_picture():
    """Of which one tile is held, however large the picture is."""
    for size in ((5, 7), (40, TILE + 30), (2 * TILE + 9, 11)):
        sequence = Sequence.of(4, 3, size, seed=6, device=CPU)
        want = blue_noise(*size, dims=3, seed=6).flatten(1)
        assert torch.equal(sequence.turns, want)
        assert sequence.rotation.shape[1] <= TILE * TILE
        pixels = torch.arange(2, size[0] * size[1], 3)
        u = sequence.part(range(1, 3)).dims(1).draw(pixels)
        points = sequence.points[1:3, 1:].T[:, :, None]
        assert torch.equal(u, ((points + want[1:, None, pixels]) % 1.0).clamp_max(BELOW_ONE).flatten(1))


def test_frames_of_a_film_share_a_sequence():
    one = Sequence.of(8, 5, (6, 9), seed=1, device=CPU)
    assert Sequence.of(8, 5, (6, 9), seed=1, device=CPU) is one
    other = Sequence.of(8, 5, (6, 9), seed=2, device=CPU)
    assert not torch.equal(other.points, one.points)
    assert not torch.equal(other.rotation, one.rotation)
