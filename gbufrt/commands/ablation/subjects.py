"""Subjects: what a variant is judged by. Each takes a place and a pipeline, and gives figures, pictures and costs."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import torch
from torch import Tensor

from gbufrt.commands.ablation import limits
from gbufrt.commands.ablation.figures.display import (
    TRACED,
    changed_pixels,
    display,
    displayed,
    error_picture,
    exposure_of,
)
from gbufrt.commands.ablation.figures.errors import gain, psnr_over, share_of_pixels
from gbufrt.commands.ablation.figures.pictures import picture_figures, untouched_figures
from gbufrt.commands.ablation.figures.signals import (
    ao_error,
    ao_figures,
    gi_error,
    gi_figures,
    reflection_figures,
    sky_figures,
)
from gbufrt.commands.ablation.figures.trivial import untouched
from gbufrt.commands.ablation.measure import repeated, run
from gbufrt.commands.ablation.place import Place
from gbufrt.commands.progress import Tick
from gbufrt.frame import Frame
from gbufrt.metrics.temporal import flicker, ghosting
from gbufrt.passes import Pass
from gbufrt.pipeline import Pipeline

SIGNALS = ("ao", "gi", "reflection")
SHARP = {"antialias": False}  # the composite has one sample a pixel, and so has its truth
WHOLE = 3  # times as many paths for whole frames: the display curve turns noise into a bias
PATH_FRAMES = 8
PATH_KEPT = 3  # frames of the path that are compared with truth
PATH_LIGHT_SAMPLES = 4
TAA_FRAMES = 8
EARLY = (1, 4)  # static frames after which AO and GI are judged as well


@dataclass(kw_only=True)
class Outcome:
    """What a subject found."""

    figures: dict[str, float] = field(default_factory=dict)
    pictures: dict[str, Tensor] = field(default_factory=dict)
    """``(1, 3, H, W)`` display-referred."""
    passes: dict[str, dict[str, float]] = field(default_factory=dict)


class Hide(Pass):
    """Hides ``gi``, so that what follows has no further bounce: the truth of reflections has none either."""

    reads, writes = frozenset({"gi"}), frozenset({"gi_found"})

    def forward(self, frame: Frame) -> Frame:
        return frame.write("gi_found", frame.read("gi")).replace(gi=None)


def signals(place: Place, pipeline: Pipeline, wanted: Iterable[str], frames: int) -> Outcome:
    """AO, GI and reflections against their own truths, after ``frames`` static frames; one bounce of each."""
    wanted = set(wanted)
    kept = only(pipeline, SIGNALS[: 1 + max(SIGNALS.index(name) for name in wanted)])
    stages = dict(one_bounce(kept).stages.items())
    if "gi" in stages and "reflection" in stages:
        stages = {"ao": stages.get("ao"), "gi": stages["gi"], "hide": Hide(), "reflection": stages["reflection"]}
    frame = place.still()
    said = _said(place, "static frame", frames)
    found = run(Pipeline(**stages), repeated(frame, frames), at=[n - 1 for n in EARLY], tick=said)  # pyright: ignore[reportArgumentType]
    result = Outcome(passes=found.passes)
    last, *early = (one.replace(gi=one.extra.get("gi_found", one.gi)) for one in (found.last, *found.at.values()))
    exposure, sky = exposure_of(untouched(frame), frame.gbuffer.hit), None
    if "ao" in wanted:
        truth = ao_truth(place, pipeline, frame)
        result.figures.update(ao_figures(last, truth))
        result.figures.update({f"ao.rmse_{n}": ao_error(one, truth) for n, one in zip(EARLY, early, strict=False)})
        result.pictures.update(_compared("ao", _grey(last.read("ao")), _grey(truth["ao"]), frame))
    if "gi" in wanted:
        truth = place.truth_of("indirect_diffuse", frame.gbuffer, {"bounces": 1})
        figures, sky = gi_figures(last, truth, limits.exact_gi(place, last)), truth["sky_visibility"]
        result.figures.update({**figures, **sky_figures(last, truth)})
        result.figures.update({f"gi.error_{n}": gi_error(one, truth) for n, one in zip(EARLY, early, strict=False)})
        shown, true = display(last.read("gi"), exposure), display(truth["gi_onscreen"], exposure)
        result.pictures.update(_compared("gi", shown, true, frame))
    if "reflection" in wanted:
        truth = place.truth_of("reflection", frame.gbuffer)
        bare = last.replace(gi=None)  # as the pass had it
        lit = [] if sky is None else [bare.replace(sky_visibility=sky)]
        result.figures.update(reflection_figures(last, truth, *limits.exact_reflections(place, bare, *lit)))
        shown, true = display(last.read("reflection"), exposure), display(truth["reflection"], exposure)
        result.pictures.update(_compared("reflection", shown, true, frame))
    return result


def whole_frame(place: Place, pipeline: Pipeline, frames: int, full: Tensor | None) -> Outcome:
    """The composite against the path-traced frame after static frames.

    Args:
        place: where.
        pipeline: what to run; its lens and display passes are left out.
        frames: how many static frames.
        full: the displayed composite of the full pipeline, to tell which pixels the variant changes.
    """
    traced = replace(place, samples=place.samples * WHOLE)
    frame, truths, onscreen = place.still(), traced.pictures(SHARP), traced.pictures(SHARP, name="radiance_onscreen")
    truth = (truths[0] + truths[1]) / 2
    hit, tick = frame.gbuffer.hit, _said(place, "static frame", frames)
    found = run(up_to_composite(pipeline), repeated(frame, frames), keep=2, tick=tick)
    exposure = exposure_of(truth, hit)
    shown, wanted = display(found.last.read("composite"), exposure), display(truth, exposure)
    result = Outcome(figures=picture_figures(found.last.read("composite"), truths, hit, exposure))
    result.figures["psnr_onscreen"] = psnr_over(shown, displayed(onscreen, exposure), hit)
    result.passes, result.pictures = found.passes, _compared("frame", shown, wanted, frame)
    result.figures["ms"] = found.ms
    if frames > 1:
        pair = [display(one.read("composite"), exposure) for one in found.frames]
        result.figures["flicker"] = float(flicker(pair, [frame.gbuffer] * 2))
    if full is not None:
        changed = hit & changed_pixels(full, shown)
        result.figures["changed"] = share_of_pixels(changed, hit)
        loss = gain(full, shown, displayed(truths, exposure), changed)
        result.figures["loss"] = 0.0 if math.isnan(loss) else loss  # a stage that changes next to nothing gains nothing
    else:
        result.figures.update(untouched_figures(frame, truths, onscreen, exposure))
    return result


def path(place: Place, pipeline: Pipeline, frames: int) -> Outcome:
    """A moving camera: the last frame against the truth, flicker beyond the truth's own, and ghosts."""
    count = max(PATH_FRAMES, PATH_KEPT + 2)
    sources = [place.moving(number, PATH_LIGHT_SAMPLES) for number in range(count)]
    found = run(up_to_composite(pipeline), sources, keep=PATH_KEPT, tick=_said(place, "moving frame", count))
    truths = [place.pictures(SHARP, time=place.at(number)) for number in range(count - PATH_KEPT, count)]
    last = sources[-1]
    exposure = exposure_of((truths[-1][0] + truths[-1][1]) / 2, last.gbuffer.hit)
    shown = [display(frame.read("composite"), exposure) for frame in found.frames]
    wanted = [displayed(truth, exposure) for truth in truths]
    still = repeated(last.still(), max(frames // 4, 1))
    fresh = display(run(up_to_composite(pipeline), still).last.read("composite"), exposure)
    buffers = [frame.gbuffer for frame in sources]
    truth = (wanted[-1][0] + wanted[-1][1]) / 2
    result = Outcome(passes=found.passes, pictures=_compared("path", shown[-1], truth, last))
    result.figures = picture_figures(found.last.read("composite"), truths[-1], last.gbuffer.hit, exposure)
    result.figures["flicker"] = float(flicker(shown, buffers[-PATH_KEPT:], wanted))
    result.figures["ghosting"] = float(ghosting(shown[-1], wanted[-1], buffers, fresh=fresh))
    result.figures["new_rmse"] = float(ghosting(shown[-1], wanted[-1], buffers))
    result.figures["fresh_new_rmse"] = float(ghosting(fresh, wanted[-1], buffers))
    return result


def taa(place: Place, pipeline: Pipeline, frames: int) -> Outcome:
    """Jittered static frames with and without TAA against the anti-aliased frame, on edge pixels."""
    count = min(frames, TAA_FRAMES)
    lit = up_to_composite(pipeline)
    if "taa" not in pipeline.stages:
        raise ValueError("the pipeline has no stage 'taa'")
    smooth = Pipeline(**dict(lit.stages.items()), taa=pipeline.stages["taa"])  # pyright: ignore[reportArgumentType]
    frame = replace(place, light_samples=PATH_LIGHT_SAMPLES).still()
    jittered = (replace(place, light_samples=PATH_LIGHT_SAMPLES).still(jitter=i).replace(index=i) for i in range(count))
    after = run(smooth, jittered, tick=_said(place, "jittered frame", count))
    before = run(lit, repeated(frame, max(count // 4, 1))).last.read("composite")
    sharp, truth = place.picture(SHARP), place.picture()
    exposure = exposure_of(sharp, frame.gbuffer.hit)
    shown = [display(light, exposure) for light in (after.last.read("color"), before, sharp, truth)]
    edges = changed_pixels(shown[2], shown[3], level=TRACED) & frame.gbuffer.hit
    result = Outcome(passes=after.passes, pictures=_compared("taa", shown[0], shown[3], frame))
    result.figures = {
        "taa.gain": gain(shown[0], shown[1], shown[3], edges),
        "taa.edges": share_of_pixels(edges, frame.gbuffer.hit),
        **picture_figures(after.last.read("color"), truth, frame.gbuffer.hit, exposure),
    }
    return result


def ao_truth(place: Place, pipeline: Pipeline, frame: Frame) -> dict[str, Tensor]:
    """True AO at the pipeline's radius; with several scales, the mean over their radii as in `post.gtao`."""
    tunables = pipeline.all_tunables()
    radius, scales = tunables.get("ao.estimate.radius", 2.0), tunables.get("ao.estimate.scales", 1)
    found = [
        place.truth_of("ambient_occlusion", frame.gbuffer, {"radius": float(radius) * 2**scale})
        for scale in range(scales)
    ]
    if scales == 1:
        return dict(found[0])
    names = ("ao", "ao_onscreen", "ao_first", "ao_second")
    mean = {name: torch.stack([truth[name] for truth in found]).mean(0) for name in names}
    bent = torch.stack([truth["ao"] * truth["bent_normal"] for truth in found]).mean(0)
    mean["bent_normal"] = bent / bent.norm(dim=1, keepdim=True).clamp_min(1e-6)
    errors = [float(truth["ao_error"]) for truth in found if "ao_error" in truth]
    return {**mean, "ao_error": torch.tensor(math.hypot(*errors) / scales)} if errors else mean


def only(pipeline: Pipeline, names: Iterable[str]) -> Pipeline:
    """The named stages that the pipeline has."""
    return Pipeline(**{name: stage for name, stage in pipeline.stages.items() if name in set(names)})  # pyright: ignore[reportArgumentType]


def up_to_composite(pipeline: Pipeline) -> Pipeline:
    """The pipeline without lens and display."""
    names = list(pipeline.stages)
    if "composite" not in names:
        raise ValueError(f"the pipeline has no stage 'composite'; it has {', '.join(names)}")
    return only(pipeline, names[: names.index("composite") + 1])


def one_bounce(pipeline: Pipeline) -> Pipeline:
    """The pipeline with one bounce of indirect light and of reflections, as the truth has."""
    names = [name for name in pipeline.all_tunables() if re.fullmatch(r"(gi|reflection)\..*\.?bounces", name)]
    return pipeline.with_tunables(dict.fromkeys(names, 1))


def _compared(name: str, estimate: Tensor, truth: Tensor, frame: Frame) -> dict[str, Tensor]:
    error = error_picture(estimate, truth, frame.gbuffer.hit)
    return {name: estimate, f"{name} truth": truth, f"{name} error": error}


def _grey(value: Tensor) -> Tensor:
    return value.expand(-1, 3, -1, -1)


def _said(place: Place, what: str, count: int) -> Tick:
    done = 0

    def tick() -> None:
        nonlocal done
        done += 1
        place.say(f"{place.view}, {what} {done} of {count}")

    return tick
