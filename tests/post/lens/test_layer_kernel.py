"""The compiled layers of like blur against their torch reference."""

from __future__ import annotations

import boxes
import pytest
import torch
from torch import Tensor

from post.lens.op import layer_radii, layers_cpu, spread_layers
from post.lens.thin_lens import circle_of_confusion
from post.passes.lens.depth_of_field import depth_of_field

STEP = 0.12
CASES = {
    "near": {"focus": 20.0, "aperture": 0.5},
    "far": {"focus": 4.0, "aperture": 0.5},
    "both": {"focus": 9.0, "aperture": 1.0},
    "orthographic": {"focus": 9.0, "aperture": 1.5, "orthographic": True},
    "sky": {"focus": 9.0, "aperture": 0.3, "sky": True},
}


def scene(
    size: tuple[int, int] = (127, 73), *, focus: float, aperture: float, orthographic: bool = False, sky: bool = False
) -> tuple[Tensor, Tensor]:
    """Colour with texture and a few very bright pixels, and the radius of each pixel's disc."""
    world = boxes.ROOM + 500 if sky else torch.cat([boxes.ROOM, torch.tensor([[[1.2, 2.2, 4.5], [1.9, 3.4, 4.9]]])])
    frame = boxes.frame(boxes.camera(size, orthographic=orthographic), boxes=world)
    g = frame.gbuffer
    color = torch.rand((1, 3, *size), generator=torch.Generator().manual_seed(1)) + 0.05
    color[..., ::19, ::23] = 500.0
    lens = {"focus_distance": focus, "aperture_radius": aperture}
    return color, circle_of_confusion(g.depth, g.camera, hit=g.hit, **lens).clamp(-32, 32)


def relative(got: Tensor, want: Tensor) -> float:
    return float(((got - want).abs() / (want.abs() + 1e-3)).max())


def forms(color: Tensor, coc: Tensor) -> tuple[Tensor, Tensor]:
    """The compiled form, and the reference in double precision: Fourier transforms lose digits beside bright pixels."""
    radii = layer_radii(float(coc.abs().max()), STEP)
    return spread_layers(color, coc, radii, compiled=True), spread_layers(color.double(), coc.double(), radii).float()


@pytest.mark.parametrize("case", CASES)
def test_forms_agree(case: str) -> None:
    color, coc = scene(**CASES[case])
    got, want = forms(color, coc)
    assert relative(got, want) < 1e-4
    assert float((want - color).abs().mean()) > 0.1
    assert float(coc.min()) < -2 or case in ("far", "sky")
    assert float(coc.max()) > 2 or case == "near"


@pytest.mark.parametrize("size", [(1, 1), (1, 9), (9, 1), (5, 7), (64, 65), (192, 5)])
@pytest.mark.parametrize("radius", [0.3, 6.0, 20.0])
def test_any_size_and_discs_larger_than_the_picture(size: tuple[int, int], radius: float) -> None:
    color = torch.rand((1, 2, *size), generator=torch.Generator().manual_seed(2))
    coc = (torch.rand((1, 1, *size), generator=torch.Generator().manual_seed(3)) * 2 - 1) * radius
    got, want = forms(color, coc)
    assert relative(got, want) < 1e-4


@pytest.mark.parametrize("radius", [layer_radii(32.0, STEP)[i] for i in (1, 2, 5, 12, 20)])
def test_a_layer_is_its_disc(radius: float) -> None:
    """One lamp in one layer, which its coverage does not hide: everything else is black and at the same distance."""
    color = torch.zeros(1, 1, 97, 90)
    color[..., 41, 50] = 1.0
    y, x = torch.meshgrid(torch.arange(97) - 41.0, torch.arange(90) - 50.0, indexing="ij")
    disc = (radius + 0.5 - torch.hypot(x, y)).clamp(0, 1)
    for sign in (1.0, -1.0):
        got = spread_layers(color, torch.full_like(color, sign * radius), layer_radii(radius, STEP), compiled=True)
        torch.testing.assert_close(got[0, 0], disc / disc.sum(), rtol=1e-5, atol=1e-7)


def test_dim_pixels_keep_their_digits_beside_a_lamp() -> None:
    """A lamp a thousand million times brighter; what is left is the rounding of its share in its two layers."""
    color, coc = scene(**CASES["far"])
    dim = color.clamp_max(1.0) * 1e-3
    dim[..., 60, 36] = 1e6
    got, want = forms(dim, coc)
    assert relative(got, want) < 5e-4


def test_batch_equals_loop() -> None:
    """Elements of like radii, because the reference pads all for the largest disc, and weighs fills by that mean."""
    color, coc = scene(**CASES["near"])
    scenes = [(color, coc), (color.flip(-1) * 0.5, coc.flip(-1))]
    color, coc = (torch.cat(parts) for parts in zip(*scenes, strict=True))
    radii = layer_radii(float(coc.abs().max()), STEP)
    together = spread_layers(color, coc, radii, compiled=True)
    for i, inputs in enumerate(scenes):
        assert torch.equal(together[i : i + 1], spread_layers(*inputs, radii, compiled=True))
    coc[1] *= 0.2
    assert relative(*forms(color, coc)) < 1e-4


def test_threads_and_layout_do_not_matter() -> None:
    (color, coc), count = scene(**CASES["both"]), torch.get_num_threads()
    radii = layer_radii(float(coc.abs().max()), STEP)
    want, kept = spread_layers(color, coc, radii, compiled=True), color.clone()
    try:
        torch.set_num_threads(1)
        other = color.contiguous(memory_format=torch.channels_last)
        assert torch.equal(spread_layers(other, coc, radii, compiled=True), want)
    finally:
        torch.set_num_threads(count)
    assert torch.equal(color, kept)


def test_black_stays_black() -> None:
    color, coc = scene(**CASES["near"])
    assert torch.equal(forms(0 * color, coc)[0], 0 * color)


def test_gradients_choose_the_reference() -> None:
    frame = boxes.frame(boxes.camera((20, 30)))
    g, color = frame.gbuffer, torch.rand(1, 3, 20, 30)
    for name in ("color", "focus"):
        light, focus = color.clone().requires_grad_(name == "color"), torch.tensor([9.0], requires_grad=name == "focus")
        blurred = depth_of_field(light, g.depth, g.camera, hit=g.hit, focus_distance=focus, aperture_radius=1.0)
        blurred.square().sum().backward()
        gradient = light.grad if name == "color" else focus.grad
        assert gradient is not None
        assert float(gradient.abs().max()) > 1e-3


def test_operator_is_registered_properly() -> None:
    color, coc = scene((20, 30), **CASES["both"])
    given = (color, coc, layer_radii(float(coc.abs().max()), STEP))
    torch.library.opcheck(layers_cpu, given, test_utils=("test_schema", "test_faketensor"))
