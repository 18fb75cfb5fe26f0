"""Write your own pass: height fog, as a function and a thin module, set into the pipeline before the lens."""

from pathlib import Path

import torch
from torch import Tensor

import tracer
from gbufrt import Camera, Frame, Pass
from gbufrt.files.png import write_png
from post import me1


def height_fog(color: Tensor, depth: Tensor, hit: Tensor, camera: Camera, *, density: float, height: float) -> Tensor:
    """Fade surfaces into a pale fog that thins with world height; the sky stays."""
    points = camera.to_world(camera.unproject(depth))
    above = (points[:, 1:2] - height).clamp_min(0)
    amount = 1 - torch.exp(-density * depth * torch.exp(-0.1 * above))
    fog = color.new_tensor([0.6, 0.7, 0.8])[None, :, None, None]
    return torch.where(hit, torch.lerp(color, fog.expand_as(color), amount), color)


class HeightFog(Pass):
    """See `height_fog`."""

    reads = frozenset({"color", "depth", "hit"})
    writes = frozenset({"color"})

    def __init__(self, *, density: float = 0.01, height: float = 20.0) -> None:
        super().__init__()
        self.density, self.height = density, height

    def forward(self, frame: Frame) -> Frame:
        g = frame.gbuffer
        return frame.replace(color=height_fog(frame.read("color"), g.depth, g.hit, g.camera, **self.tunables()))


scene = tracer.load("valley")
frame = tracer.render(scene, scene.views["village"].camera(0.0, size=(270, 480)), light_samples=4)
pipeline = me1("medium").with_stage("fog", HeightFog(density=0.02), after="composite")
with torch.no_grad():
    result, _ = pipeline(frame)
write_png(Path("out") / "fog.png", result.read("image"))
print(pipeline.all_tunables()["fog.density"], "is the fog's density; see out/fog.png")
