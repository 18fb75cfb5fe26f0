"""Fog on frames whose fog is known."""

from __future__ import annotations

import boxes
import pytest
import torch

from gbufrt import Frame, Pipeline
from post import Composite, Fog, fog, with_fog

SIZE = (36, 48)


def foggy(noise: float = 0.0, seed: int = 0, size: tuple[int, int] = SIZE) -> Frame:
    """Boxes in fog of one light, with noise in it; the light of every pixel, or of every second."""
    frame = boxes.frame(boxes.camera(SIZE))
    clear = (-0.1 * frame.gbuffer.depth).exp()
    generator = torch.Generator().manual_seed(seed)
    light = torch.tensor([0.6, 0.5, 0.4]).view(1, 3, 1, 1)
    spread = 1 + noise * (2 * torch.rand(1, 1, *size, generator=generator) - 1)
    return frame.replace(fog_light=light * spread, fog_transmittance=clear, index=seed)


@pytest.mark.parametrize("size", [SIZE, (18, 24)])
def test_even_light_has_no_halo(size):
    frame = foggy(size=size)
    found, _ = fog(frame.read("fog_light"), frame.read("fog_transmittance"), frame.gbuffer)
    wanted = torch.tensor([0.6, 0.5, 0.4]).view(1, 3, 1, 1) * (1 - frame.read("fog_transmittance"))
    torch.testing.assert_close(found, wanted.expand_as(found), rtol=1e-4, atol=1e-6)


def test_noise_is_averaged_over_frames():
    pipeline, state, errors = Pipeline(fog=Fog()), None, []
    for seed in range(16):
        frame, state = pipeline(foggy(1.0, seed), state)
        wanted = torch.tensor([0.6, 0.5, 0.4]).view(1, 3, 1, 1) * (1 - frame.read("fog_transmittance"))
        errors.append(float((frame.read("fog") - wanted).square().mean().sqrt() / wanted.mean()))
    assert errors[15] < 0.05
    assert errors[15] < errors[0] / 2


def test_fog_lies_over_the_colour_and_not_over_what_is_gathered_again():
    frame = foggy().replace(fog=torch.full((1, 3, *SIZE), 0.25))
    result = Composite()(frame)
    torch.testing.assert_close(result.read("composite"), Composite()(foggy()).read("composite"))
    wanted = result.read("composite") * frame.read("fog_transmittance") + 0.25
    torch.testing.assert_close(result.read("color"), wanted)


def test_reflections_have_fog_of_their_own():
    frame = foggy()
    along = torch.cat([torch.full((1, 3, *SIZE), 0.5), torch.full((1, 1, *SIZE), 0.25)], dim=1)
    frame = frame.replace(reflection=torch.full((1, 3, *SIZE), 0.8), fog_reflection=along)
    more = Composite()(frame).read("composite") - Composite()(frame.replace(reflection=None)).read("composite")
    bare = Composite()(frame.replace(fog_reflection=None)).read("composite")
    assert not torch.allclose(Composite()(frame).read("composite"), bare)
    assert bool(torch.isfinite(more).all())


def test_light_at_silhouettes_is_that_of_each_pixel():
    frame = foggy()
    edge = frame.gbuffer.hit.clone()
    edge[..., 1:] = edge[..., 1:] & ~edge[..., :-1]  # a line of pixels, of which every second would miss some
    light = torch.where(edge, 8.0, frame.read("fog_light"))
    found, state = None, None
    for _ in range(4):
        found, state = fog(light, frame.read("fog_transmittance"), frame.gbuffer, state)
    assert found is not None
    torch.testing.assert_close(found, light * (1 - frame.read("fog_transmittance")), rtol=0.02, atol=0.01)


def test_light_of_another_size_is_refused():
    frame = foggy()
    with pytest.raises(ValueError, match="every second pixel"):
        fog(frame.read("fog_light")[..., 1:], frame.read("fog_transmittance"), frame.gbuffer)


def test_fog_stands_before_the_composite():
    pipeline = with_fog(Pipeline(composite=Composite()))
    assert list(pipeline.stages) == ["fog", "fog_behind", "composite"]
