"""A bath that the sun enters below a lintel: what it reflects from the waves dances on walls and ceiling."""

from pathlib import Path

import torch

import tracer
from gbufrt import Camera
from gbufrt.files.png import to_pil
from post import me1

EYE, TARGET = (33.0, 6.0, 25.0), (14.0, 6.0, 2.0)


def grotto(*, caustics: bool) -> tracer.Scene:
    """Water between white walls, open to a low sun behind three columns."""
    plaster = tracer.Material(name="plaster", albedo=(0.8, 0.77, 0.72), variation=0.0)
    water = tracer.Material(
        name="water", albedo=(0.02, 0.09, 0.11), roughness=0.05, opacity=0.3, tint=(0.62, 0.86, 0.88), variation=0.0
    )
    voxels = torch.zeros(44, 16, 34, dtype=torch.int16)
    voxels[:, 0], voxels[:, 1:4, :30], voxels[:, 1:4, 30:], voxels[:, 12, :28] = 1, 2, 1, 1
    voxels[:, 1:13, 0], voxels[0, 1:13, :28], voxels[43, 1:13, :28] = 1, 1, 1
    for x in (10, 21, 32):
        voxels[x : x + 2, 1:12, 26:28] = 1
    return tracer.Scene(
        world=tracer.World.from_dense(voxels, tracer.MaterialTable.of([plaster, water])),
        sun=tracer.Sun(direction=(0.35, 0.36, 1.0), irradiance=(16.0, 14.0, 11.0)),
        waves=tracer.Waves(amplitude=0.06, frequency=0.12, caustics=40.0 if caustics else 0.0),
    )


if __name__ == "__main__":
    camera = Camera.look_at(EYE, TARGET, size=(270, 480), fov_y=60.0)
    with torch.no_grad():
        frame, _ = me1("high").settle(tracer.render(grotto(caustics=True), camera, time=1.3), 12)
    out = Path("out/grotto.png")
    out.parent.mkdir(parents=True, exist_ok=True)
    to_pil(frame.read("image")).save(out)
