"""The CUDA form of direct light, on a GPU or in numba's simulator of one."""

from __future__ import annotations

from pathlib import Path

import direct_light
import pytest
import torch
from simulated import answers_of
from torch import Tensor

SCRIPT = Path(direct_light.__file__)


def check(found: dict[str, Tensor]) -> None:
    wanted = direct_light.answers()
    assert found.keys() == wanted.keys()
    for name, want in wanted.items():
        off = (found[name] - want).abs() > 1e-4 + 2e-3 * want
        assert off.any(dim=1).float().mean() < 0.02, f"{name}: few rays graze an edge"
        assert want.std() > 0.5, name


def test_the_simulated_cuda_form_finds_what_the_cpu_finds(tmp_path: Path) -> None:
    found, ran = answers_of(SCRIPT, tmp_path / "answers.pt")
    assert ran >= {"candidates_tile", "list_pixel", "pack_pixel", "first_pixel", "finish_pixel"}
    check(found)


@pytest.mark.skipif(not torch.cuda.is_available(), reason="there is no GPU")
def test_the_cuda_form_finds_what_the_cpu_finds() -> None:
    pytest.importorskip("numba_cuda")
    check(direct_light.answers("cuda"))
