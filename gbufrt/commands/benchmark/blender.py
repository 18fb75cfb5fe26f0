"""`gbufrt bench --peers`: our lens passes beside two nodes of Blender's compositor, time and quality in one run."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt.commands.ablation import lens
from gbufrt.commands.ablation.cache import Cache
from gbufrt.commands.ablation.figures.errors import Pair, psnr_over
from gbufrt.commands.ablation.place import Place
from gbufrt.commands.benchmark.frames import HD
from gbufrt.commands.benchmark.process import timed
from gbufrt.frame import Frame
from gbufrt.gbuffer import GBuffer

SIZE = (270, 480)  # where quality is judged: the truth is slow
SAMPLES = 32  # paths a pixel of the truth
FPS = 4.0  # frames far enough apart that all moves by tens of pixels at 1920x1080
MOVING, DEEP = "orbit", "closeup"  # views where all moves, and where most is out of focus
SHUTTER = 0.5  # of the frame's time, centred
APERTURE = 0.2  # world units: discs of up to 29 pixels at 1920x1080
VECTOR_SAMPLES = 32  # Blender's default
VECTOR_REPEATS = 3  # Defocus is slow, and runs once
SKY_DEPTH = 1e10  # as Blender's
NO_BPY = "bpy is not installed: pip install 'bpy>=5' into a venv of its own, and name its Python by --blender"


class Job(NamedTuple):
    """Pictures through a node of Blender; see `gbufrt.commands.benchmark.blender_nodes`."""

    node: str
    inputs: dict[str, Tensor]
    """By the names of its sockets, ``(1, C, H, W)``."""
    settings: dict[str, Any]
    repeats: int = 1


class Effect(NamedTuple):
    """One effect of a lens: ours, Blender's, and what to try them on."""

    ours: Callable[[Frame], Tensor]
    theirs: Callable[[Frame], Job]
    large: Frame
    """To be timed."""
    halves: list[Frame]
    """To be judged; see `gbufrt.commands.ablation.lens`."""
    truth: Pair


def blender_python() -> str | None:
    """This Python, where it has bpy."""
    return sys.executable if find_spec("bpy") else None


def compare_blender(python: str | None, repeats: int) -> dict[str, Any]:
    """Motion blur beside Vector Blur, and depth of field beside Defocus, with the same shutter and the same lens.

    Args:
        python: one that has bpy.
        repeats: runs of our passes that each median is taken over.

    Returns:
        Blender's ``version``; and for ``motion_blur`` and ``depth_of_field`` milliseconds at 1920x1080, ``ms`` and
        ``blender_ms``, and PSNR at 480x270 against the path tracer, in dB over the pixels that the lens changes:
        ``psnr``, ``blender_psnr``, and ``sharp_psnr`` of the frame that went in. Or why there is nothing: ``error``.
    """
    from tracer.worlds import builtin

    if python is None:
        return {"error": NO_BPY}
    found: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as folder:
        options: dict[str, Any] = {"scene": builtin(), "world": "builtin", "samples": SAMPLES, "fps": FPS}
        place = Place(**options, view=MOVING, size=SIZE, cache=Cache(Path(folder)))
        try:
            for name, make, view in (("motion_blur", shutter, MOVING), ("depth_of_field", aperture, DEEP)):
                found[name] = compare(make(replace(place, view=view)), python, repeats, found)
        except (OSError, subprocess.CalledProcessError) as error:
            return {"error": f"{python} could not run Blender: {_reason(error)}"}
    return found


def compare(effect: Effect, python: str, repeats: int, found: dict[str, Any]) -> dict[str, float]:
    """One effect, ours and Blender's; notes Blender's version in ``found``."""
    frames = [effect.large, *effect.halves]
    jobs = [effect.theirs(frame) for frame in frames]
    jobs[1:] = [job._replace(repeats=1) for job in jobs[1:]]
    pictures, times, found["version"] = in_blender(jobs, python)
    with torch.no_grad():
        ms = timed(lambda: effect.ours(effect.large), repeats)
        own = lens.shown([effect.ours(frame) for frame in effect.halves], effect.halves, effect.truth)
    other = lens.shown(pictures[1:], effect.halves, effect.truth)
    compared = {"psnr": own.blurred, "blender_psnr": other.blurred, "sharp_psnr": own.sharp}
    quality = {name: psnr_over(picture, own.wanted, own.changed) for name, picture in compared.items()}
    return {"ms": ms, "blender_ms": times[0], **quality}


def shutter(place: Place) -> Effect:
    """Motion blur. Blender is told of the true motion to the next frame, which ours takes to be like the last."""
    from post import motion_blur
    from tracer.gbuffers import gbuffer

    def ours(frame: Frame) -> Tensor:
        g = frame.gbuffer
        return motion_blur(frame.read("color"), g.depth, frame.read("motion"), shutter=SHUTTER, index=frame.index)

    def theirs(frame: Frame) -> Job:
        up = torch.tensor([1.0, -1.0]).view(1, 2, 1, 1)
        speed = torch.cat([frame.read("motion") * up, -frame.read("motion_to_next") * up], dim=1)
        inputs = {"Image": frame.read("color"), "Speed": speed, "Z": _depth(frame)}
        settings = {"sockets": {"Samples": VECTOR_SAMPLES, "Shutter": SHUTTER}}
        return Job("CompositorNodeVecBlur", inputs, settings, VECTOR_REPEATS)

    def told(frames: list[Frame], size: tuple[int, int]) -> list[Frame]:
        times = [place.at(lens.MOVING_FRAME + step) for step in (0, 1)]
        now, then = (replace(place, size=size).camera(time) for time in times)
        ahead = Frame(gbuffer=gbuffer(place.scene, now, previous_camera=then, time=times[0], previous_time=times[1]))
        return [frame.write("motion_to_next", ahead.read("motion")) for frame in frames]

    halves = told(lens.moving_frames(place), SIZE)
    (large,) = told([_enlarged(halves[0], replace(place, size=HD).geometry(lens.MOVING_FRAME))], HD)
    return Effect(ours, theirs, large, halves, lens.shutter_truth(place, SHUTTER, "center"))


def aperture(place: Place) -> Effect:
    """Depth of field, focused on what is at the middle of the picture."""
    from post import depth_of_field
    from post.lens.thin_lens import autofocus, circle_of_confusion

    g = place.geometry(0)
    focus = float(autofocus(g.depth, g.camera, hit=g.hit)[0])
    through = {"aperture_radius": APERTURE, "focus_distance": focus}

    def ours(frame: Frame) -> Tensor:
        g = frame.gbuffer
        return depth_of_field(frame.read("color"), g.depth, g.camera, hit=g.hit, **through)

    def theirs(frame: Frame) -> Job:
        g = frame.gbuffer
        largest = circle_of_confusion(g.depth, g.camera, hit=g.hit, **through).abs().max()
        settings = {**through, "focal_px": float(g.camera.lens[0, 0]), "max_radius_px": float(largest) + 1}
        return Job("CompositorNodeDefocus", {"Image": frame.read("color"), "Z": _depth(frame)}, {"lens": settings})

    halves = lens.still_frames(place, g)
    large = _enlarged(halves[0], replace(place, size=HD).geometry(0))
    return Effect(ours, theirs, large, halves, lens.lens_truth(place, through))


def in_blender(jobs: list[Job], python: str) -> tuple[list[Tensor], list[float], str]:
    """What each job makes, ``(1, 3, H, W)``; its milliseconds; and Blender's version.

    Raises:
        OSError: there is no such Python.
        subprocess.CalledProcessError: it failed.
    """
    with tempfile.TemporaryDirectory() as name:
        folder, listed = Path(name), []
        for number, job in enumerate(jobs):
            stem = f"job_{number}"
            for socket, values in job.inputs.items():
                np.save(folder / f"{stem}_{socket}.npy", values[0].permute(1, 2, 0).float().numpy())
            listed.append(job._asdict() | {"name": stem, "inputs": [*job.inputs]})
        (folder / "jobs.json").write_text(json.dumps(listed))
        script = Path(__file__).with_name("blender_nodes.py")
        subprocess.run([python, "-P", str(script), name], check=True, capture_output=True, text=True)
        done = json.loads((folder / "done.json").read_text())
        made = [np.load(folder / f"{job['name']}.npy") for job in listed]
    return [torch.from_numpy(picture).permute(2, 0, 1)[None] for picture in made], done["ms"], done["version"]


def _enlarged(frame: Frame, gbuffer: GBuffer) -> Frame:
    """The frame on a larger G-buffer. It is only timed, so its colours need no paths of their own."""
    color = F.interpolate(frame.read("color"), size=gbuffer.camera.size, mode="bilinear")
    return Frame(gbuffer=gbuffer, index=frame.index, color=color)


def _depth(frame: Frame) -> Tensor:
    return torch.where(frame.gbuffer.hit, frame.gbuffer.depth, SKY_DEPTH)


def _reason(error: OSError | subprocess.CalledProcessError) -> str:
    said = getattr(error, "stderr", None) or str(error)
    return said.strip().splitlines()[-1]
