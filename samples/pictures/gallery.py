"""The pictures of the gallery: left without an effect, right with it. `gallery.py OUT [NAME ...]`."""

import subprocess
import sys
from pathlib import Path

import torch
from grotto import EYE, TARGET, grotto  # samples beside this one
from PIL import Image
from weather import chapel

import tracer
from gbufrt import Camera, Pipeline
from gbufrt.files.png import to_pil
from post import AerialPerspective, me1

SIZE, SAME = (252, 448), "--size 448x252 --warmup 11"
RTX = "--pipeline minecraft-rtx --view flythrough --frames 12"
out = Path(sys.argv[1] if len(sys.argv) > 1 else "out/gallery")
COMMANDS = {  # options of `gbufrt render` on both sides, on the left, on the right; the last frame is shown
    "sun_path": ("--view horizon --hour 12", "--sun-path 0,0", ""),
    "atmosphere": ("--view horizon", "", "--hour 6.2"),
    "waves": ("--view lake --hour 8.5", "", "--waves 0.1"),
    "rain": ("--view plaza --hour 15", "", "--rain 0.8"),
    "god_rays": ("--view hall --hour 16.5 --frames 12", "", "--fog 0.85"),
    "sight": ("--view lake", "", "--set composite.sight=80"),
    "one_path": (RTX, "--without light.diffuse,light.specular,upscale", ""),
    "overlay": ("--view plaza", "", f"--ui {out}/hud.png"),
    "spectator": ("--fov 62 --target 140,31.5,28.5", "--eye 113,34.5,35", "--eye 104,35,40"),
}


def rendered(name: str, side: int) -> torch.Tensor:
    folder, options = out / name / str(side), f"{SAME} {COMMANDS[name][0]} {COMMANDS[name][side]}".split()
    subprocess.run(["gbufrt", "render", *options, "--out", str(folder)], check=True)
    picture = torch.frombuffer(bytearray(Image.open(max(folder.glob("*.png"))).tobytes()), dtype=torch.uint8)
    return picture.view(1, *SIZE, 3).permute(0, 3, 1, 2) / 255


def still(scene: tracer.Scene, camera: Camera, pipeline: Pipeline | None = None) -> torch.Tensor:
    return (pipeline or me1("high")).settle(tracer.render(scene, camera, time=1.3), 12)[0].read("image")


valley = tracer.load("valley")
evening = tracer.at_hour(valley, 17.3)
sun = evening.sun or tracer.Sun()
air = AerialPerspective(sun=sun.direction, irradiance=sun.irradiance, unit=0.008)
far = valley.views["horizon"].camera(1.3, size=SIZE)
inside = Camera.look_at((4.0, 8.5, 2.5), (15.0, 4.5, 22.0), size=SIZE, fov_y=65.0)
MADE = {
    "air": lambda side: still(evening, far, me1("high").with_stage("air", air, after="composite") if side else None),
    "caustics": lambda side: still(grotto(caustics=bool(side)), Camera.look_at(EYE, TARGET, size=SIZE)),
    "stained_glass": lambda side: still(chapel(stained=bool(side)), inside),
}
out.mkdir(parents=True, exist_ok=True)
Image.new("RGBA", (200, 12), (230, 50, 50, 200)).crop((-124, -226, 324, 26)).save(out / "hud.png")
for name in sys.argv[2:] or [*COMMANDS, *MADE]:
    with torch.no_grad():
        left, right = (rendered(name, side + 1) if name in COMMANDS else MADE[name](side) for side in (0, 1))
    to_pil(torch.cat([left, torch.ones_like(left[..., :2]), right], dim=-1)).save(out / f"{name}.jpg", quality=86)
