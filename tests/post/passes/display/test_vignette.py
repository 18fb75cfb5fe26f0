"""Vignette: bright in the middle, round, and absent at strength 0."""

from __future__ import annotations

import boxes
import pytest
import torch

from post.passes.display.vignette import Vignette, vignette


def test_profile():
    image = torch.ones(1, 3, 51, 101)
    dark = vignette(image, strength=0.5, inner=0.3, outer=1.0)
    assert torch.allclose(dark[..., 25, 50], torch.ones(3)), "the middle is untouched"
    assert float(dark[0, 0, 0, 0]) == pytest.approx(0.5, abs=2e-3)
    half_way = vignette(image, strength=0.5, inner=0.0, outer=2.0)
    assert float(half_way[0, 0, 0, 0]) == pytest.approx(0.75, abs=0.01), "the corner is at distance 1"
    row = dark[0, 0, 25, 50:]
    assert bool((row.diff() <= 0).all())
    assert torch.allclose(dark, dark.flip(-1))
    assert torch.allclose(dark, dark.flip(-2))
    assert float(dark[0, 0, 25, 50 + 20]) == pytest.approx(float(dark[0, 0, 25 + 20, 50])), "round, not stretched"


def test_neutral_and_strongest():
    image = torch.rand(2, 3, 7, 9)
    assert torch.equal(vignette(image, strength=0.0), image)
    assert float(vignette(image, strength=1.0, inner=0.1, outer=0.5)[..., 0, 0].max()) == 0.0
    assert torch.isfinite(vignette(torch.rand(1, 3, 1, 1))).all()


def test_module_equals_function():
    image = torch.rand(1, 3, 12, 16)
    frame = boxes.frame(boxes.camera((12, 16))).replace(image=image)
    assert torch.equal(Vignette(strength=0.6)(frame).read("image"), vignette(image, strength=0.6))


def test_gradients():
    image = torch.rand(1, 1, 4, 5, dtype=torch.float64, requires_grad=True)
    (gradient,) = torch.autograd.grad(vignette(image).sum(), image)
    assert float(gradient.min()) > 0
    assert torch.autograd.gradcheck(vignette, (image,))


def test_bad_input():
    with pytest.raises(ValueError, match="strength"):
        vignette(torch.rand(1, 3, 4, 4), strength=1.5)
    with pytest.raises(ValueError, match="inner and outer"):
        vignette(torch.rand(1, 3, 4, 4), inner=1.0, outer=0.5)
