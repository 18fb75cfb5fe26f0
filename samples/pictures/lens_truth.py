"""Motion blur and depth of field beside their truth: the path tracer through the lens on the left, our pass over its
sharp picture on the right. Takes some minutes."""

import sys
from pathlib import Path
from typing import Any

import torch

import tracer
from gbufrt import Pass, Pipeline, TemporalPass
from gbufrt.files.png import to_pil
from post import DepthOfField, DisplayEncode, MotionBlur, ToneMap

SIZE, TIME, STEP = (252, 448), 1.3, 1 / 24
out = Path(sys.argv[1] if len(sys.argv) > 1 else "out")
valley = tracer.load("valley")


def save(file: str, view: str, effect: Pass | TemporalPass, lens: dict[str, Any]) -> None:
    camera = lambda time: valley.views[view].camera(time, size=SIZE)
    frame = tracer.render(valley, camera(TIME), previous_camera=camera(TIME - STEP), time=TIME, light_samples=1)
    truths = (tracer.path_trace(valley, camera, time=TIME, samples=192, **way) for way in (lens, {}))
    true, sharp = (truth.values["radiance"] for truth in truths)
    ours, _ = Pipeline(given={"color"}, lens=effect)(frame.replace(color=sharp))
    show = Pipeline(given={"color"}, tone_map=ToneMap(), encode=DisplayEncode())
    left, right = (show(frame.replace(color=color))[0].read("image") for color in (true, ours.read("color")))
    to_pil(torch.cat([left, torch.ones_like(left[..., :2]), right], dim=-1)).save(out / f"{file}.jpg", quality=86)


out.mkdir(parents=True, exist_ok=True)
with torch.no_grad():
    similar = MotionBlur(weights="similarity", shutter=1.0, samples=32)
    save("similarity", "flythrough", similar, {"shutter": STEP, "shutter_offset": -STEP / 2})
    save("thin_lens", "closeup", DepthOfField(aperture_radius=0.3), {"aperture_radius": 0.3})
