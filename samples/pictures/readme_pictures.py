"""The README's pictures: the left half without a pass, the right half with it. Takes some minutes."""

import sys
from pathlib import Path

import torch

import tracer
from gbufrt import Camera, Frame, Pipeline
from gbufrt.files.png import to_pil
from gbufrt.noise.noise import halton_jitter
from post import me1

SIZE = (288, 512)
out = Path(sys.argv[1] if len(sys.argv) > 1 else "out")
out.mkdir(parents=True, exist_ok=True)
scene = tracer.load("valley")


def traced(name: str, count: int = 1, time: float = 0.0, fps: int = 24) -> list[Frame]:
    """Consecutive frames of a view; several are jittered and move."""

    def camera(i: int) -> Camera:
        jitter = halton_jitter(i) if count > 1 else None
        return scene.views[name].camera(time + i / fps, size=SIZE).with_jitter(jitter)

    def frame(i: int) -> Frame:
        now, before = time + i / fps, time + (i - 1) / fps
        return tracer.render(scene, camera(i), previous_camera=camera(i - 1), time=now, previous_time=before, index=i)

    return [frame(i) for i in range(count)]


def save(name: str, frames: list[Frame], left: Pipeline, right: Pipeline) -> None:
    """Save the last frame: left half by one pipeline, right half by the other, a line between."""
    with torch.no_grad():
        a, b = (list(pipeline.stream(frames))[-1].read("image") for pipeline in (left, right))
    middle = a.shape[-1] // 2
    line = torch.ones_like(a[..., :2])
    to_pil(torch.cat([a[..., : middle - 1], line, b[..., middle + 1 :]], dim=-1)).save(out / f"{name}.jpg", quality=88)


still = me1("high").without("motion_blur", "depth_of_field")
fast = me1("high", tunables={"motion_blur.shutter": 1.0}).without("fxaa", "depth_of_field")
original = me1("high", composite="me1").without("motion_blur", "depth_of_field")
closeup, plaza, lake, cave, orbit = *map(traced, ("closeup", "plaza", "lake", "cave")), traced("orbit", 6, 1.0)
save("ao", closeup, original.without("ao"), original)
save("gi", cave, still.without("gi"), still)
save("reflection", lake, still.without("reflection"), still)
noisy = still.without("ao.denoise", "gi.denoise", "reflection.denoise")
once = noisy.without("ao.accumulate", "gi.accumulate", "reflection.accumulate")
save("denoise", plaza, once, still)
save("accumulate", [f.replace(index=i) for i in range(8) for f in plaza], once, noisy)
save("composite", cave, original, still)
save("motion_blur", traced("orbit", 6, 1.0, fps=4), fast.without("motion_blur"), fast)
save("taa", orbit, still.without("fxaa", "taa"), still.without("fxaa"))
save("depth_of_field", closeup, still, me1("high", tunables={"depth_of_field.aperture_radius": 0.4}))
for name in ("exposure", "vignette", "fxaa"):
    save(name, plaza, still.without(name), still)
save("tone_map", plaza, still.with_tunables({"tone_map.operator": "linear"}), still)
