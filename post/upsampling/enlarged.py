"""Stages at the size of the display, after `post.Upscale`: they see a G-buffer as large as the picture."""

from __future__ import annotations

from dataclasses import dataclass

from gbufrt import Frame, GBuffer
from gbufrt.compute.resident import resident
from gbufrt.reduction import Reduction
from post.upsampling.samples import Samples


@dataclass(frozen=True)
class Enlarged(Reduction):
    """A frame as large as its ``color``, each pixel with the geometry of the nearest sample.

    Stages see the picture, the exposure, and signals of the user's own; what they write comes back as it is. Where the
    picture is no larger than the G-buffer they see the frame itself.
    """

    def reduce(self, frame: Frame) -> Frame:
        picture, g = frame.read("color"), frame.gbuffer
        size = picture.shape[-2], picture.shape[-1]
        if size == g.camera.size:
            return frame
        signals = {name: frame.get(name) for name in ("environment", "color", "exposure", "image")}
        large = Frame(gbuffer=enlarged(g, size), index=frame.index, time=frame.time, cut=frame.cut, extra=frame.extra)
        return large.replace(**signals)

    def restored(self, written: frozenset[str]) -> frozenset[str]:
        return written

    def restore(self, frame: Frame, reduced: Frame, names: frozenset[str]) -> Frame:
        for name in sorted(names):
            if (signal := reduced.get(name)) is not None:
                frame = frame.write(name, signal)
        return frame


def enlarged(g: GBuffer, size: tuple[int, int]) -> GBuffer:
    """The G-buffer of a picture of ``size`` ``(H, W)``, each pixel as the sample nearest to it; motion grows with it.

    Its camera has no jitter.
    """
    at = Samples.of(g.camera.size, size, g.camera.jitter, g.depth)
    channels = {name: at.nearest(getattr(g, name)) for name in g.present}
    if "motion" in channels:
        channels["motion"] = channels["motion"] * resident(at.ratio, g.depth)[None, :, None, None]
    before = None if g.previous_camera is None else g.previous_camera.resized(size)
    return GBuffer(camera=g.camera.resized(size), previous_camera=before, **channels)
