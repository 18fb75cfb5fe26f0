"""The CUDA form of light paths, on a GPU or in numba's simulator of one."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import light_paths
import pytest
import torch
from torch import Tensor

SCRIPT = Path(light_paths.__file__)
ROOT = SCRIPT.parents[2]


def check(found: dict[str, Tensor]) -> None:
    wanted = light_paths.answers()
    assert found.keys() == wanted.keys()
    for name, want in wanted.items():
        off = (found[name] - want).abs() > 1e-3 + 1e-2 * want.abs()
        assert off.any(dim=1).float().mean() < 0.05, f"{name}: few paths graze an edge or a choice"
        assert want.isfinite().all(), name
    assert all(want.std() > 0 for want in wanted.values())


def test_the_simulated_cuda_form_finds_what_the_cpu_finds(tmp_path: Path) -> None:
    out = tmp_path / "answers.pt"
    paths = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    environment = os.environ | {"NUMBA_ENABLE_CUDASIM": "1", "PYTHONPATH": paths}
    done = subprocess.run([sys.executable, str(SCRIPT), str(out)], env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    found, ran = torch.load(out)
    assert "radiance_path" in ran
    check(found)


@pytest.mark.skipif(not torch.cuda.is_available(), reason="there is no GPU")
def test_the_cuda_form_finds_what_the_cpu_finds() -> None:
    pytest.importorskip("numba_cuda")
    check(light_paths.answers("cuda"))
