"""The contract of gbufrt: what a frame is, and how passes compose.

Names are imported when they are first used, so that the command line answers before torch is loaded.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from gbufrt.compute.memory import ask_for_large_pages
from gbufrt.compute.threads import wait_briefly

if TYPE_CHECKING:
    from gbufrt.camera import Camera
    from gbufrt.captured import Captured
    from gbufrt.frame import SIGNALS, Frame
    from gbufrt.gbuffer import CHANNELS, GBuffer
    from gbufrt.history import History, PipelineState
    from gbufrt.passes import Pass, Stage, TemporalPass
    from gbufrt.pipeline import Pipeline

__version__ = "0.1.0"
wait_briefly()  # before anything here loads torch
ask_for_large_pages()

_HOMES = {
    "camera": ("Camera",),
    "captured": ("Captured",),
    "frame": ("SIGNALS", "Frame"),
    "gbuffer": ("CHANNELS", "GBuffer"),
    "history": ("History", "PipelineState"),
    "passes": ("Pass", "Stage", "TemporalPass"),
    "pipeline": ("Pipeline",),
}

__all__ = [
    "CHANNELS",
    "SIGNALS",
    "Camera",
    "Captured",
    "Frame",
    "GBuffer",
    "History",
    "Pass",
    "Pipeline",
    "PipelineState",
    "Stage",
    "TemporalPass",
    "__version__",
]


def __getattr__(name: str) -> Any:
    for home, names in _HOMES.items():
        if name in names:
            value = globals()[name] = getattr(import_module(f"gbufrt.{home}"), name)
            return value
    raise AttributeError(f"module 'gbufrt' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
