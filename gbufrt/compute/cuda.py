"""Scalar bodies on NVIDIA GPUs, by numba-cuda: the extra ``gbufrt[cuda]``.

With ``NUMBA_ENABLE_CUDASIM=1`` in the environment before numba is imported, numba simulates a GPU, slowly and without
types, to test the logic where there is no GPU. Tensors then lie on the CPU.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import numpy as np
import torch
from numba import cuda
from torch import Tensor

from gbufrt.compute.dispatch import simulated
from gbufrt.compute.kernel import Kernel, array, replaced, tensors_of
from gbufrt.compute.target import Target

BLOCK = 128  # threads: enough to hide memory latency, few enough that items of one block lie close together
REGISTERS = 80  # a thread: with 96 a reflection takes 1.07 times as long on an H200, with 128 1.2 times


def _options() -> dict[str, Any]:
    """Of kernels: divisions and roots good to two units in the last place, no denormal numbers."""
    options = {"cache": True, "fastmath": True}
    return options if simulated() else options | {"max_registers": REGISTERS}


def _instead() -> dict[Any, Any]:
    """numpy's functions that numba-cuda does not know; its simulator runs numpy's own."""
    if simulated():
        return {}
    from numba.cuda import libdevice

    one_number = cuda.jit(device=True)
    return {
        np.floor: one_number(lambda x: libdevice.floorf(x)),
        np.ceil: one_number(lambda x: libdevice.ceilf(x)),
        np.rint: one_number(lambda x: libdevice.rintf(x)),
    }


CUDA = Target(
    cuda.jit,
    helper={"device": True},
    owner={"device": True},
    within={"device": True},
    entry={"device": True},
    driver=_options(),
    instead=_instead(),
    lanes=1,
)


def item(i: int, *arguments: Any) -> None:
    """Placeholder for the body in the kernel below."""


def _each(count, arguments):
    i = cuda.grid(1)  # pyright: ignore[reportCallIssue]
    if i < count:
        item(i, *arguments)


@cache
def kernel_of(body: Callable[..., Any]) -> Kernel:
    """The CUDA kernel of a body, one item a thread."""
    return Kernel(_each, CUDA, item=body)


def launch(body: Callable[..., Any], count: int, arguments: Sequence[Any]) -> None:
    """See `gbufrt.compute.each.Each.on_cuda`."""
    if count == 0:
        return  # CUDA has no empty grids
    device = next((x.device for x in tensors_of(arguments) if x.is_cuda), None)
    given = replaced(arguments, _device_array)
    blocks = -(-count // BLOCK)
    if device is None:
        kernel_of(body)(count, given, grid=(blocks, BLOCK))
        return
    with torch.cuda.device(device), cuda.gpus[device.index]:
        stream = cuda.external_stream(torch.cuda.current_stream().cuda_stream)
        kernel_of(body)(count, given, grid=(blocks, BLOCK, stream))


def _device_array(tensor: Tensor) -> Any:
    return cuda.as_cuda_array(tensor.detach().contiguous()) if tensor.is_cuda else array(tensor)
