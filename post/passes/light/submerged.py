"""Sky light under water: what comes through the surface, as the surface has it."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt import Frame, GBuffer, Pass

ENOUGH = 0.9  # share of the way to what is behind that must lead through bodies without air


class Submerged(Pass):
    """Tell the layer behind how open the surface above it is, which its own picture does not show.

    Of what lies under water that picture shows the bottom alone, under open sky. The bottom of a pool in a cave gets
    no more of the sky than the pool's surface. It is written as ``surface_sky``, ``(B, 1, H, W)``, on the layer behind:
    1 for what lies beyond air, as behind a pane.
    """

    reads = frozenset({"depth"})
    optional = frozenset({"behind", "thickness", "ao", "sky_visibility"})
    writes = frozenset[str]()

    def forward(self, frame: Frame) -> Frame:
        behind, open_sky = frame.behind, frame.ao if frame.sky_visibility is None else frame.sky_visibility
        if behind is None or open_sky is None or frame.gbuffer.thickness is None:
            return frame
        share = torch.where(_lies_within(frame.gbuffer, behind.gbuffer), open_sky, 1.0)
        return frame.replace(behind=behind.write("surface_sky", share))


def _lies_within(front: GBuffer, behind: GBuffer) -> Tensor:
    """``(B, 1, H, W)`` bool: whether no air lies between the first surface and what is behind it."""
    assert front.thickness is not None
    camera = front.camera
    through = front.thickness * camera.along_axis(front.depth.dtype)
    return behind.hit & (through >= ENOUGH * (behind.depth - front.depth))
