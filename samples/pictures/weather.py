"""Weather in six pictures: the plaza dry and in rain, the lake still and with waves, a chapel with clear and stained
glass."""

from dataclasses import replace
from pathlib import Path

import torch

import tracer
from gbufrt import Camera
from gbufrt.files.png import to_pil
from post import me1

SIZE = (270, 480)
PANES = ((0.9, 0.15, 0.1), (0.95, 0.75, 0.1), (0.1, 0.6, 0.2), (0.1, 0.25, 0.9))


def chapel(*, stained: bool) -> tracer.Scene:
    """A white room whose south wall is a window, with a second window behind a part of it."""
    glass = [
        tracer.Material(name=f"pane {n}", albedo=(0.1, 0.1, 0.1), roughness=0.05, opacity=0.1, variation=0.0,
                        tint=tint if stained else (0.95, 0.95, 0.95))
        for n, tint in enumerate(PANES)
    ]  # fmt: skip
    table = tracer.MaterialTable.of([tracer.Material(name="plaster", albedo=(0.8, 0.78, 0.74)), *glass])
    voxels = torch.zeros(26, 16, 36, dtype=torch.int16)
    voxels[:, 0], voxels[:, 13, :28], voxels[0, :14, :28], voxels[25, :14, :28], voxels[:, :14, 0] = 1, 1, 1, 1, 1
    voxels[:, :14, 27] = 1
    for n in range(6):
        voxels[2 + 4 * n : 5 + 4 * n, 3:12, 27] = 2 + n % 4
        voxels[2 + 4 * n : 5 + 4 * n, 3:7, 30] = 2 + (n + 1) % 4  # light passes both
    sun = tracer.Sun(direction=(0.25, 0.5, 1.0), irradiance=(9.0, 8.5, 8.0))
    return tracer.Scene(world=tracer.World.from_dense(voxels, table), sun=sun)


def picture(scene: tracer.Scene, camera: Camera) -> torch.Tensor:
    frame = tracer.render(scene, camera, time=1.3, light_samples=4)
    with torch.no_grad():
        return me1("high").settle(frame, 12)[0].read("image")[0]


if __name__ == "__main__":
    valley = tracer.load("valley")
    plaza, lake = (valley.views[name].camera(1.3, size=SIZE) for name in ("plaza", "lake"))
    inside = Camera.look_at((4.0, 8.5, 2.5), (15.0, 4.5, 22.0), size=SIZE, fov_y=65.0)
    day = tracer.at_hour(valley, 15.0)
    morning = tracer.at_hour(valley, 8.5)
    pairs = (
        (picture(day, plaza), picture(tracer.raining(day, 0.8), plaza)),
        (picture(morning, lake), picture(replace(morning, waves=tracer.Waves()), lake)),
        (picture(chapel(stained=False), inside), picture(chapel(stained=True), inside)),
    )
    out = Path("out/weather.jpg")
    out.parent.mkdir(parents=True, exist_ok=True)
    to_pil(torch.cat([torch.cat(pair, dim=2) for pair in pairs], dim=1)[None]).save(out, quality=88)
