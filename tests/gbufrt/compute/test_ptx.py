"""Bodies compile for a GPU, with the types of real calls; numba-cuda needs no GPU for that."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import forms
import light_paths
import pytest
import torch
import traversals
from gpu_stand_in import GPU, gpu
from torch import Tensor

from gbufrt.compute import cuda

ANSWERS = {script.__name__: script.answers for script in (forms, traversals, light_paths)}
CAPABILITY = (8, 0)


@pytest.mark.parametrize("name", ANSWERS)
def test_all_bodies_that_a_frame_launches_compile(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("numba_cuda")
    compiled = _compiled(ANSWERS[name], monkeypatch)
    assert len(compiled) >= 4
    assert all(".entry" in ptx for ptx in compiled.values())
    assert [name for name, ptx in compiled.items() if ".extern .func" in ptx] == [], "numba's cache refuses what links"


def _compiled(answers: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    """The code of each body that is launched, by its name and the types of its arguments."""
    from numba.cuda import dispatcher
    from numba.cuda.compiler import compile_ptx

    found = dict[str, str]()

    def compile_one(body: Callable[..., Any], count: int, arguments: Any) -> None:
        types = _type(count), _type(tuple(arguments))
        if (key := f"{body.__name__}{types}") not in found:
            found[key] = compile_ptx(cuda.kernel_of(body).dispatcher.py_func, types, cc=CAPABILITY)[0]

    monkeypatch.setattr(dispatcher, "get_current_device", lambda: SimpleNamespace(compute_capability=CAPABILITY))
    with gpu(monkeypatch), monkeypatch.context() as patch:
        patch.setattr(cuda, "launch", compile_one)
        answers(GPU)
    return found


def _type(value: Any) -> Any:
    """What numba takes an argument of `gbufrt.compute.cuda.launch` for."""
    from numba import from_dtype, typeof, types

    if isinstance(value, Tensor):
        return types.Array(from_dtype(torch.empty(0, dtype=value.dtype).numpy().dtype), value.ndim, "C")
    return types.BaseTuple.from_types(tuple(map(_type, value))) if isinstance(value, tuple) else typeof(value)
