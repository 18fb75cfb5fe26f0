"""Histories that keep detail: what they take where nothing shows the surface that a pixel shows now."""

from __future__ import annotations

import pytest
import torch

from gbufrt import Camera, GBuffer
from post.history.read import read_sharp

SIZE = (9, 16)


def side(turned: float, footprints: float = 0.0) -> GBuffer:
    """A still picture of pixels that face one way, ``turned`` about the vertical, 10 units away or a little more."""
    camera = Camera.look_at((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), size=SIZE, far=100.0)
    depth, angle = torch.full((1, 1, *SIZE), 10.0), torch.tensor(turned)
    normal = torch.stack([angle.sin(), torch.tensor(0.0), angle.cos()])[None, :, None, None].expand(1, 3, *SIZE)
    still = torch.zeros(1, 2, *SIZE)
    return GBuffer(
        camera=camera,
        depth=depth + footprints / camera.pixels_per_unit(depth),
        hit=depth > 0,
        normal=normal,
        motion=still,
        motion_z=still[:, :1],
        previous_camera=camera,
    )


def state(length: float) -> torch.Tensor:
    return torch.tensor([0.5, length])[None, :, None, None].expand(1, 2, *SIZE).contiguous()


@pytest.mark.parametrize(("footprints", "expected"), [(0.0, 2.0), (1.0, 2.0), (5.0, 0.0)])
def test_a_body_that_shows_another_side_keeps_a_short_history_of_what_lies_as_deep(footprints, expected):
    then, now = side(-0.7), side(0.7, footprints)
    assert bool((read_sharp(now, then, state(8.0)) == 0).all())
    everywhere = torch.ones_like(now.hit)
    light, length = read_sharp(now, then, state(8.0), lenient=everywhere).split(1, dim=1)
    assert torch.allclose(length, torch.tensor(expected))
    assert torch.allclose(light, torch.tensor(0.5 if expected else 0.0))


def test_a_pixel_that_asks_no_less_and_one_that_finds_its_surface_stay_as_they_are():
    then, now = side(-0.7), side(0.7)
    lenient = torch.ones_like(now.hit)
    lenient[..., :8] = False
    length = read_sharp(now, then, state(8.0), lenient=lenient)[:, 1:]
    assert bool((length[..., :8] == 0).all())
    assert bool((length[..., 8:] == 2).all())
    own = read_sharp(then, then, state(8.0), lenient=lenient)[:, 1:]
    assert torch.allclose(own, torch.tensor(8.0))


def test_another_object_lends_nothing():
    then, now = (g.replace(object_id=torch.full((1, 1, *SIZE), i)) for i, g in enumerate((side(-0.7), side(0.7))))
    assert bool((read_sharp(now, then, state(8.0), lenient=torch.ones_like(now.hit)) == 0).all())


def test_gradients_reach_what_was_lent():
    then, now, past = side(-0.7), side(0.7), state(8.0).requires_grad_()
    read_sharp(now, then, past, lenient=torch.ones_like(now.hit))[:, 0].sum().backward()
    assert past.grad is not None
    assert float(past.grad[:, 0].min()) > 0.5


@pytest.mark.parametrize("channel", ["depth", "normal"])
def test_geometry_that_wants_a_gradient_reads_a_history_that_has_none(channel):
    g = side(0.7)
    wanted = getattr(g, channel).clone().requires_grad_()
    read = read_sharp(g.replace(**{channel: wanted}), g, state(8.0))
    assert torch.equal(read, state(8.0))
    (read.sum() + wanted.sum()).backward()  # in float32, where a kernel reads
    assert wanted.grad is not None
    assert bool((wanted.grad == 1).all())
