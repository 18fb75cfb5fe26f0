"""Compiled anti-aliasing against its torch reference."""

from __future__ import annotations

from typing import Any

import boxes
import pytest
import torch
from torch import Tensor

from post.filters.fxaa_op import smooth_stairs, stairs_cpu

TUNABLES: dict[str, Any] = {"subpixel": 0.5, "edge_threshold": 0.125, "dark_threshold": 0.03}


def drawn(size: tuple[int, int], *, orthographic: bool = False) -> Tensor:
    """Boxes seen by a camera: straight edges at many angles, on which a search goes far.

    Their texture is faint. Without any, stairs between two even surfaces end at exactly the threshold of the search,
    where rounding decides.
    """
    light = boxes.frame(boxes.camera(size, orthographic=orthographic)).read("radiance")
    return (light / (1 + light)) ** (1 / 2.2) * (0.99 + 0.01 * noise(size))


def noise(size: tuple[int, int]) -> Tensor:
    return torch.rand((1, 3, *size), generator=torch.Generator().manual_seed(size[0]))


CASES = {
    "odd": drawn((127, 73)),
    "orthographic": drawn((60, 90), orthographic=True),
    "turned": drawn((90, 60)).transpose(2, 3),
    "batch": torch.cat([drawn((48, 64)), drawn((48, 64)).flip(-1)]),
    "noise": noise((127, 73)),
    "bars": (torch.arange(40) % 7 < 3).float().expand(1, 3, 30, 40),
    "sky": torch.full((1, 3, 20, 30), 0.7),
    **{f"{h}x{w}": noise((h, w)) for h, w in ((1, 1), (1, 9), (9, 1), (2, 3))},
}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("subpixel", [0.0, 0.8])
def test_forms_agree(case: str, subpixel: float) -> None:
    """Rounding may move the end of an edge on few pixels."""
    image, tunables = CASES[case], {**TUNABLES, "subpixel": subpixel}
    got, want = (smooth_stairs(image, **tunables, compiled=form) for form in (True, False))
    apart = (got - want).abs().amax(dim=1)
    assert float((apart > 3e-5).float().mean()) <= 2e-4, f"differs by up to {float(apart.max()):.2g}"
    changed = float((want - image).abs().amax(dim=1).gt(0.01).float().mean())
    assert changed > 0.015 or case in ("bars", "sky") or min(image.shape[2:]) < 3


@pytest.mark.parametrize("name", TUNABLES)
def test_every_tunable_reaches_the_kernel(name: str) -> None:
    tunables = {**TUNABLES, name: 0.3}
    got, want = (smooth_stairs(CASES["odd"], **tunables, compiled=form) for form in (True, False))
    assert float(((got - want).abs().amax(dim=1) > 3e-5).float().mean()) <= 2e-4
    assert not torch.equal(got, smooth_stairs(CASES["odd"], **TUNABLES, compiled=True))


def test_a_bad_pixel_stays_alone() -> None:
    image = CASES["noise"].clone()
    image[0, 0, 20, 30] = torch.nan
    for form in (True, False):
        bad = smooth_stairs(image, **TUNABLES, compiled=form).isnan()
        assert int(bad.sum()) == 1, form
        assert bool(bad[0, 0, 20, 30])


def test_gradients_choose_the_reference() -> None:
    image = CASES["noise"].clone().requires_grad_()
    (gradient,) = torch.autograd.grad(smooth_stairs(image, **TUNABLES).sum(), image)
    assert float(gradient.abs().max()) > 0


def test_threads_and_layout_do_not_matter() -> None:
    image, count = CASES["turned"], torch.get_num_threads()
    want = smooth_stairs(image.contiguous(), **TUNABLES, compiled=True)
    try:
        torch.set_num_threads(1)
        assert torch.equal(smooth_stairs(image, **TUNABLES, compiled=True), want)
    finally:
        torch.set_num_threads(count)


def test_operator_is_registered_properly() -> None:
    torch.library.opcheck(stairs_cpu, (noise((7, 9)), 0.5, 0.125, 0.03), test_utils=("test_schema", "test_faketensor"))
