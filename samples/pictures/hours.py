"""A day over the village in six pictures: dawn, morning, noon, dusk, moonlight, and a night without moon."""

from pathlib import Path

import torch

import tracer
from gbufrt.files.png import to_pil
from post import AerialPerspective, me1

out = Path("out/hours.jpg")
hours = ((5.9, 0.0), (7.5, 0.0), (12.0, 0.0), (17.8, 0.0), (21.5, 0.0), (23.0, 14.8))
valley = tracer.load("valley")
camera = valley.views["village"].camera(0.0, size=(270, 480))
pictures = []
for hour, day in hours:
    scene = tracer.at_hour(valley, hour, day=day)
    assert scene.sun is not None
    frame = tracer.render(scene, camera, light_samples=4)
    air = AerialPerspective(sun=scene.sun.direction, irradiance=scene.sun.irradiance, unit=0.004)
    pipeline = me1("high").with_stage("air", air, after="composite")
    with torch.no_grad():
        frame, _ = pipeline.settle(frame, 12)
    pictures.append(frame.read("image")[0])
    print(f"{hour:4.1f} h, sun or moon at {scene.sun.irradiance}")
rows = [torch.cat(pictures[i : i + 2], dim=2) for i in range(0, len(pictures), 2)]
out.parent.mkdir(parents=True, exist_ok=True)
to_pil(torch.cat(rows, dim=1)[None]).save(out, quality=88)
