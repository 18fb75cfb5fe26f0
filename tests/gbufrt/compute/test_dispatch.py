"""Which form of an operation runs for which tensors."""

from __future__ import annotations

import pytest
import torch

from gbufrt.compute import dispatch
from gbufrt.compute.dispatch import Form, form_of


def test_a_kernel_runs_for_float32_on_the_cpu_where_no_gradient_is_wanted() -> None:
    plane = torch.zeros(2)
    leaf = plane.clone().requires_grad_()
    assert form_of(plane, None, plane.int()) is Form.CPU
    assert form_of(plane, leaf) is Form.REFERENCE
    assert form_of(plane, plane.double()) is Form.REFERENCE
    assert form_of(plane, plane.to("meta")) is Form.REFERENCE
    assert form_of(plane.to("meta")) is Form.REFERENCE
    with torch.no_grad():
        assert form_of(plane, leaf) is Form.CPU


def test_a_wish_is_followed_or_refused() -> None:
    leaf = torch.zeros(2, requires_grad=True)
    assert form_of(leaf, compiled=True) is Form.CPU
    assert form_of(leaf.detach(), compiled=False) is Form.REFERENCE
    with pytest.raises(ValueError, match=r"compiled must be None or False for float32 on meta: .* on the CPU only"):
        form_of(leaf.to("meta"), compiled=True)
    with pytest.raises(ValueError, match=r"for float64 on cpu: .* on the CPU or CUDA with numba-cuda only"):
        form_of(leaf.double(), compiled=True, cuda=True)


@pytest.mark.parametrize("compiles", [True, False])
def test_the_cuda_form_runs_where_there_is_one(compiles: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    class OnCuda(torch.Tensor):
        device = torch.device("cuda", 0)

    monkeypatch.setattr(dispatch, "_cuda_compiles", lambda: compiles)
    plane = torch.zeros(1).as_subclass(OnCuda)
    assert form_of(plane, cuda=True) is (Form.CUDA if compiles else Form.REFERENCE)
    assert form_of(plane) is Form.REFERENCE
    assert form_of(plane, torch.zeros(1), cuda=True) is Form.REFERENCE


def test_derivatives_that_are_carried_forward_take_the_reference():
    forms = list[Form]()

    def called(given: torch.Tensor) -> torch.Tensor:
        forms.append(form_of(given))
        return given

    torch.func.jvp(called, (torch.ones(2),), (torch.ones(2),))
    assert forms == [Form.REFERENCE]
    assert form_of(torch.ones(2)) is Form.CPU
