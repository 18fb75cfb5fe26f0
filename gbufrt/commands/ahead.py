"""Compile the kernels of the passes in a second process while the first one builds and traces its world.

Compilation takes most of the first render after an installation; a lock in numba prevents doing it in threads.
Where the kernels are cached already, or there is one core, nothing happens.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gbufrt.commands.recipe import Recipe
    from gbufrt.pipeline import Pipeline

COMPILED = ("GTAO", "SSGI")
"""Passes that run `post.sweep.op`, which takes the longest to compile."""


def compile_ahead(recipe: Recipe, pipeline: Pipeline, device: str) -> Callable[[], None]:
    """Start where it pays, and return a function that waits for the end; on failure, kernels compile when called.

    Args:
        recipe: what the pipeline is made of.
        pipeline: the recipe's; it tells whether the kernels are needed.
        device: where it will run.
    """
    from gbufrt.commands.busy import cores

    swept = any(type(stage).__name__ in COMPILED for _, stage in pipeline.passes())
    if device != "cpu" or cores() < 2 or not swept:
        return lambda: None
    from gbufrt.compute.cache import Compilation, tell
    from post.sweep.drivers import sweep_all

    if not sweep_all.missing:
        return lambda: None
    command = [sys.executable, "-m", "gbufrt.commands.ahead", json.dumps(recipe.to_notes())]
    quiet, environment = subprocess.DEVNULL, os.environ | {"OMP_NUM_THREADS": "1"}
    process = subprocess.Popen(command, stdin=quiet, stdout=quiet, stderr=quiet, env=environment)

    def wait() -> None:
        if process.poll() is None:
            begun = time.perf_counter()
            tell(Compilation(sweep_all.name))
            process.wait()
            tell(Compilation(sweep_all.name, time.perf_counter() - begun))

    return wait


def main(notes: str) -> None:
    """Compile the kernels of a pipeline, and keep them."""
    from gbufrt.commands.recipe import Recipe

    Recipe.of_notes({"pipeline": json.loads(notes)}).build().compile()


if __name__ == "__main__":
    main(sys.argv[1])
