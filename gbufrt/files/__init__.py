"""Reading and writing of files: EXR and its guard, G-buffers of other renderers, PNG, debug views."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gbufrt.files.gbuffers.read import read_gbuffer

__all__ = ["read_gbuffer"]


def __getattr__(name: str) -> Any:
    """`read_gbuffer`, when it is first asked for: it loads torch, and the limits of files are wanted without."""
    if name != "read_gbuffer":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from gbufrt.files.gbuffers.read import read_gbuffer

    return read_gbuffer
