"""A short tour of the ME1 pipeline: frames in, finished pictures out."""

from pathlib import Path

import torch

import tracer
from gbufrt.files.png import write_png
from gbufrt.noise.noise import halton_jitter
from post import me1

out, size, fps = Path("out"), (270, 480), 24
scene = tracer.load("valley")
view = scene.views["orbit"]


def camera(index):
    """Jittered a little differently each frame, which temporal anti-aliasing averages."""
    return view.camera(index / fps, size=size).with_jitter(halton_jitter(index))


def frames(count):
    """Trace a frame when the pipeline asks for it."""
    for i in range(count):
        yield tracer.render(
            scene,
            camera(i),
            previous_camera=camera(i - 1),
            time=i / fps,
            previous_time=(i - 1) / fps,
            index=i,
            light_samples=4,
        )


pipeline = me1("medium", tunables={"tone_map.operator": "aces", "depth_of_field.aperture_radius": 0.1})
with torch.no_grad():
    for frame in pipeline.stream(frames(8)):
        print("frame", frame.index, "exposure", float(frame.read("exposure").mean()))
        write_png(out / f"orbit_{frame.index:02d}.png", frame.read("image"))
