"""A stand-in for a GPU where there is none: tensors that say they lie on one, and what the host does for them.

Inside `gpu`, ``tensor.to(GPU)`` and all that is made with ``device=GPU`` is an `OnGpu`, which computes with a tensor of
the CPU. Control flow is thus that of real numbers, CUDA forms run wherever gbufrt has one, and what makes the host wait
is counted: numbers that are read, shapes that depend on numbers, and copies from one memory to the other, which wait
unless they come from page-locked memory of the host and are told not to. Operators of gbufrt run twice: as on a GPU,
but with launches that do nothing, to count what they do besides; and on the CPU, for the numbers.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import torch
from torch import Tensor
from torch._library.custom_ops import OPDEFS
from torch._subclasses.fake_tensor import FakeTensorMode
from torch.utils._python_dispatch import TorchDispatchMode

from gbufrt.compute import cuda, dispatch, resident

GPU = torch.device("cuda", 0)
ROOT = Path(__file__).parents[2]
ROOMS = tuple(str(ROOT / room) for room in ("gbufrt", "post", "tracer"))
READS = frozenset(
    {"_local_scalar_dense", "is_nonzero", "equal", "nonzero", "masked_select", "bincount", "repeat_interleave"}
    | {"_unique2", "unique_dim", "unique_consecutive", "_linalg_check_errors", "linalg_lstsq"}
)
"""Operators whose result, or its shape, the host waits for."""
VIEWS = frozenset(
    {"view", "alias", "detach", "slice", "select", "expand", "permute", "transpose", "t", "unsqueeze", "squeeze"}
    | {"split", "split_with_sizes", "unbind", "as_strided", "diagonal", "unfold", "empty", "new_empty", "empty_like"}
)
"""Operators that launch nothing."""
MIXED = ("copy_", "_to_copy", "where", "index")
"""Beginnings of operators that copy an argument from the host, where others refuse it."""


class OnGpu(Tensor):
    """A tensor of the stand-in. To torch's own code, which in builds for the CPU knows no GPU, it lies on ``meta``."""

    inner: Tensor  # pyright: ignore[reportIncompatibleMethodOverride]
    __torch_function__ = torch._C._disabled_torch_function_impl  # type: ignore[assignment]

    @staticmethod
    def __new__(cls, inner: Tensor) -> OnGpu:
        layout = {"strides": inner.stride(), "storage_offset": inner.storage_offset(), "dtype": inner.dtype}
        self = torch.Tensor._make_wrapper_subclass(cls, inner.size(), **layout, device="meta")  # type: ignore[attr-defined]
        self.inner = inner
        return self

    @classmethod
    def __torch_dispatch__(cls, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        raise RuntimeError(f"{func} outside of gpu()")

    @property
    def device(self) -> torch.device:  # pyright: ignore[reportIncompatibleVariableOverride]
        return GPU

    @property
    def is_cuda(self) -> bool:  # pyright: ignore[reportIncompatibleVariableOverride]
        return True

    def new_tensor(self, data: Any, dtype: Any = None) -> Tensor:  # pyright: ignore[reportIncompatibleMethodOverride]
        return torch.tensor(data, dtype=dtype or self.dtype, device=GPU)

    def tolist(self) -> list[Any]:
        return self.cpu().tolist()


class Seen(TorchDispatchMode):
    """What the host did: ``waits`` by what made it wait, and ``launches``: what it launched, on what shapes."""

    def __init__(self) -> None:
        super().__init__()
        self.clear()

    def clear(self) -> None:
        self.waits, self.launches = Counter[str](), list[tuple[Any, ...]]()

    def wait(self, why: str) -> None:
        self.waits[f"{_user()} {why}"] += 1

    def launch(self, body: Any, count: int, arguments: Any) -> None:
        """In place of `gbufrt.compute.cuda.launch`, to which numba would copy tensors of the host, and back."""
        if any(isinstance(x, Tensor) and not isinstance(x, OnGpu) for x in arguments):
            self.wait("copies")
        self.launches.append((body.__name__, count, *(tuple(x.shape) for x in arguments if isinstance(x, Tensor))))

    def __torch_dispatch__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        kwargs, name = dict(kwargs or {}), func._schema.name.partition("::")[2]
        if name == "_pin_memory":
            with torch._C._DisableTorchDispatch():  # type: ignore[attr-defined]
                return _page_locked(args[0])
        given = list(_tensors((*args, *kwargs.values())))
        there = any(isinstance(x, OnGpu) for x in given)
        if there and func.namespace in ("gbufrt", "tracer"):
            with self:
                OPDEFS[func._schema.name]._init_fn(*args, **kwargs)
        elif given and not (kwargs.get("non_blocking") and all(hasattr(x, "page_locked") for x in given)):
            masked = name.startswith("index") and any(x.dtype == torch.bool for x in _tensors(args[1:2]))
            self._account(name, given, there, kwargs.get("device"), reads=masked or name in READS)
        if kwargs.get("device") is not None:
            there = kwargs["device"].type != "cpu"
            kwargs["device"] = torch.device("cpu")
        if there and func.namespace == "aten" and name not in VIEWS:
            self.launches.append((name, *(tuple(x.shape) for x in given)))
        with torch._C._DisableTorchDispatch():  # type: ignore[attr-defined]
            out = func(*(_mapped(_inner, x) for x in args), **{k: _mapped(_inner, x) for k, x in kwargs.items()})
        if name == "_local_scalar_dense" or not there:
            return out
        return args[0] if func._schema.is_mutable else _mapped(OnGpu, out)

    def _account(
        self, name: str, given: list[Tensor], there: bool, target: torch.device | None, *, reads: bool
    ) -> None:
        strangers = [x for x in given if not isinstance(x, OnGpu)]
        moves = target is not None and there != (target.type != "cpu")
        if moves or (there and strangers and name.startswith(MIXED)):
            self.wait("copies")
        elif there and any(x.ndim for x in strangers):
            raise RuntimeError(f"{name} of tensors on two devices")
        elif there and reads:
            self.wait("reads")


def _tensors(values: Any) -> Iterator[Tensor]:
    for value in values:
        if isinstance(value, Tensor):
            yield value
        elif isinstance(value, list | tuple):
            yield from _tensors(value)


def _mapped(function: Callable[[Tensor], Tensor], value: Any) -> Any:
    if isinstance(value, Tensor):
        return function(value)
    return type(value)(_mapped(function, x) for x in value) if type(value) in (list, tuple) else value


def _page_locked(tensor: Tensor) -> Tensor:
    copy = tensor.clone()
    copy.page_locked = True  # type: ignore[attr-defined]
    return copy


def _inner(tensor: Tensor) -> Tensor:
    return tensor.inner if isinstance(tensor, OnGpu) else tensor


def _user() -> str:
    """The innermost function of gbufrt, post or tracer on the stack; else the test."""
    frame = sys._getframe(1)
    while frame is not None and not frame.f_code.co_filename.startswith(ROOMS):
        frame = frame.f_back
    return "test" if frame is None else f"{frame.f_globals['__name__']}.{frame.f_code.co_name}"


@contextmanager
def gpu(monkeypatch: pytest.MonkeyPatch) -> Iterator[Seen]:
    """A GPU that is not there, see above."""
    seen = Seen()
    with monkeypatch.context() as patch, torch.no_grad(), FakeTensorMode(), seen:  # fake, or torch would look for a GPU
        patch.setattr(dispatch, "_cuda_compiles", lambda: True)
        patch.setattr(cuda, "launch", seen.launch)
        patch.setattr(torch.cuda, "device_count", lambda: 1)
        patch.setattr(resident, "_kept", {})
        patch.setattr(resident, "_traced", lambda tensor: False)
        yield seen
