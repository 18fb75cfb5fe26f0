"""Lens passes on the path-traced sharp frame, against the path tracer's own shutter and thin lens.

Source and truth have the same light, so only the lens is judged.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import torch
from torch import Tensor

from gbufrt.commands.ablation import figures as f
from gbufrt.commands.ablation.measure import run
from gbufrt.commands.ablation.place import Place
from gbufrt.commands.ablation.subjects import Outcome
from gbufrt.frame import Frame
from gbufrt.passes import Stage
from gbufrt.pipeline import Pipeline

LIGHT = {"bounces": 0}  # sun, lamps and sky: what else the light did before it came to the lens does not matter
MORE = 4  # such light is cheap, and blurred highlights take many paths
APERTURES = {"small": 0.1, "large": 0.4}  # world units
SHUTTERS = {"centred": "center", "trailing": "trailing"}
MOVING_FRAME = 2  # number of the frame that is blurred: a second into the scene
MOVING_FPS = 2.0  # frames so far apart that what moves goes on by ten pixels and more, as in fast action


def motion_blur(place: Place, pipeline: Pipeline) -> Outcome:
    """Gain in PSNR over the sharp frame, centred and trailing shutter, on the pixels that the shutter changes."""
    stage = _stage(pipeline, "motion_blur")
    share = float(stage.tunables().get("shutter", 0.5))
    place = replace(place, fps=MOVING_FPS, samples=place.samples * MORE)
    open_for, now = share / place.fps, place.at(MOVING_FRAME)
    g = place.geometry(MOVING_FRAME)
    sharp = place.picture(LIGHT, time=now)
    frame = Frame(gbuffer=g, index=MOVING_FRAME, time=now, radiance=sharp, color=sharp)
    result = Outcome()
    for kind, position in SHUTTERS.items():
        offset = -open_for / 2 if position == "center" else -open_for
        truth = place.pictures({**LIGHT, "shutter": open_for, "shutter_offset": offset}, time=now)
        tuned = stage.tuned(position=position)
        _judge(result, f"motion_blur.{kind}", tuned, frame, truth)
    return result


def depth_of_field(place: Place, pipeline: Pipeline) -> Outcome:
    """Gain in PSNR over the pinhole frame for a small and a large aperture, on the pixels that the lens changes."""
    from post.thin_lens import autofocus

    stage = _stage(pipeline, "depth_of_field")
    place = replace(place, samples=place.samples * MORE)
    g, sharp = place.still().gbuffer, place.picture(LIGHT)
    focus = float(autofocus(g.depth, g.camera, hit=g.hit)[0])
    frame = Frame(gbuffer=g, radiance=sharp, color=sharp)
    result = Outcome()
    for kind, aperture in APERTURES.items():
        truth = place.pictures({**LIGHT, "aperture_radius": aperture, "focus_distance": focus})
        tuned = stage.tuned(aperture_radius=aperture, focus_distance=focus)
        _judge(result, f"depth_of_field.{kind}", tuned, frame, truth)
    return result


def _judge(result: Outcome, name: str, stage: Stage, frame: Frame, truths: tuple[Tensor, Tensor]) -> None:
    found = run(Pipeline(given={"color"}, **{name.replace(".", "_"): stage}), [frame] * 4)  # pyright: ignore[reportArgumentType]
    exposure = f.exposure_of(frame.read("radiance"), frame.gbuffer.hit)
    shown, sharp = (f.display(light, exposure) for light in (found.last.read("color"), frame.read("radiance")))
    answers = f.display(truths[0], exposure), f.display(truths[1], exposure)
    wanted = f.display((truths[0] + truths[1]) / 2, exposure)
    changed = f.changed_pixels(sharp, wanted, level=f.TRACED)
    result.figures[f"{name}.gain"] = f.gain_over(shown, sharp, answers, changed)
    result.figures[f"{name}.changed"] = float(changed.float().mean())
    result.figures[f"{name}.kept"] = f.gain_over(shown, sharp, answers, ~changed)
    result.passes.update(found.passes)
    everywhere = torch.ones_like(frame.gbuffer.hit)
    pictures = {name: shown, f"{name} truth": wanted, f"{name} before": sharp}
    result.pictures.update({**pictures, f"{name} error": f.error_picture(shown, wanted, everywhere)})


def _stage(pipeline: Pipeline, name: str) -> Stage:
    stage: Any = dict(pipeline.stages.items()).get(name)
    if stage is None:
        raise ValueError(f"the pipeline has no stage {name!r}")
    return stage
