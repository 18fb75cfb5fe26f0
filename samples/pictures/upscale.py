"""The README's picture of upscaling: a frame of a flight, and what `Upscale` makes of it. `upscale.py OUT`."""

import sys
from pathlib import Path

import torch

import tracer
from gbufrt import Camera, Frame, Pipeline
from gbufrt.files.png import to_pil
from gbufrt.noise.noise import halton_jitter
from post import DisplayEncode, Enlarged, Exposure, ToneMap, Upscale, me1

FRAMES, FPS, SIZE = 24, 24, (170, 300)
out = Path(sys.argv[1] if len(sys.argv) > 1 else "out")
out.mkdir(parents=True, exist_ok=True)
scene = tracer.load("valley")


def camera(i: int) -> Camera:
    view = scene.views["flythrough"].camera(7.5 + i / FPS, size=SIZE)
    return view.with_jitter(halton_jitter(i, length=32))


def traced(i: int) -> Frame:
    now, before = (7.5 + k / FPS for k in (i, i - 1))
    return tracer.render(scene, camera(i), previous_camera=camera(i - 1), time=now, previous_time=before, index=i)


def shown() -> Pipeline:
    return Pipeline(given={"color"}, exposure=Exposure(), tone_map=ToneMap(), encode=DisplayEncode())


display = ("ui", "fxaa", "encode", "vignette", "tone_map", "pulse", "exposure")
light = me1("high").without(*display, "depth_of_field", "motion_blur", "taa")
large = Pipeline(reduction=Enlarged(), given={"color"}, shown=shown())
with torch.no_grad():
    frames = list(light.stream(map(traced, range(FRAMES))))
    small = list(shown().stream(frames))[-1].read("image")
    fine = list(Pipeline(given={"color"}, upscale=Upscale(), large=large).stream(frames))[-1].read("image")
pair = torch.cat([small.repeat_interleave(2, 2).repeat_interleave(2, 3), torch.ones_like(fine[..., :2]), fine], dim=-1)
to_pil(pair).save(out / "upscale.jpg", quality=88)
