"""What mirrors show where their rays leave the picture: the sky, as open as it is there."""

from __future__ import annotations

import boxes
import mirrors
import pytest
import torch
from mirrors import SkyAlone, shiny
from torch import Tensor

from gbufrt import Camera, Frame
from gbufrt.environment import lookup_environment


def of_sky_alone(frame: Frame) -> Tensor:
    return SkyAlone(samples=1)(frame).read("reflection")


def test_sky_fills_what_leaves_the_screen():
    frame = shiny(scene=boxes.ROOM[:1])
    result = SkyAlone(samples=1)(frame)
    g = frame.gbuffer
    assert torch.allclose(result.read("reflection")[g.hit.expand(-1, 3, -1, -1)], torch.tensor(0.5), atol=1e-5)
    assert (result.read("reflection_confidence") == 0).all()
    assert (result.read("reflection_distance")[g.hit] == g.camera.far).all()
    assert (result.read("reflection")[~g.hit.expand(-1, 3, -1, -1)] == 0).all()
    dark = SkyAlone(samples=1)(frame.replace(environment=None))
    assert (dark.read("reflection") == 0).all()


def test_sky_in_the_mirror_is_the_sky_in_that_direction():
    frame = shiny(scene=boxes.ROOM[:1])
    sky = torch.rand(1, 3, 16, 32, generator=torch.Generator().manual_seed(1))
    result = of_sky_alone(frame.replace(environment=sky))
    _, direction = mirrors.reflected(frame)
    expected = lookup_environment(sky, direction) * frame.gbuffer.hit
    assert torch.allclose(result, expected, atol=1e-4)


def test_interiors_do_not_fill_with_sky():
    above = Camera.look_at((0.0, 6.0, 4.0), (0.0, 0.0, 0.0), size=(40, 50), fov_y=40.0, far=100.0)
    frame = shiny(above, scene=boxes.ROOM[:1])
    g = frame.gbuffer
    assert g.hit.all(), "every mirrored ray leaves the picture"
    whole = of_sky_alone(frame)
    closed = frame.replace(sky_visibility=torch.zeros_like(g.depth))
    assert of_sky_alone(closed).abs().max() == 0
    assert of_sky_alone(closed.replace(bent_normal=g.normal)).abs().max() == 0
    half = frame.replace(ao=torch.full_like(g.depth, 0.5))
    assert torch.allclose(of_sky_alone(half), 0.5 * whole)
    ajar = frame.replace(sky_visibility=torch.full_like(g.depth, 0.3))
    _, direction = mirrors.reflected(frame)
    facing = ajar.replace(bent_normal=direction)
    assert torch.allclose(of_sky_alone(facing), whole), "the mirror looks into the opening"
    beside = torch.tensor([0.0, 0.0, 1.0])[None, :, None, None].expand_as(direction)
    assert of_sky_alone(ajar.replace(bent_normal=beside)).max() == 0, "and here past it"
    assert of_sky_alone(boundless(frame)).max() > 0.4, "but a ray known to end in the sky finds it"


def test_the_sky_is_as_open_as_where_a_ray_was_last_seen():
    above = Camera.look_at((0.0, 6.0, 4.0), (0.0, 0.0, 0.0), size=(40, 50), fov_y=40.0, far=100.0)
    frame = shiny(above, scene=boxes.ROOM[:1])
    whole, inner = of_sky_alone(frame), (..., slice(1, -1), slice(1, -1))

    def with_border(visibility: float) -> Tensor:
        edge = torch.full_like(frame.gbuffer.depth, visibility)
        edge[inner] = 0.3
        return of_sky_alone(frame.replace(sky_visibility=edge))[inner]

    assert torch.allclose(with_border(0.8), 0.8 * whole[inner]), "out there it is more open"
    assert torch.allclose(with_border(0.1), 0.3 * whole[inner]), "a ray that leaves over a wall may still see past it"


def boundless(frame: Frame) -> Frame:
    """The floor viewed from its edge, with sky on screen and a sky visibility of zero."""
    level = shiny(boxes.camera((90, 120)), scene=boxes.ROOM[:1])
    return level.replace(sky_visibility=torch.zeros_like(level.gbuffer.depth), environment=frame.environment)


@pytest.mark.parametrize("compiled", [False, True])
@pytest.mark.parametrize("rough", [0.0, 0.5])
def test_metal_alone_under_a_sky_shows_it(rough: float, compiled: bool):
    """It sends no light but what it mirrors, and so no other by which to limit its samples."""
    lit = shiny(boxes.camera((36, 48)), rough=rough, scene=boxes.ROOM[:1])
    dark = lit.replace(radiance=torch.zeros_like(lit.read("radiance")))
    stage = SkyAlone(samples=1, reuse=0 if compiled else 1)  # reuse has no kernel
    shown, same = (stage(frame).read("reflection") for frame in (dark, lit))
    assert float(same.mean()) > 0.1
    torch.testing.assert_close(shown, same)
