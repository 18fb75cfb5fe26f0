"""The CUDA form of light paths and of direct light, on a GPU or in numba's simulator of one."""

from __future__ import annotations

from pathlib import Path

import light_paths
import pytest
import torch
from simulated import answers_of
from torch import Tensor

SCRIPT = Path(light_paths.__file__)


def check(found: dict[str, Tensor]) -> None:
    wanted = light_paths.answers()
    assert found.keys() == wanted.keys()
    for name, want in wanted.items():
        off = (found[name] - want).abs() > 1e-4 + 2e-3 * want.abs()
        few = 0.02 if "direct light" in name else 0.1 if "fog" in name else 0.05  # fog is the mean of up to 136 rays
        assert off.any(dim=1).float().mean() < few, f"{name}: few paths graze an edge or a choice"
        assert want.isfinite().all(), name
    assert all(want.std() > 0 for want in wanted.values())


def test_the_simulated_cuda_form_finds_what_the_cpu_finds(tmp_path: Path) -> None:
    found, ran = answers_of(SCRIPT, tmp_path / "answers.pt")
    integrators = ("occlusion", "indirect", "lit", "reflected", "lobes")
    lamps = "candidates_tile", "list_pixel", "pack_pixel", "first_pixel", "finish_pixel"
    fog = "weigh", *(f"from_{light}_steps" for light in ("sun", "sky", "lamps"))
    assert ran >= {"radiance_path", *lamps, *fog, *(f"{name}_paths" for name in integrators)}
    check(found)


@pytest.mark.skipif(not torch.cuda.is_available(), reason="there is no GPU")
def test_the_cuda_form_finds_what_the_cpu_finds() -> None:
    pytest.importorskip("numba_cuda")
    check(light_paths.answers("cuda"))
