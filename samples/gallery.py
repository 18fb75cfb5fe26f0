"""The pictures of the gallery: each effect left out on the left, or its truth, and at work on the right.

`python samples/gallery.py OUT [NAME ...]` makes those named, by default all, in some minutes.
"""

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy
import torch
from torch import Tensor
from weather import chapel  # the sample beside this one

import tracer
from gbufrt import Camera, Frame, Pass, Pipeline
from gbufrt.files.png import to_pil
from gbufrt.files.views import layers_sheet
from gbufrt.noise.noise import halton_jitter
from post import AerialPerspective, DepthOfField, DisplayEncode, MotionBlur, ToneMap, me1, minecraft_rtx, with_fog

SIZE, SMALL, FPS = (252, 448), (126, 224), 24
valley = tracer.load("valley")
afternoon, morning = tracer.at_hour(valley, 15.0), tracer.at_hour(valley, 8.5)
inside = Camera.look_at((4.0, 8.5, 2.5), (15.0, 4.5, 22.0), size=SIZE, fov_y=65.0)
rock = Camera.look_at((104.0, 35.0, 40.0), (140.0, 31.5, 28.5), size=SIZE, fov_y=62.0)


def seen(name: str, time: float = 1.3, size: tuple[int, int] = SIZE) -> Camera:
    return valley.views[name].camera(time, size=size)


def picture(scene: tracer.Scene, camera: Camera, pipeline=None, **tunables: object) -> Tensor:
    """A settled still of ``me1("high")``, or of another pipeline."""
    pipeline = (pipeline or me1("high").without("motion_blur", "depth_of_field")).with_tunables(tunables)
    frame = tracer.render(scene, camera, time=1.3, light_samples=4)
    return pipeline.settle(frame, 12)[0].read("image")


def flight(name: str, count: int, size: tuple[int, int] = SIZE) -> list[Frame]:
    """Consecutive jittered frames of a view, with light of one sample a pixel."""

    def camera(i: int) -> Camera:
        return seen(name, i / FPS, size).with_jitter(halton_jitter(i, length=32))

    frames: list[Frame] = []
    for i in range(count):
        now, before = i / FPS, (i - 1) / FPS
        frame = tracer.render(valley, camera(i), previous_camera=camera(i - 1), time=now, previous_time=before, index=i)
        frames.append(tracer.sampled(valley, frame, before=frames[-1] if frames else None).replace(ambient=None))
    return frames


def lens(name: str, effect: Pass, **lens: float) -> tuple[Tensor, Tensor]:
    """The path tracer through a lens, and our pass over the path tracer's sharp picture."""
    moving = lambda time: valley.views[name].camera(time, size=SIZE)
    g = tracer.render(valley, seen(name), previous_camera=seen(name, 1.3 - 1 / FPS), time=1.3, light_samples=1)
    light = [tracer.path_trace(valley, moving, time=1.3, samples=192, **way).radiance for way in (lens, {})]
    show = Pipeline(tone_map=ToneMap(), encode=DisplayEncode())
    ours, _ = Pipeline(lens=effect)(g.replace(color=light[1]))
    return tuple(show(g.replace(color=color))[0].read("image") for color in (light[0], ours.read("color")))


def god_rays() -> tuple[Tensor, Tensor]:
    foggy = replace(tracer.at_hour(valley, 16.5), fog=tracer.Fog(extinction=0.02))
    frames = [tracer.render(foggy, seen("hall", 0.0), light_samples=2, index=i) for i in range(12)]
    pipelines = me1("high"), with_fog(me1("high"))
    return tuple(list(pipeline.stream(frames))[-1].read("image") for pipeline in pipelines)


def air() -> tuple[Tensor, Tensor]:
    evening = tracer.at_hour(valley, 17.3)
    haze = AerialPerspective(sun=evening.sun.direction, irradiance=evening.sun.irradiance, unit=0.008)
    with_air = me1("high").with_stage("air", haze, after="composite")
    return picture(evening, seen("horizon")), picture(evening, seen("horizon"), with_air)


def noisy(count: int = 12) -> tuple[Tensor, Tensor]:
    """Light of one path a pixel as it is sampled, and the finished frame, twice as large."""
    frames = flight("flythrough", count, SMALL)
    *_, done = minecraft_rtx("high").stream(frames)
    raw = done.replace(color=done.diffuse * done.gbuffer.albedo + done.specular + done.read("radiance"))
    show = Pipeline(tone_map=ToneMap(), encode=DisplayEncode())
    before = show(raw.replace(image=None))[0].read("image")
    return before.repeat_interleave(2, 2).repeat_interleave(2, 3), done.read("image")


def layers() -> Tensor:
    """What a pixel shows first, and what stands behind glass and water, side by side."""
    frame, _ = me1("high")(tracer.render(morning, seen("lake", size=SMALL), time=1.3))
    return torch.from_numpy(numpy.array(layers_sheet(frame, width=384))).permute(2, 0, 1)[None] / 255


def overlay() -> tuple[Tensor, Tensor]:
    """A bar and a cross-hair, over motion blur, depth of field and exposure that do not touch them."""
    hud = torch.zeros(1, 4, *SIZE)
    hud[:, :, 226:238, 124:324] = torch.tensor([0.1, 0.1, 0.1, 0.6])[:, None, None]
    hud[:, :, 229:235, 128:268] = torch.tensor([0.9, 0.2, 0.2, 1.0])[:, None, None]
    hud[:, :, 125:127, 214:234], hud[:, :, 116:136, 223:225] = 1.0, 1.0
    frame = tracer.render(valley, seen("plaza"), time=1.3)
    return tuple(me1("high").settle(f, 8)[0].read("image") for f in (frame, frame.write("ui", hud)))


straight = tracer.SunPath(zenith=0.0, azimuth=0.0)
wavy = replace(morning, waves=tracer.Waves())
PICTURES: dict[str, Callable[[], Tensor | tuple[Tensor, ...]]] = {
    "sun_path": lambda: tuple(
        picture(tracer.at_hour(valley, 12.0, path=path), seen("village")) for path in (straight, tracer.SunPath())
    ),
    "atmosphere": lambda: tuple(picture(scene, seen("horizon")) for scene in (valley, tracer.at_hour(valley, 6.2))),
    "air": air,
    "waves": lambda: tuple(picture(scene, seen("lake")) for scene in (morning, wavy)),
    "caustics": lambda: tuple(
        picture(replace(morning, waves=tracer.Waves(caustics=reach)), seen("mill")) for reach in (0.0, 16.0)
    ),
    "rain": lambda: tuple(picture(scene, seen("plaza")) for scene in (afternoon, tracer.raining(afternoon, 0.8))),
    "stained_glass": lambda: tuple(picture(chapel(stained=stained), inside) for stained in (False, True)),
    "god_rays": god_rays,
    "sight": lambda: tuple(picture(morning, seen("lake"), **tunables) for tunables in ({}, {"composite.sight": 40.0})),
    "similarity": lambda: lens(
        "flythrough",
        MotionBlur(weights="similarity", shutter=1.0, samples=32),
        shutter=1 / FPS,
        shutter_offset=-0.5 / FPS,
    ),
    "thin_lens": lambda: lens("closeup", DepthOfField(aperture_radius=0.3), aperture_radius=0.3),
    "one_path": noisy,
    "spectator": lambda: tuple(picture(morning, camera) for camera in (seen("cave"), rock)),
    "layers": layers,
    "overlay": overlay,
}

out = Path(sys.argv[1] if len(sys.argv) > 1 else "out/gallery")
out.mkdir(parents=True, exist_ok=True)
for name in sys.argv[2:] or PICTURES:
    with torch.no_grad():
        shown = PICTURES[name]()
    if isinstance(shown, tuple):
        left, right = shown
        shown = torch.cat([left, torch.ones_like(left[..., :2]), right], dim=-1)
    to_pil(shown).save(out / f"{name}.jpg", quality=86)
    print(out / f"{name}.jpg", flush=True)
