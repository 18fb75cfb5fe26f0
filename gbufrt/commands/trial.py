"""Settings are tried on a small frame: most passes look at their tunables when they run, after a world was traced."""

from __future__ import annotations

import warnings
from typing import Any

import torch

from gbufrt.commands.arguments.settings import blamed
from gbufrt.commands.recipe import Recipe
from gbufrt.files.png import read_rgba
from gbufrt.frame import SIGNALS, Frame
from gbufrt.gbuffer import CHANNELS
from gbufrt.passes import Stage
from gbufrt.pipeline import Pipeline
from gbufrt.specimen import specimen

PICTURE = "picture"  # a file as large as the frames, which the small one is not: it is read alone
REFUSED = (ValueError, TypeError, ArithmeticError, LookupError, RuntimeError)  # what torch says of numbers, too


def tried(recipe: Recipe, device: torch.device) -> Pipeline:
    """The recipe's pipeline, each of whose passes with a setting has run over a small frame.

    Raises:
        ValueError: see `Recipe.build`; or a pass refuses a value: names setting and value; or a picture has no alpha.
        FileNotFoundError: there is no such picture.
    """
    pipeline, whole = recipe.build(), recipe.whole()
    stages, settings = dict(pipeline.passes()), dict[str, dict[str, Any]]()
    for name, value in recipe.set.items():
        path, _, key = whole.resolve(name).rpartition(".")
        if key == PICTURE and value:
            read_rgba(value)
        elif path in stages:
            settings.setdefault(path, {})[name] = value
    for path, told in settings.items():
        stage = stages[path]
        try:
            with torch.no_grad(), warnings.catch_warnings(action="ignore"):
                Pipeline(given=stage.reads - CHANNELS.keys(), stage=stage)(_frame(stage).to(device))
        except REFUSED as error:
            raise ValueError(blamed(told, error)) from error
    return pipeline


def check_overlays(pipeline: Pipeline, size: tuple[int, int]) -> None:
    """Raise ValueError where a picture to lay over frames is of another size than they will be.

    Args:
        pipeline: that lays it over them.
        size: ``(H, W)`` of the G-buffers, which `post.Upscale` enlarges.
    """
    from post.passes.display.overlay import read_overlay

    for _, stage in pipeline.passes():
        told = stage.tunables()
        if type(stage).__name__ == "Upscale":
            size = round(size[0] * told["ratio"]), round(size[1] * told["ratio"])
        if told.get(PICTURE):
            read_overlay(told[PICTURE], size)


def _frame(stage: Stage) -> Frame:
    """A small frame with all signals that a stage reads."""
    frame = specimen()
    for name in sorted(stage.reads - CHANNELS.keys()):
        if frame.get(name) is None:
            size = SIGNALS[name].components if name in SIGNALS else 1
            frame = frame.write(name, 0.5 * torch.ones_like(frame.gbuffer.depth).expand(-1, size, -1, -1))
    return frame
