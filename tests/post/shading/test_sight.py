"""Sight that ends: by the whole way of the light, and with no sky in mirrors or behind glass."""

from __future__ import annotations

import boxes
import pytest
import torch

from gbufrt import Frame
from gbufrt.directions import length
from post import Composite
from post.shading.sight import clarity

SIZE = (24, 32)


def frame(**light: float) -> Frame:
    """Boxes on a floor under the sky, whose ``light`` is the same in every pixel."""
    made = boxes.frame(boxes.camera(SIZE))
    planes = {name: torch.full((1, 3, *SIZE), value) for name, value in light.items()}
    g = made.gbuffer.replace(emission=None, roughness=None)
    return made.replace(
        gbuffer=g, **{"radiance": torch.zeros(1, 3, *SIZE), "ambient": None, "environment": None} | planes
    )


def way(made: Frame) -> torch.Tensor:
    return length(made.gbuffer.camera.unproject(made.gbuffer.depth))


def seen(made: Frame, sight: float, begin: float = 0.0) -> torch.Tensor:
    return Composite(sight=sight, sight_begin=begin)(made).read("color")


def test_linear_between_begin_and_end():
    found = clarity(torch.tensor([0.0, 2.5, 5.0, 7.5, 10.0, 1e9]), sight=10.0, begin=0.5)
    assert found.tolist() == [1.0, 1.0, 1.0, 0.5, 0.0, 0.0]


def test_surfaces_fade_by_their_distance_from_the_eye_and_the_sky_is_gone():
    made = frame(radiance=1.0, gi=0.5)
    hit, color = made.gbuffer.hit, seen(made, 12.0)
    assert not hit.all()
    assert torch.allclose(color, torch.where(hit, 1.5 * clarity(way(made), 12.0, 0.0), 0.0).expand_as(color))
    assert float(color[hit.expand_as(color)].max()) > 0.3
    assert not seen(made, 1.0).any()


def test_what_is_mirrored_has_a_longer_way_and_its_share_of_sky_is_dark():
    made = frame(reflection=1.0)
    near, far = (made.replace(reflection_distance=torch.full((1, 1, *SIZE), d)) for d in (1.0, 4.0))
    share = torch.full((1, 1, *SIZE), 0.25)
    hit = made.gbuffer.hit
    for mirrors, distance in ((near, 1.0), (far, 4.0)):
        wanted = torch.where(hit, clarity(way(made) + distance, 14.0, 0.0), 0.0).expand(1, 3, *SIZE)
        assert torch.allclose(seen(mirrors, 14.0), wanted)
        assert torch.allclose(seen(mirrors.replace(reflection_confidence=share), 14.0), 0.25 * wanted)
    assert seen(far, 14.0).sum() < 0.8 * seen(near, 14.0).sum()


def test_behind_glass_it_is_the_way_to_what_stands_there():
    made = frame()
    glass = made.replace(gbuffer=made.gbuffer.replace(transmittance=torch.full((1, 3, *SIZE), 0.5)))
    deeper = made.gbuffer.replace(depth=made.gbuffer.depth + 2.0)
    behind = Frame(gbuffer=deeper, radiance=torch.ones(1, 3, *SIZE))
    wanted = torch.where(made.gbuffer.hit, 0.5 * clarity(way(behind), 14.0, 0.0), 0.0).expand(1, 3, *SIZE)
    assert torch.allclose(seen(glass.replace(behind=behind), 14.0), wanted)
    sky = behind.replace(gbuffer=deeper.replace(hit=torch.zeros_like(deeper.hit)))
    assert not seen(glass.replace(behind=sky), 14.0).any(), "no sky leaks through glass"


def test_lamps_fade_too_and_the_inputs_stay():
    made = frame(radiance=1.0)
    lamps = made.replace(gbuffer=made.gbuffer.replace(emission=torch.ones(1, 3, *SIZE)))
    lamps = lamps.replace(reflection=torch.zeros(1, 3, *SIZE))
    result = Composite(sight=1.0)(lamps)
    assert not result.read("color").any()
    assert result.radiance is lamps.radiance
    assert result.gbuffer is lamps.gbuffer, "files keep what was traced"


@pytest.mark.parametrize(
    ("sight", "begin", "what"), [(0.0, 0.0, "sight must"), (-1.0, 0.0, "sight must"), (5.0, 1.0, "begin")]
)
def test_bad_values_are_told(sight: float, begin: float, what: str):
    with pytest.raises(ValueError, match=what):
        seen(frame(radiance=1.0), sight, begin)
