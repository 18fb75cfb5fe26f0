"""Which tensors are known to be finite, so that twenty passes need not look at each of them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from weakref import WeakValueDictionary

from torch import Tensor
from torch.utils.weak import WeakTensorKeyDictionary

_known: ContextVar[WeakValueDictionary[int, Tensor] | None] = ContextVar("finite tensors, by id", default=None)
_versions = WeakTensorKeyDictionary()
"""Tensors that `keep` was given, with how often they had been written into."""


@contextmanager
def knowing(before: Iterable[Tensor]) -> Iterator[None]:
    """Inside, what is known is kept. Nothing may write into those tensors until the end.

    Args:
        before: of these, what `keep` was given is known if nothing has written into it since.
    """
    token, tensor = _known.set(WeakValueDictionary()), None
    try:
        for tensor in before:
            if _versions.get(tensor) == _version(tensor):
                know(tensor)
        del before, tensor  # a state that is handed over lets go of them inside
        yield
    finally:
        _known.reset(token)


def know(tensor: Tensor) -> None:
    """Take a tensor for finite, inside `knowing`."""
    if (known := _known.get()) is not None:
        known[id(tensor)] = tensor


def is_known(tensor: Tensor) -> bool:
    """Whether a tensor is known to be finite; never outside `knowing`."""
    known = _known.get()
    return known is not None and known.get(id(tensor)) is tensor


def as_finite_as(before: Tensor, after: Tensor) -> Tensor:
    """``after``, known to be finite if ``before`` is: the numbers of the one come from those of the other."""
    if is_known(before):
        know(after)
    return after


def keep(tensors: Iterable[Tensor]) -> None:
    """Keep what is known of these beyond the end of `knowing`, for when they are ``before`` another one."""
    for tensor in tensors:
        if is_known(tensor):
            _versions[tensor] = _version(tensor)


def _version(tensor: Tensor) -> int:
    """How often torch wrote into a tensor; -1 where it does not count."""
    return -1 if tensor.is_inference() else tensor._version
