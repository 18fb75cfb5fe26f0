"""Tone curves against their published forms, and the properties that every one of them owes."""

from __future__ import annotations

import boxes
import pytest
import torch
from torch import Tensor

from post.passes.display.tone_map import DisplayEncode, Operator, ToneMap, display_encode, tone_map

OPERATORS: tuple[Operator, ...] = ("agx", "aces", "pbr_neutral", "reinhard", "linear")


def shown(*rgb: float, **tunables) -> list[float]:
    return tone_map(torch.tensor(rgb, dtype=torch.float64).view(1, 3, 1, 1), **tunables).flatten().tolist()


def greys(**tunables) -> Tensor:
    level = torch.cat([torch.zeros(1), torch.logspace(-4, 2, 400)]).double()
    return tone_map(level.expand(1, 3, 1, -1), **tunables)[0, :, 0]


@pytest.mark.parametrize("operator", OPERATORS)
def test_what_all_owe(operator):
    ramp = greys(operator=operator)
    assert float(ramp.min()) >= 0
    assert float(ramp.max()) <= 1
    assert float(ramp[:, 0].max()) < 1e-4, "black stays black"
    assert bool((ramp.diff(dim=1) >= -1e-7).all()), "more light is never darker"
    assert float((ramp - ramp.mean(0)).abs().max()) < 2e-4, "grey stays grey"
    assert float(ramp[0, -1]) > 0.9, "bright light is nearly white"
    middle = shown(0.18, 0.18, 0.18, operator=operator)[0]
    assert 0.1 < middle < 0.22, "middle grey stays in the middle"


@pytest.mark.parametrize("operator", OPERATORS)
def test_order_of_channels_is_kept(operator):
    """Hue may fade to white but must not flip: the strongest channel stays the strongest."""
    torch.manual_seed(0)
    color = torch.rand(1, 3, 40, 40).double() * torch.logspace(-2, 2, 40).double()
    result = tone_map(color, operator=operator, contrast=1.0, saturation=1.0)
    strongest, weakest = color.argmax(1, keepdim=True), color.argmin(1, keepdim=True)
    clear = color.gather(1, strongest) > 1.5 * color.gather(1, weakest)
    slack = result.gather(1, strongest) - result.gather(1, weakest)
    assert float(slack[clear].min()) > -1e-6


def test_agx_follows_the_curve_it_was_fitted_to():
    """Sobotka's curve: hyperbolic toe (power 3) and shoulder (3.25) through the pivot with slope 2, 2.2 encoding."""
    level = torch.logspace(-5, 1.2, 200).double()
    x = ((level.log2() + 12.47393) / 16.5).clamp(0, 1)
    pivot_x, pivot_y, slope = 10 / 16.5, 0.5, 2.0

    def part(t: Tensor, room_x: float, room_y: float, power: float) -> Tensor:
        scale = ((slope * room_x) ** -power * ((slope * room_x / room_y) ** power - 1)) ** (-1 / power)
        u = slope * t / scale
        return scale * u / (1 + u**power) ** (1 / power)

    toe = pivot_y - part((pivot_x - x).clamp_min(0), pivot_x, pivot_y, 3.0)
    shoulder = pivot_y + part((x - pivot_x).clamp_min(0), 1 - pivot_x, 1 - pivot_y, 3.25)
    expected = torch.where(x < pivot_x, toe, shoulder)
    base = tone_map(level.expand(1, 3, 1, -1), operator="agx", contrast=1.0, saturation=1.0)[0, 0, 0]
    assert torch.allclose(base ** (1 / 2.2), expected, atol=0.02)


def test_agx_fades_bright_colours_to_white():
    def saturation(level: float) -> float:
        rgb = shown(level, 0.02 * level, 0.02 * level, operator="agx")
        return (max(rgb) - min(rgb)) / max(rgb)

    values = [saturation(level) for level in (0.2, 2.0, 10.0, 50.0)]
    assert values == sorted(values, reverse=True)
    assert values[-1] < 0.35


def test_agx_look():
    base = shown(0.1, 0.3, 0.6, operator="agx", contrast=1.0, saturation=1.0)
    punchy = shown(0.1, 0.3, 0.6, operator="agx", contrast=1.35, saturation=1.4)
    assert max(punchy) - min(punchy) > max(base) - min(base)


def test_aces_matches_the_fit():
    """Grey passes both matrices unchanged, so the rational fit alone is tested."""
    for v in (0.01, 0.18, 1.0, 4.0):
        fit = (v * (v + 0.0245786) - 0.000090537) / (v * (0.983729 * v + 0.4329510) + 0.238081)
        assert shown(v, v, v, operator="aces") == pytest.approx([fit] * 3, abs=1e-3)


def test_pbr_neutral_matches_the_specification():
    """Base colours above 0.08 lose 0.04 to Fresnel and nothing else, up to 0.76; then 1 - d^2 / (peak + d - 0.76)."""
    assert shown(0.3, 0.5, 0.7, operator="pbr_neutral") == pytest.approx([0.26, 0.46, 0.66])
    assert shown(0.04, 0.04, 0.04, operator="pbr_neutral") == pytest.approx([0.01] * 3)
    peak = 2.04 - 0.04
    expected = 1 - 0.24**2 / (peak + 0.24 - 0.76)
    assert shown(2.04, 2.04, 2.04, operator="pbr_neutral") == pytest.approx([expected] * 3)
    # A saturated light beyond the start: scaled to the new peak, then faded toward it.
    scaled, fade = expected / peak, 1 / (0.15 * (peak - expected) + 1)
    low = (0.14 - 0.04) * scaled
    assert shown(2.04, 0.14, 0.14, operator="pbr_neutral")[1] == pytest.approx(low * fade + expected * (1 - fade))


def test_reinhard_white_point_is_white():
    assert shown(4.0, 4.0, 4.0, operator="reinhard", white=4.0) == pytest.approx([1.0] * 3)
    assert shown(1.0, 1.0, 1.0, operator="reinhard", white=1e6) == pytest.approx([0.5] * 3)


def test_exposure_scales_light():
    color = torch.rand(2, 3, 4, 5)
    factor = torch.tensor([0.5, 3.0]).view(2, 1, 1, 1)
    assert torch.allclose(tone_map(color, exposure=factor), tone_map(color * factor))


def test_display_encode_is_srgb():
    values = display_encode(torch.tensor([0.0, 0.0031308, 0.2140411, 1.0, 2.0]).expand(1, 3, 1, -1))[0, 0, 0]
    assert values.tolist() == pytest.approx([0.0, 0.04045, 0.5, 1.0, 1.0], abs=1e-4)


def test_dither_hides_the_steps_of_eight_bits():
    """A slow ramp, rounded: its local mean follows the ramp only with dither, and neither end moves."""
    ramp = torch.linspace(0.2, 0.205, 256).expand(1, 3, 256, -1)
    exact = display_encode(ramp)[0, 0].mean(0)

    def error(picture: Tensor) -> float:
        rounded = (picture * 255).round() / 255
        return float((rounded[0, 0].mean(0) - exact).abs().max())

    assert error(display_encode(ramp)) > 1.5e-3
    assert error(display_encode(ramp, dither=True)) < 4e-4
    ends = torch.tensor([0.0, 1.0]).view(1, 1, 1, 2).expand(1, 3, 32, 2)
    assert torch.equal((display_encode(ends, dither=True) * 255).round() / 255, ends)


def test_modules_equal_functions():
    frame = boxes.frame(boxes.camera((12, 16)))
    color, auto = torch.rand(1, 3, 12, 16) * 3, torch.full((1, 1, 1, 1), 0.4)
    frame = frame.replace(color=color, exposure=auto, index=5)
    mapped = ToneMap(operator="aces", exposure=1.5)(frame)
    assert torch.equal(mapped.read("image"), tone_map(color, operator="aces", exposure=1.5 * auto))
    plain = ToneMap()(frame.replace(exposure=None)).read("image")
    assert torch.equal(plain, tone_map(color))
    encoded = DisplayEncode(dither=True)(mapped).read("image")
    assert torch.equal(encoded, display_encode(mapped.read("image"), dither=True, index=5))


@pytest.mark.parametrize("operator", OPERATORS)
def test_gradients(operator):
    torch.manual_seed(4)
    color = (0.1 + 0.5 * torch.rand(1, 3, 3, 4, dtype=torch.float64)).requires_grad_()
    (gradient,) = torch.autograd.grad(display_encode(tone_map(color, operator=operator)).sum(), color)
    assert float(gradient.abs().min()) > 1e-3
    assert torch.autograd.gradcheck(lambda c: tone_map(c, operator=operator), (color,))


@pytest.mark.parametrize("operator", OPERATORS)
def test_black_and_huge_light_have_finite_gradients(operator):
    color = torch.tensor([0.0, 1e-8, 1e8]).view(1, 1, 1, 3).repeat(1, 3, 1, 1).requires_grad_()
    result = display_encode(tone_map(color, operator=operator))
    (gradient,) = torch.autograd.grad(result.sum(), color)
    assert torch.isfinite(result).all()
    assert torch.isfinite(gradient).all()


@pytest.mark.parametrize("show", [*OPERATORS, "encode"])
def test_a_pixel_that_is_not_finite_is_black_or_bright_and_alone(show):
    """In the functions as in the passes, which mend it before."""
    picture = torch.rand(1, 3, 5, 6) * 0.8
    function = display_encode if show == "encode" else lambda color: tone_map(color, operator=show)
    want = function(picture)
    for bad, black in ((torch.nan, True), (-torch.inf, True), (torch.inf, False)):
        broken = picture.clone()
        broken[0, :, 2, 3] = bad
        found = function(broken)
        assert float(found.min()) >= 0
        assert float(found.max()) <= 1 + 1e-6
        assert (float(found[0, :, 2, 3].max()) < 1e-4) == black, (show, bad)
        found[0, :, 2, 3] = want[0, :, 2, 3]
        assert torch.equal(found, want)


def test_bad_input():
    with pytest.raises(ValueError, match="operator must be one of agx"):
        tone_map(torch.rand(1, 3, 2, 2), operator="filmic")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="white must be positive"):
        tone_map(torch.rand(1, 3, 2, 2), white=0.0)
