"""Lamps in frames that do not tell emission: they keep their light, and do not shine into what lies around."""

from __future__ import annotations

import pytest
import torch
from torch import Tensor

from gbufrt import Camera, GBuffer
from post import denoise
from post.passes.denoising.lamps import light_of_lamps

SIZE, LAMP = (48, 64), (slice(None), slice(None), slice(20, 28), slice(24, 40))


def ceiling() -> GBuffer:
    """A white plane that fills the picture."""
    camera = Camera.look_at((0.0, 0.0, 5.0), (0.0, 0.0, 0.0), size=SIZE, fov_y=50.0)
    normal = torch.tensor([0.0, 0.0, 1.0])[None, :, None, None].expand(1, 3, *SIZE).contiguous()
    hit = torch.ones(1, 1, *SIZE, dtype=torch.bool)
    return GBuffer(camera=camera, depth=torch.full((1, 1, *SIZE), 5.0), normal=normal, hit=hit)


def noisy(seed: int = 0) -> Tensor:
    """Grey light of a mean of 0.3, three of five samples black."""
    return 0.75 * penumbra(0.4, seed)


def penumbra(lit: float, seed: int = 0) -> Tensor:
    """One sample a pixel of a small light that shines on so many of them."""
    draw = torch.Generator().manual_seed(seed)
    return (torch.rand((1, 1, *SIZE), generator=draw) < lit).float().expand(1, 3, *SIZE).clone()


def test_a_lamp_in_a_ceiling_has_no_halo():
    light = noisy()
    light[LAMP] = 20.0
    found, _ = denoise(light, ceiling())
    torch.testing.assert_close(found[LAMP], light[LAMP], rtol=0.02, atol=0)  # what it reflects, 1.5 % of it, is a guess
    ring = torch.zeros(SIZE, dtype=torch.bool)
    ring[16:32, 20:44], ring[20:28, 24:40] = True, False
    assert 0.15 < float(found[..., ring].mean()) < 0.45
    assert float(found[..., ring].max()) < 1.0


def test_the_rim_of_a_lamp_is_its_own():
    light = noisy()
    light[LAMP] = 20.0
    light[..., 19, 24:40] = 9.0  # half covered
    one = torch.ones_like(light)
    own = light_of_lamps(light, one, one[:, :1] > 0)
    assert float(own[..., 19, 24:40].min()) > 8
    others = own.clone()
    others[..., 19:28, 24:40] = 0
    assert bool((others == 0).all())


@pytest.mark.parametrize("level", [0.0, 0.4])
def test_noise_and_even_light_are_no_lamps(level: float):
    one = torch.ones(1, 3, *SIZE)
    for lit in (0.1, 0.3, 0.5, 0.7, 0.9):
        some = penumbra(lit)
        some[..., 40:] = 0  # most is dark
        assert bool((light_of_lamps(8 * some + level, one, one[:, :1] > 0) == 0).all()), lit
    assert bool((light_of_lamps(0 * one + level, one, one[:, :1] > 0) == 0).all())


def test_lamps_of_black_albedo_are_found_however_ragged_or_small():
    """One sample a pixel leaves pixels of a lamp alone at its border; a lamp may be as small as they are."""
    draw = torch.Generator().manual_seed(3)
    lamp = torch.rand((1, 1, *SIZE), generator=draw) < 0.1
    albedo = torch.where(lamp, 0.0, 0.8).expand(1, 3, *SIZE)
    light = torch.where(lamp, 20.0, noisy())
    own = light_of_lamps(light, albedo.clamp_min(0.01), torch.ones_like(lamp), albedo)
    torch.testing.assert_close(own, torch.where(lamp, 20.0, 0.0).expand_as(own), rtol=0.02, atol=0)
    white = torch.full_like(albedo, 0.8)
    assert bool((light_of_lamps(light, white, torch.ones_like(lamp), white) == 0).all())


def test_noise_on_black_stone_is_no_lamp():
    black = torch.zeros(1, 3, *SIZE)
    some = noisy() * 0.01
    some[..., 20:28, 24:40] = 20 * penumbra(0.5)[..., 20:28, 24:40]  # what it mirrors of a lamp
    assert bool((light_of_lamps(some, black + 0.04, black[:, :1] == 0, black) == 0).all())


def test_the_same_light_as_a_lamp_s_is_its_own_beside_it():
    light = noisy()
    light[LAMP] = 20.0
    light[..., 24, 42] = 20.0  # a sample alone, three pixels away
    one = torch.ones_like(light)
    own = light_of_lamps(light, one, one[:, :1] > 0)
    assert float(own[..., 24, 42].min()) > 19
