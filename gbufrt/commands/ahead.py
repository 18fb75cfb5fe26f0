"""Compile the kernels of the passes in a second process while the first one builds and traces its world.

Compilation takes a quarter of the first render after an installation; a lock in numba prevents doing it in threads.
Where the kernels are cached already, or there is one core, nothing happens.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gbufrt.commands.session import Recipe
    from gbufrt.frame import Frame
    from gbufrt.pipeline import Pipeline

COMPILED = ("GTAO", "SSGI")
"""Passes that run `post.sweep.op`, which takes the longest to compile."""
SIDE = 16  # pixels of the frame that the kernels are compiled for; they fit any size


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
    from gbufrt.compute.cache import tell
    from post.sweep.drivers import sweep_all

    if not sweep_all.missing:
        return lambda: None
    command = [sys.executable, "-m", "gbufrt.commands.ahead", json.dumps(recipe.to_notes())]
    quiet, environment = subprocess.DEVNULL, os.environ | {"OMP_NUM_THREADS": "1"}
    process = subprocess.Popen(command, stdin=quiet, stdout=quiet, stderr=quiet, env=environment)

    def wait() -> None:
        if process.poll() is None:
            tell(True)
            process.wait()
            tell(False)

    return wait


def small_frame() -> Frame:
    """A wall in front of the camera, with all that passes read from a frame of the tracer."""
    import torch

    from gbufrt import Camera, Frame, GBuffer

    camera = Camera.look_at((0.0, 0.0, 5.0), (0.0, 0.0, 0.0), size=(SIDE, SIDE), fov_y=50.0, far=100.0)
    one = torch.ones(1, 1, SIDE, SIDE)
    color, zero = one.expand(1, 3, SIDE, SIDE) * 0.5, torch.zeros(1, 3, SIDE, SIDE)
    gbuffer = GBuffer(
        camera=camera, previous_camera=camera, depth=5 * one, hit=one > 0, thickness=one, albedo=color, emission=zero,
        normal=torch.tensor([0.0, 0.0, 1.0]).view(1, 3, 1, 1) + zero, motion=zero[:, :2], motion_z=zero[:, :1],
        roughness=0.3 * one, metallic=zero[:, :1],
    )  # fmt: skip
    return Frame(gbuffer=gbuffer, radiance=color, ambient=color, environment=torch.ones(1, 3, 8, 16))


def main(notes: str) -> None:
    """Run a pipeline twice over a small frame, so that its kernels are compiled and kept."""
    from gbufrt.commands.session import Recipe, Runner

    recipe = Recipe.of_notes({"pipeline": json.loads(notes)})
    Runner(recipe.build(), 1)(small_frame())  # the first frame has no history to read


if __name__ == "__main__":
    main(sys.argv[1])
