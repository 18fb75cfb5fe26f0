"""The compiled AgX curve against its torch reference."""

from __future__ import annotations

import pytest
import torch
from torch import Tensor

from post.display.op import agx_cpu, tone_curve
from post.passes.display.tone_map import tone_map

LOOK = ("agx", 1.2, 1.2, 4.0)


def light(batch: int = 2, size: tuple[int, int] = (127, 73)) -> Tensor:
    """Twenty-five stops of light of all colours, with black, negative and huge pixels."""
    generator = torch.Generator().manual_seed(1)
    color = torch.rand((batch, 3, *size), generator=generator) * torch.logspace(-4, 3.5, size[1])
    color[:, :, ::11, ::7] = 0.0
    color[:, :1, ::13, ::5] *= -1.0
    color[:, 1, ::17, ::9] = 1e30
    return color


@pytest.mark.parametrize(("contrast", "saturation"), [(1.2, 1.2), (1.0, 0.0), (0.6, 1.6)])
@pytest.mark.parametrize("size", [(127, 73), (1, 1), (1, 9)])
def test_forms_agree(contrast: float, saturation: float, size: tuple[int, int]) -> None:
    color, exposure = light(size=size), torch.tensor([0.7, 3.0]).view(2, 1, 1, 1)
    look = ("agx", contrast, saturation, 4.0)
    got, want = (tone_curve(color, exposure, *look, compiled=form) for form in (True, False))
    torch.testing.assert_close(got, want, rtol=2e-5, atol=2e-6)
    assert size != (127, 73) or float(want.max() - want.min()) > 0.9


def test_one_exposure_for_all_and_any_layout() -> None:
    color, exposure = light(), torch.tensor(0.7)
    want = tone_curve(color, exposure.expand(2, 1, 1, 1), *LOOK, compiled=True)
    strided = color.contiguous(memory_format=torch.channels_last)
    assert torch.equal(tone_curve(strided, exposure, *LOOK, compiled=True), want)
    assert torch.equal(tone_map(color, exposure=0.7), want)


def test_the_reference_serves_gradients_and_other_curves() -> None:
    color, one = light(1, (20, 30)), torch.tensor(1.0)
    for name, given in (("color", color.clamp(1e-3, 4.0).requires_grad_()), ("exposure", color)):
        exposure = torch.tensor(1.0, requires_grad=name == "exposure")
        tone_curve(given, exposure, *LOOK).sum().backward()
        gradient = given.grad if name == "color" else exposure.grad
        assert gradient is not None
        assert float(gradient.abs().max()) > 0
    aces = [tone_curve(color.clamp_max(9.0), one, "aces", 1.2, 1.2, 4.0, compiled=form) for form in (None, False)]
    assert torch.equal(*aces)


def test_operator_is_registered_properly() -> None:
    given = (light(), torch.ones(2), 1.2, 1.2)
    torch.library.opcheck(agx_cpu, given, test_utils=("test_schema", "test_faketensor"))
