"""Answers in the CUDA form by numba's simulator of a GPU, in a process of its own.

A script whose ``answers`` are wanted ends in ``save(answers)``; a test calls `answers_of` with it.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

ROOT = Path(__file__).parents[2]


def answers_of(script: Path, out: Path) -> tuple[dict[str, Tensor], set[str]]:
    """What a script finds, by name, and the names of the bodies that ran; ``out`` is a file to hand them over."""
    paths = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    environment = os.environ | {"NUMBA_ENABLE_CUDASIM": "1", "PYTHONPATH": paths}
    done = subprocess.run([sys.executable, str(script), str(out)], env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return torch.load(out)


def save(answers: Callable[[], dict[str, Tensor]]) -> None:
    """Find the answers, and save them where the command line says."""
    from gbufrt.compute import cuda  # imports the compiler

    launch, ran = cuda.launch, set()

    def watched(body: Any, *given: Any) -> None:
        ran.add(body.__name__)
        launch(body, *given)

    cuda.launch = watched
    found = answers()
    torch.save((found, ran), sys.argv[1])
