"""Pictures of the gallery that compare two scenes or two tensors, and a sheet of buffers. `pairs.py OUT [NAME ...]`."""

import sys
from dataclasses import replace
from pathlib import Path

import torch
from garden import EYE, TARGET, garden  # a sample beside this one

import tracer
from gbufrt import Camera, Frame
from gbufrt.files.png import to_pil
from gbufrt.files.views import contact_sheet, debug_view
from gbufrt.noise.noise import blue_noise
from post import me1, normals_from_depth

SIZE = (252, 448)
out = Path(sys.argv[1] if len(sys.argv) > 1 else "out/gallery")
valley = tracer.load("valley")


def finished(scene: tracer.Scene, camera: Camera) -> Frame:
    return me1("high").settle(tracer.render(scene, camera, time=1.3), 12)[0]


def seen_from(view: str) -> Camera:
    return valley.views[view].camera(1.3, size=SIZE)


def planted(side: int) -> torch.Tensor:
    camera = Camera.look_at(EYE, TARGET, size=SIZE, fov_y=50.0)
    return finished(garden(out / "garden", textured=bool(side)), camera).read("image")


def shadowed(side: int) -> torch.Tensor:
    sun = tracer.Sun(direction=(-0.8, 0.55, -0.5), irradiance=(7.0, 6.4, 5.4), angular_radius=(4.0, 0.27)[side])
    camera = Camera.look_at((13.0, 9.5, 24.0), (17.0, 4.0, 17.0), size=SIZE)
    return finished(replace(garden(out / "garden", textured=True), sun=sun), camera).read("image")


def noise(side: int) -> torch.Tensor:
    height, width = SIZE[0] // 4, SIZE[1] // 4
    values = blue_noise(height, width)[None] if side else torch.rand(1, 1, height, width)
    return values.repeat_interleave(4, 2).repeat_interleave(4, 3).expand(1, 3, *SIZE)


def normals(side: int) -> torch.Tensor:
    frame = tracer.render(valley, seen_from("hall"))
    guess = normals_from_depth(frame.gbuffer.depth, frame.gbuffer.camera, hit=frame.gbuffer.hit)
    return debug_view(frame.replace(gbuffer=replace(frame.gbuffer, normal=guess)) if side else frame, "normal")


PAIRS = {"garden": planted, "shadows": shadowed, "blue_noise": noise, "normals": normals}
out.mkdir(parents=True, exist_ok=True)
with torch.no_grad():
    contact_sheet(finished(valley, seen_from("village")), columns=7, width=124).save(out / "buffers.jpg", quality=90)
    for name in sys.argv[2:] or PAIRS:
        left, right = (PAIRS[name](side) for side in (0, 1))
        to_pil(torch.cat([left, torch.ones_like(left[..., :2]), right], dim=-1)).save(out / f"{name}.jpg", quality=86)
