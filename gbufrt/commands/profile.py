"""Hooks around each pass of a pipeline, to measure its time or memory."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from gbufrt.pipeline import Pipeline


@contextmanager
def around_passes(pipeline: Pipeline, begin: Callable[[str], Any], end: Callable[[str, Any], Any]) -> Iterator[None]:
    """Call ``begin(name)`` before each pass, and after it ``end(name, what begin returned)``."""
    begun: dict[str, Any] = {}
    hooks = []
    for name, stage in pipeline.passes():
        hooks.append(stage.register_forward_pre_hook(lambda *_, n=name: begun.update({n: begin(n)})))
        hooks.append(stage.register_forward_hook(lambda *_, n=name: end(n, begun.pop(n))))
    try:
        yield
    finally:
        for hook in hooks:
            hook.remove()
