"""The compiled open shutter against its torch reference."""

from __future__ import annotations

from typing import Any

import pytest
import torch
from torch import Tensor

from post.lens.op import blur_alike, prefiltered_by_kernel, reconstruct, reconstruct_cpu, similar_cpu
from post.lens.shutter_reference import prefiltered
from post.passes.lens.motion_blur import motion_blur

OPENINGS = {"center": -0.5, "trailing": 0.0}
ROUNDED = 2e-3  # share of pixels where a point may lie on another pixel's side of a border by rounding


def noise(*shape: int, seed: int) -> Tensor:
    return torch.rand(shape, generator=torch.Generator().manual_seed(seed))


def scene(size: tuple[int, int] = (31, 17), channels: int = 3, *, still: bool = False) -> dict[str, Any]:
    """Fast things before and behind a slower ground, under a sky that is far away; ``still``: the ground stands."""
    height, width = size
    depth, path = 8 + noise(1, 1, *size, seed=1), 0.3 * noise(1, 2, *size, seed=2)
    path[:, 0] += 2.0
    path *= not still
    top, left = height // 3, width // 3
    depth[..., :top, :], path[..., :top, :] = 1e4, 0.0
    dominant = path.clone()
    dominant[..., : top + 6, : left + 9] = torch.tensor([5.3, -3.1]).view(1, 2, 1, 1)
    depth[..., top : top + 6, left : left + 5] = 3.0
    path[..., top : top + 6, left : left + 5] = torch.tensor([5.3, -3.1]).view(1, 2, 1, 1)
    depth[..., top + 8 :, left:] = 20.0
    path[..., top + 8 :, left:] = dominant[..., top + 8 :, left:] = torch.tensor([-4.2, 6.7]).view(1, 2, 1, 1)
    color = 4 * noise(1, channels, *size, seed=3) ** 4
    return {"color": color, "depth": depth, "path": path, "dominant": dominant, "noise": noise(*size, seed=4)}


def forms(given: dict[str, Any], *, opening: float = -0.5, samples: int = 5) -> tuple[Tensor, Tensor]:
    settings = {"opening": opening, "samples": samples, "softness": 0.02}
    got, want = (reconstruct(**given, **settings, compiled=form) for form in (True, False))
    return got, want


def assert_close(got: Tensor, want: Tensor) -> None:
    assert got.shape == want.shape
    assert float(((got - want).abs() > 1e-4).any(1).float().mean()) <= ROUNDED


@pytest.mark.parametrize("opening", OPENINGS.values(), ids=OPENINGS)
@pytest.mark.parametrize("size", [(31, 17), (1, 1), (1, 9), (9, 1), (40, 300)], ids=str)
def test_forms_agree(size: tuple[int, int], opening: float) -> None:
    given = scene(size)
    got, want = forms(given, opening=opening)
    assert_close(got, want)
    if min(size) > 9:
        assert float((want - given["color"]).abs().mean()) > 0.1


def test_forms_agree_where_nothing_else_comes_by() -> None:
    """The dominant path leads to the pixel itself, so that there is one candidate, which may not land."""
    given = scene()
    given["dominant"] = torch.zeros_like(given["path"])
    given["dominant"][:, 1] = 0.55
    got, want = forms(given)
    assert_close(got, want)
    assert float((want - given["color"]).abs().mean()) > 0.1


@pytest.mark.parametrize("channels", [1, 2, 4, 7])
def test_any_number_of_channels(channels: int) -> None:
    assert_close(*forms(scene(channels=channels)))


def test_pixels_that_nothing_moves_over_stay_to_the_bit() -> None:
    given = scene(still=True)
    for found in forms(given):
        stays = (given["dominant"] == 0).all(1, keepdim=True).expand_as(found)
        assert 0.1 < float(stays.float().mean()) < 0.9
        assert torch.equal(found[stays], given["color"][stays])
        assert not torch.equal(found, given["color"])
    given["path"], given["dominant"] = (0.3 * torch.ones_like(given["path"]),) * 2
    for found in forms(given):
        assert torch.equal(found, given["color"]), "paths shorter than half a pixel"


def test_batch_equals_loop() -> None:
    one, other = scene(), {name: value.flip(-1).contiguous() for name, value in scene().items()}
    noises = one.pop("noise")
    other.pop("noise")
    both = {name: torch.cat([one[name], other[name]]) for name in one}
    together = forms(both | {"noise": noises})[0]
    for i, given in enumerate((one, other)):
        assert torch.equal(together[i : i + 1], forms(given | {"noise": noises})[0])


def test_threads_and_layout_do_not_matter() -> None:
    given, count = scene((40, 30)), torch.get_num_threads()
    want, _ = forms(given)
    kept = given["color"].clone()
    try:
        torch.set_num_threads(1)
        other = given | {"color": given["color"].contiguous(memory_format=torch.channels_last)}
        assert torch.equal(forms(other)[0], want)
    finally:
        torch.set_num_threads(count)
    assert torch.equal(given["color"], kept)


@pytest.mark.parametrize("position", ["center", "trailing"])
def test_the_pass_takes_the_kernel_and_gradients_the_reference(position: Any) -> None:
    given = scene((40, 30))
    color, depth, motion = given["color"], given["depth"], 2 * given["path"]
    want = motion_blur(color.double(), depth.double(), motion.double(), position=position, tile=8).float()
    assert_close(motion_blur(color, depth, motion, position=position, tile=8), want)
    light, way = color.clone().requires_grad_(), motion.clone().requires_grad_()
    blurred = motion_blur(light, depth, way, position=position, tile=8)
    assert_close(blurred.detach(), want)
    for gradient in torch.autograd.grad(blurred.square().sum(), (light, way)):
        assert float(gradient.abs().max()) > 1e-3


def test_operator_is_registered_properly() -> None:
    given = (*scene().values(), -0.5, 3, 0.02)
    torch.library.opcheck(reconstruct_cpu, given, test_utils=("test_schema", "test_faketensor"))


@pytest.mark.parametrize("opening", OPENINGS.values(), ids=OPENINGS)
@pytest.mark.parametrize(("size", "channels"), [((31, 17), 3), ((40, 300), 1), ((1, 1), 3), ((1, 9), 5)], ids=str)
def test_similarity_forms_agree(size: tuple[int, int], channels: int, opening: float) -> None:
    given = scene(size, channels, still=True)
    planes, settings = (given["color"], given["path"], given["noise"]), {"opening": opening, "samples": 5}
    got, want = (blur_alike(*planes, **settings, compiled=form) for form in (True, False))
    assert_close(got, want)
    if min(size) > 9:
        stays = (given["path"] == 0).all(1, keepdim=True).expand_as(got)
        assert 0.1 < float(stays.float().mean()) < 0.9
        assert torch.equal(got[stays], given["color"][stays]), "moving things do not spill over static ones"
        assert float((want - given["color"])[~stays].abs().mean()) > 0.1
    torch.library.opcheck(similar_cpu, (*planes, opening, 5), test_utils=("test_schema", "test_faketensor"))


@pytest.mark.parametrize("opening", OPENINGS.values(), ids=OPENINGS)
@pytest.mark.parametrize("width", [1, 2, 3, 40])
def test_the_picture_read_between_pixels_has_both_forms(width: int, opening: float) -> None:
    color, path = noise(2, 3, 12, width, seed=5), 4 * noise(2, 2, 12, width, seed=6) - 2
    want = prefiltered(color, path, opening)
    torch.testing.assert_close(prefiltered_by_kernel(color, path, opening), want, rtol=1e-5, atol=1e-6)
    assert torch.equal(prefiltered(color, torch.zeros_like(path), opening), color)
    assert width < 3 or float((want - color).abs().mean()) > 0.02


def test_reading_between_pixels_blurs_no_wave_and_brightens_no_lone_line() -> None:
    place = torch.arange(60) * (2 * torch.pi / 6)
    wave = 1 + 0.2 * torch.sin(place).expand(1, 3, 4, 60)
    path = torch.tensor([7.0, 0.0]).view(1, 2, 1, 1).expand(1, 2, 4, 60)

    def height(picture: Tensor) -> float:
        """Of the wave, as it is read all the way from one pixel to the next, as a share of what it is."""
        shares = []
        for fraction in torch.arange(8) / 8:
            read = torch.lerp(picture[0, 0, 0, 10:40], picture[0, 0, 0, 11:41], fraction) - 1
            truth = torch.sin(place[10:40] + fraction * place[1])
            shares.append(float((read * truth).sum() / (0.2 * truth.square().sum())))
        return sum(shares) / len(shares)

    assert height(wave) < 0.93
    assert height(prefiltered(wave, path, -0.5)) == pytest.approx(1.0, abs=0.02)
    line = torch.zeros(1, 3, 4, 60)
    line[..., 30] = 50.0
    assert torch.equal(prefiltered(line, path, -0.5), line)
