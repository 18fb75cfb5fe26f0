"""Reading and writing of files: EXR and its guard, G-buffers of other renderers, PNG, debug views."""

from gbufrt.files.gbuffers.read import read_gbuffer

__all__ = ["read_gbuffer"]
