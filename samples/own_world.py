"""A world of your own: a MagicaVoxel file, a schematic, or an array of numbers; finish a frame of it.

    python samples/own_world.py [FILE.vox or FILE.schem]

Schematics need `pip install gbufrt[worlds]`.
"""

import sys
from pathlib import Path

import torch

import tracer
from gbufrt.files.png import write_png
from post import me1
from tracer.scene.placement import place

if len(sys.argv) > 1:
    scene = tracer.load(sys.argv[1])  # on ground under the sky, with views that frame it
else:
    x, y, z = torch.meshgrid(*(torch.arange(n) for n in (48, 24, 48)), indexing="ij")
    ids = torch.zeros(48, 24, 48, dtype=torch.int16)  # 0 is air; x, y (up), z
    ids[y < 4 + 3 * torch.sin(x / 7) * torch.cos(z / 5)] = 1  # a number is a row of the table of materials
    ids[(x - 24) ** 2 + (y - 12) ** 2 + (z - 24) ** 2 < 36] = 2
    ids[(x - 12) ** 2 + (z - 30) ** 2 + 4 * (y - 11) ** 2 < 9] = 3
    materials = tracer.MaterialTable.of(
        [
            tracer.Material(name="earth", albedo=(0.25, 0.35, 0.12), variation=0.2),
            tracer.Material(name="paint", albedo=(0.7, 0.1, 0.08), roughness=0.3),
            tracer.Material(name="lamp", albedo=(0.8, 0.8, 0.8), emission=(6.0, 4.0, 2.0)),
        ]
    )
    scene = place(tracer.World.from_dense(ids, materials))  # as files are; or a tracer.Scene with views of your own

camera = scene.views["front"].camera(time=0.0, size=(270, 480))
with torch.no_grad():
    frame, state = me1("medium").settle(tracer.render(scene, camera), 4)
write_png(Path("world.png"), frame.read("image"))
