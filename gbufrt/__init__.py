"""The contract of gbufrt: what a frame is, and how passes compose."""

from gbufrt.camera import Camera
from gbufrt.frame import SIGNALS, Frame
from gbufrt.gbuffer import CHANNELS, GBuffer
from gbufrt.history import History
from gbufrt.passes import Pass, Pipeline, PipelineState, Stage, TemporalPass

__version__ = "0.1.0"

__all__ = [
    "CHANNELS",
    "SIGNALS",
    "Camera",
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
