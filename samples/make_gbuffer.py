"""Trace a G-buffer, look at its channels, and keep it as an OpenEXR file."""

from pathlib import Path

import tracer
from gbufrt.files.exr import read_exr, write_exr
from gbufrt.files.png import write_png
from gbufrt.files.views import debug_view

out = Path("out")
scene = tracer.load("valley")
view = scene.views["lake"]

# A camera now and a thirtieth of a second ago: motion vectors come from the two.
now, before = 1.0, 1.0 - 1 / 30
camera, previous = (view.camera(time, size=(270, 480)) for time in (now, before))
frame = tracer.render(scene, camera, previous_camera=previous, time=now, previous_time=before, light_samples=4)
frame.gbuffer.validate()

for name in frame.gbuffer.present:
    write_png(out / f"{name}.png", debug_view(frame, name))
write_exr(out / "lake.exr", frame)

again = read_exr(out / "lake.exr")
print("channels:", ", ".join(again.gbuffer.present))
print("depth from", float(again.gbuffer.depth.min()), "to", float(again.gbuffer.depth[again.gbuffer.hit].max()))
