"""Leave passes out one at a time to compare what each does to the picture."""

from pathlib import Path

import torch

import tracer
from gbufrt.files.png import write_png
from gbufrt.metrics.image import psnr
from post import me1

out = Path("out")
scene = tracer.load("valley")
frame = tracer.render(scene, scene.views["lake"].camera(0.0, size=(270, 480)), light_samples=4)

pipeline = me1("high")
variants = {"everything": pipeline}
for name in ("ao", "gi", "reflection", "behind", "gi.denoise", "reflection.denoise", "depth_of_field", "fxaa"):
    variants[f"without {name}"] = pipeline.without(name)
variants["horizon GTAO"] = pipeline.with_tunables({"ao.estimate.method": "horizon"})
variants["wide AO"] = pipeline.with_tunables({"gtao.radius": 6.0})

with torch.no_grad():
    pictures = {name: variant(frame)[0].read("image") for name, variant in variants.items()}
for name, picture in pictures.items():
    write_png(out / f"{name.replace(' ', '_')}.png", picture)
    if name != "everything":
        print(f"{name:28s} differs from everything by PSNR {float(psnr(picture, pictures['everything'])):5.1f} dB")
