"""A part of a Minecraft world by evening light: load it, look around, finish a frame.

    python samples/render_region.py SAVE_OR_REGION [X Z]

Needs `pip install gbufrt[worlds]`.
"""

import sys
from pathlib import Path

import torch

import tracer
from gbufrt.files.png import write_png
from post import me1

path, *place = sys.argv[1:]
around = (int(place[0]), int(place[1])) if place else None
scene = tracer.load(path, around=around, chunks=12)  # 12 x 12 chunks round the place, the player or the middle
scene = tracer.at_hour(scene, 17.2)  # the sun is low in the west, and lamps begin to show

used = scene.world.bricks.unique().tolist()
print(f"{len(used) - 1} materials:", ", ".join(scene.world.materials.names[n] for n in used[1:9]), "...")
print("views:", ", ".join(f"{name} ({view.description})" for name, view in scene.views.items()))

camera = scene.views["landscape"].camera(time=0.0, size=(270, 480))
pipeline = me1("medium")
with torch.no_grad():
    frame, state = pipeline(tracer.render(scene, camera))
write_png(Path("region.png"), frame.read("image"))
