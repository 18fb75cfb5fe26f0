"""The compiled encoding and vignette against their torch references."""

from __future__ import annotations

import pytest
import torch

from post.display.op import darkened, encoded, encoded_cpu, vignette_cpu


def light(size: tuple[int, int]) -> torch.Tensor:
    return torch.rand(2, 3, *size, generator=torch.Generator().manual_seed(1)) * 1.4 - 0.2


@pytest.mark.parametrize("size", [(127, 73), (1, 1), (1, 9)])
def test_forms_agree(size: tuple[int, int]) -> None:
    steps = torch.linspace(0.0, 0.02, 192).view(1, 3, 8, 8)  # on both sides of the knee
    for image in (light(size), steps):
        got, want = (encoded(image, compiled=form) for form in (True, False))
        torch.testing.assert_close(got, want, rtol=2e-6, atol=1e-6)
    for circles in ((0.25, 0.4, 1.2), (1.0, 0.0, 0.5), (0.0, 0.4, 1.2)):
        got, want = (darkened(light(size), *circles, compiled=form) for form in (True, False))
        torch.testing.assert_close(got, want, rtol=2e-6, atol=1e-6)


def test_any_layout_and_gradients() -> None:
    image = light((20, 30))
    strided = image.contiguous(memory_format=torch.channels_last).requires_grad_()
    shown = darkened(encoded(strided), 0.5, 0.2, 0.9)
    torch.testing.assert_close(shown.detach(), darkened(encoded(image), 0.5, 0.2, 0.9), rtol=2e-6, atol=1e-6)
    shown.sum().backward()
    assert strided.grad is not None
    assert float(strided.grad.abs().max()) > 0


@pytest.mark.parametrize(("operator", "given"), [(encoded_cpu, ()), (vignette_cpu, (0.25, 0.4, 1.2))])
def test_operators_are_registered_properly(operator, given) -> None:
    torch.library.opcheck(operator, (light((6, 8)), *given), test_utils=("test_schema", "test_faketensor"))
