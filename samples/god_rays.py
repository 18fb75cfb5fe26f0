"""God rays: the evening sun through the arches of the hall, in fog."""

from dataclasses import replace
from pathlib import Path

import torch

import tracer
from gbufrt.files.png import to_pil
from post import me1, with_fog

out = Path("out/fog.jpg")
scene = tracer.at_hour(tracer.load("valley"), 16.5)
scene = replace(scene, fog=tracer.Fog(extinction=0.02))
camera = scene.views["hall"].camera(0.0, size=(270, 480))
frames = (tracer.render(scene, camera, light_samples=2, index=i) for i in range(12))  # a still, each with other noise
with torch.no_grad():
    *_, frame = with_fog(me1("low")).stream(frames)
out.parent.mkdir(parents=True, exist_ok=True)
to_pil(frame.read("image")).save(out, quality=88)
