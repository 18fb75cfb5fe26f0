"""Diffuse and specular light of surfaces, put together for the composite."""

from __future__ import annotations

import torch

from gbufrt import Frame, Pass


class Outgoing(Pass):
    """Light of one sample a pixel, denoised or not, as `Composite` takes it.

    ``radiance`` becomes emission + albedo x diffuse, and stays what it was where nothing was hit; ``reflection`` is
    ``specular``. As ``diffuse`` holds the light of the sky too, ``ambient`` is taken away. `Composite` then takes from
    diffuse light, and from what is behind, what a dielectric reflects.
    """

    reads = frozenset({"radiance", "diffuse", "specular", "albedo", "hit"})
    optional = frozenset({"emission"})
    writes = frozenset({"radiance", "ambient", "reflection"})

    def forward(self, frame: Frame) -> Frame:
        g = frame.gbuffer
        light = frame.read("albedo") * frame.read("diffuse")
        if g.emission is not None:
            light = light + g.emission
        light = torch.where(g.hit, light, frame.read("radiance"))
        return frame.replace(radiance=light, ambient=None, reflection=frame.specular)
