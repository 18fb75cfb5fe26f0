"""Lens passes on the path-traced sharp frame, against the path tracer's own shutter and thin lens.

Source and truth have the same light, so only the lens is judged. Both come in independent halves, so that the noise of
neither changes the score.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import torch
from torch import Tensor

from gbufrt.commands.ablation.figures.display import displayed, error_picture, exposure_of, truly_changed
from gbufrt.commands.ablation.figures.errors import (
    Pair,
    by_onscreen_points,
    gain,
    rms_error,
    share_of_error,
    share_of_pixels,
)
from gbufrt.commands.ablation.measure import run
from gbufrt.commands.ablation.place import Place
from gbufrt.commands.ablation.subjects import Outcome
from gbufrt.frame import Frame
from gbufrt.gbuffer import GBuffer
from gbufrt.passes import Stage
from gbufrt.pipeline import Pipeline

LIGHT = {"unblocked": True}  # only the lens is judged, and unblocked light has no noise
MORE = 2  # blurred highlights need many rays
SHARP_SEEDS = (3, 4)  # other paths than those of the truth
LIGHTS = ("radiance", "radiance_onscreen")
APERTURES = {"small": 0.1, "large": 0.4}  # world units
SHUTTERS = {"centred": "center", "trailing": "trailing"}
MOVING_FRAME = 2  # number of the frame that is blurred: a second into the scene
MOVING_FPS = 2.0  # frames far enough apart that movers travel ten pixels and more, as in fast action


class Shown(NamedTuple):
    """Displayed pictures in two halves each, and where the lens truly changes them."""

    blurred: Pair
    sharp: Pair
    wanted: Pair
    changed: Tensor
    """``(B, 1, H, W)`` bool; surfaces alone."""


def motion_blur(place: Place, pipeline: Pipeline) -> Outcome:
    """Gain in PSNR over the sharp frame, centred and trailing shutter, on the pixels that the shutter changes."""
    stage = _stage(pipeline, "motion_blur")
    share = float(stage.tunables().get("shutter", 0.5))
    place = replace(place, fps=MOVING_FPS, samples=place.samples * MORE)
    frames = moving_frames(place)
    result = Outcome()
    for kind, position in SHUTTERS.items():
        truths = [shutter_truth(place, share, position, name) for name in LIGHTS]
        _judge(result, f"motion_blur.{kind}", stage.tuned(position=position), frames, *truths)
    return result


def depth_of_field(place: Place, pipeline: Pipeline) -> Outcome:
    """Gain in PSNR over the pinhole frame for a small and a large aperture, on the pixels that the lens changes."""
    from post.lens.thin_lens import autofocus

    stage = _stage(pipeline, "depth_of_field")
    place = replace(place, samples=place.samples * MORE)
    g = place.still().gbuffer
    focus = float(autofocus(g.depth, g.camera, hit=g.hit)[0])
    frames = still_frames(place, g)
    result = Outcome()
    for kind, aperture in APERTURES.items():
        lens = {"aperture_radius": aperture, "focus_distance": focus}
        truths = [lens_truth(place, lens, name) for name in LIGHTS]
        _judge(result, f"depth_of_field.{kind}", stage.tuned(**lens), frames, *truths)
    return result


def moving_frames(place: Place) -> list[Frame]:
    """The frame that is blurred by its motion, in two halves."""
    now, g = place.at(MOVING_FRAME), place.geometry(MOVING_FRAME)
    sharp = place.pictures(LIGHT, time=now, seeds=SHARP_SEEDS)
    return [Frame(gbuffer=g, index=MOVING_FRAME, time=now, radiance=light, color=light) for light in sharp]


def shutter_truth(place: Place, share: float, position: str, name: str = "radiance") -> Pair:
    """What a shutter records that is open for a share of the frame's time."""
    open_for = share / place.fps
    offset = -open_for / 2 if position == "center" else -open_for
    given = {**LIGHT, "shutter": open_for, "shutter_offset": offset}
    return place.pictures(given, time=place.at(MOVING_FRAME), name=name)


def still_frames(place: Place, gbuffer: GBuffer) -> list[Frame]:
    """The pinhole's frame, in two halves."""
    sharp = place.pictures(LIGHT, seeds=SHARP_SEEDS)
    return [Frame(gbuffer=gbuffer, radiance=light, color=light) for light in sharp]


def lens_truth(place: Place, lens: Mapping[str, float], name: str = "radiance") -> Pair:
    """What a lens shows: ``aperture_radius`` and ``focus_distance`` of `post.depth_of_field`."""
    return place.pictures({**LIGHT, **lens}, name=name)


def shown(blurred: Sequence[Tensor], frames: Sequence[Frame], truths: Pair) -> Shown:
    """Linear pictures, displayed by the exposure of the sharp frame."""
    hit, sources = frames[0].gbuffer.hit, [frame.read("radiance") for frame in frames]
    exposure = exposure_of((sources[0] + sources[1]) / 2, hit)
    found, sharp, wanted = (displayed((pair[0], pair[1]), exposure) for pair in (blurred, sources, truths))
    return Shown(found, sharp, wanted, truly_changed(sharp, wanted) & hit)


def _judge(result: Outcome, name: str, stage: Stage, frames: list[Frame], truths: Pair, onscreen: Pair) -> None:
    """Adds the figures and pictures of one kind of lens; ``onscreen`` is the part of the truth by on-screen points."""
    lens = Pipeline(given={"color"}, **{name.replace(".", "_"): stage})  # pyright: ignore[reportArgumentType]
    found = [run(lens, [frame.replace(index=frame.index + n) for n in (3, 2, 1, 0)]) for frame in frames]
    blurred, sharp, wanted, changed = shown([one.last.read("color") for one in found], frames, truths)
    result.figures[f"{name}.gain"] = gain(blurred, sharp, wanted, changed)
    known = changed & by_onscreen_points(onscreen, truths)
    result.figures[f"{name}.gain_onscreen"] = gain(blurred, sharp, wanted, known)
    result.figures[f"{name}.offscreen_error"] = share_of_error(blurred, wanted, changed & ~known, changed)
    result.figures[f"{name}.offscreen"] = share_of_pixels(changed & ~known, changed)
    result.figures[f"{name}.changed"] = float(changed.float().mean())
    result.figures[f"{name}.kept"] = float(rms_error(blurred, wanted, ~changed).mean())
    result.passes.update(found[0].passes)
    picture, before, truth = ((pair[0] + pair[1]) / 2 for pair in (blurred, sharp, wanted))
    pictures = {name: picture, f"{name} truth": truth, f"{name} before": before}
    whole = torch.ones_like(changed)
    result.pictures.update({**pictures, f"{name} error": error_picture(picture, truth, whole)})


def _stage(pipeline: Pipeline, name: str) -> Stage:
    stage: Any = dict(pipeline.stages.items()).get(name)
    if stage is None:
        raise ValueError(f"the pipeline has no stage {name!r}")
    return stage
