"""Noise is blue in space, even in time, and depends on nothing but pixel, index and seed."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from gbufrt.noise.noise import SLICES, blue_noise, halton_jitter, hilbert_r2, pixel_hash, radical_inverse
from gbufrt.noise.void_and_cluster import void_and_cluster


def low_frequency_share(plane: np.ndarray, radius: float) -> float:
    """Mean power below ``radius`` (as a share of Nyquist) over the mean power of all; 1 for white noise."""
    power = np.abs(np.fft.fft2(plane - plane.mean())) ** 2
    fy = np.fft.fftfreq(plane.shape[0])[:, None]
    fx = np.fft.fftfreq(plane.shape[1])[None, :]
    low = (np.hypot(fy, fx) < radius / 2) & (np.hypot(fy, fx) > 0)
    return float(power[low].mean() / power.mean())


@pytest.mark.parametrize(("index", "bound"), [(0, 0.02), (1, 0.08), (77, 0.08)])
def test_spectrum_is_blue_in_every_slice(index, bound):
    """Rotation wraps the largest values to the smallest, which costs a little of the tile's own spectrum."""
    plane = blue_noise(256, 256, index=index)[0].numpy()
    assert low_frequency_share(plane, 0.3) < bound
    assert low_frequency_share(pixel_hash(256, 256, index=index)[0].numpy(), 0.3) > 0.8


def test_spectrum_has_no_preferred_direction():
    plane = blue_noise(256, 256)[0].numpy()
    power = np.abs(np.fft.fft2(plane - plane.mean())) ** 2
    fy, fx = np.fft.fftfreq(256)[:, None], np.fft.fftfreq(256)[None, :]
    ring = (np.hypot(fy, fx) > 0.35) & (np.hypot(fy, fx) < 0.5)
    angle = np.arctan2(fy, fx) % np.pi
    sectors = [power[ring & (angle >= a) & (angle < a + np.pi / 8)].mean() for a in np.arange(8) * np.pi / 8]
    assert max(sectors) / min(sectors) < 1.25


def test_every_value_is_equally_frequent():
    counts = torch.histc(blue_noise(256, 256, index=3)[0], bins=64, min=0, max=1)
    assert counts.min() == counts.max() == 1024


def test_thresholds_are_blue_too():
    mask = (blue_noise(256, 256)[0] < 0.1).numpy().astype(float)
    assert low_frequency_share(mask, 0.15) < 0.05


def test_a_pixel_is_even_over_time():
    series = torch.stack([blue_noise(1, 1, index=i)[0, 0, 0] for i in range(32)]).sort().values
    gaps = torch.diff(series)
    assert gaps.max() < 2.7 / 32, "golden-ratio rotation leaves no large gap"
    assert torch.equal(blue_noise(8, 8, index=5), blue_noise(8, 8, index=5 + SLICES))


@pytest.mark.parametrize("noise", [blue_noise, hilbert_r2, pixel_hash])
def test_range_repeatability_and_seeds(noise):
    a, b = noise(73, 127, index=2, seed=1), noise(73, 127, index=2, seed=1)
    assert torch.equal(a, b)
    assert torch.equal(a, noise(73, 127, index=torch.tensor(2), seed=1))
    assert a.dtype == torch.float32
    assert a.min() >= 0
    assert a.max() < 1
    assert not torch.equal(a, noise(73, 127, index=3, seed=1))
    assert not torch.equal(a, noise(73, 127, index=2, seed=2))


@pytest.mark.parametrize("noise", [blue_noise, pixel_hash])
def test_dimensions_are_independent(noise):
    planes = noise(128, 128, dims=4).flatten(1)
    correlation = torch.corrcoef(planes) - torch.eye(4)
    assert correlation.abs().max() < 0.03


def test_hilbert_r2_is_even_over_a_small_block():
    block = hilbert_r2(8, 8)[0].flatten().sort().values
    assert torch.diff(block).max() < 0.05


def test_void_and_cluster_makes_blue_permutations():
    ranks = void_and_cluster(32, seed=1)
    assert sorted(ranks.ravel().tolist()) == list(range(1024))
    assert low_frequency_share(ranks.astype(float), 0.25) < 0.05
    assert not np.array_equal(ranks, void_and_cluster(32, seed=2))


def test_radical_inverse_and_jitter():
    assert [radical_inverse(2, i) for i in range(4)] == [0.0, 0.5, 0.25, 0.75]
    jitters = torch.tensor([halton_jitter(i) for i in range(16)])
    assert jitters.abs().max() <= 0.5
    assert jitters.mean(0).abs().max() < 0.06
    assert halton_jitter(3) == halton_jitter(19)
