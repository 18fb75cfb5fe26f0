"""Which form of an operation runs: a kernel for the device of its tensors, or the torch reference."""

from __future__ import annotations

import os
from enum import Enum
from functools import cache
from importlib.util import find_spec

import torch
from torch import Tensor
from torch.autograd.forward_ad import unpack_dual


class Form(Enum):
    """How an operation may run."""

    REFERENCE = "torch reference"
    CPU = "CPU kernel"
    CUDA = "CUDA kernel"


def form_of(*inputs: Tensor | float | None, compiled: bool | None = None, cuda: bool = False) -> Form:
    """The form of an operation that runs for these inputs.

    Kernels take float32 (and integers) on one device and give no gradients.

    Args:
        inputs: those that decide: tensors, and tunables that may be tensors; others are ignored.
        compiled: the user's choice: True for a kernel even if gradients are lost, False for the reference; by default
            a kernel wherever one fits.
        cuda: whether the operation has a CUDA form for these sizes. It runs where numba-cuda is installed and finds a
            GPU, and for tensors on the CPU where numba simulates one.

    Returns:
        The form.

    Raises:
        ValueError: a kernel is requested, but there is none for these tensors.
    """
    given = [t for t in inputs if isinstance(t, Tensor)]
    kernel = _kernel_form(given, cuda)
    if compiled:
        if kernel is Form.REFERENCE:
            kinds = sorted({f"{str(t.dtype).removeprefix('torch.')} on {t.device}" for t in given})
            raise ValueError(
                f"compiled must be None or False for {', '.join(kinds)}: there is a kernel for float32 on "
                f"{'the CPU or CUDA with numba-cuda' if cuda else 'the CPU'} only"
            )
        return kernel
    wants_gradient = torch.is_grad_enabled() and any(t.requires_grad for t in given)
    if compiled is False or wants_gradient or _has_tangent(given):
        return Form.REFERENCE
    return kernel


def _has_tangent(tensors: list[Tensor]) -> bool:
    """Whether derivatives are carried forward, as in `torch.func.jvp`: kernels would drop them without a word."""
    return any(unpack_dual(t).tangent is not None for t in tensors if t.is_floating_point())


def _kernel_form(tensors: list[Tensor], cuda: bool) -> Form:
    devices = {t.device for t in tensors}
    if len(devices) != 1 or any(t.is_floating_point() and t.dtype != torch.float32 for t in tensors):
        return Form.REFERENCE
    kind = devices.pop().type
    if kind == "cpu":
        return Form.CUDA if cuda and simulated() else Form.CPU
    return Form.CUDA if kind == "cuda" and cuda and _cuda_compiles() else Form.REFERENCE


@cache
def simulated() -> bool:
    """Whether numba simulates a GPU in this process, slowly: CUDA forms then run on tensors that lie on the CPU."""
    return os.environ.get("NUMBA_ENABLE_CUDASIM", "0") not in ("", "0")


@cache
def _cuda_compiles() -> bool:
    """Whether numba-cuda is there, with a GPU and the compiler that it needs."""
    if find_spec("numba_cuda") is None:
        return False
    from numba import cuda

    return bool(cuda.is_available())
