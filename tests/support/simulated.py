"""Answers in the CUDA form by numba's simulator of a GPU, in a process of its own.

A script whose ``answers`` are wanted ends in ``save(answers)``; a test calls `answers_of` with it.
"""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
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
    from numba.cuda.simulator import kernel

    from gbufrt.compute import cuda  # imports the compiler

    kernel.swapped_cuda_module = swap_of_a_launch()  # pyright: ignore[reportPrivateImportUsage]
    launch, ran = cuda.launch, set()

    def watched(body: Any, *given: Any) -> None:
        ran.add(body.__name__)
        launch(body, *given)

    cuda.launch = watched
    found = answers()
    torch.save((found, ran), sys.argv[1])


def swap_of_a_launch() -> Callable:
    """The simulator's swap of ``cuda`` in a function's module, kept until the kernel ends.

    The simulator's own puts the true module back as one thread leaves a function that others are still inside.
    """
    from numba import cuda

    swapped: dict[str, tuple[dict, list[str]]] = {}  # by module: its names, and those that mean ``cuda``

    @contextmanager
    def swap(function: Any, fake: Any) -> Iterator[None]:
        module = function.__globals__
        if module["__name__"] not in swapped:
            names = [name for name, value in module.items() if value is cuda or value is fake]
            module.update(dict.fromkeys(names, fake))
            swapped[module["__name__"]] = module, names
        try:
            yield
        finally:
            if threading.current_thread() is threading.main_thread():  # the kernel's own swap, the outermost
                for module, names in swapped.values():
                    module.update(dict.fromkeys(names, cuda))
                swapped.clear()

    return swap
