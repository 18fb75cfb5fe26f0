"""Fog that is marched with noise and filtered, against brute force along every ray."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import torch
from torch import Tensor

from gbufrt.commands.ablation.figures.errors import Pair, rms_error
from gbufrt.commands.ablation.place import Place
from gbufrt.commands.ablation.subjects import Outcome
from gbufrt.commands.ablation.world.pictures import compared
from gbufrt.frame import Frame
from gbufrt.pipeline import Pipeline

if TYPE_CHECKING:
    from tracer.scene.scene import Scene

SIZE = (90, 160)
HOURS = {"hall": 16.5, "village": 17.0}
TAKEN, OVER = 0.85, 100.0  # the share of light that the fog takes, and the distance over which it does, world units
FRAMES = 16
STEPS = 512  # of each half of the truth: 1,024 together


def judge(place: Place) -> Outcome:
    """RMS error relative to the mean after static frames, and after one."""
    from post import Fog
    from tracer import gbuffer
    from tracer.direct.fog import foggy

    place = replace(place, scene=in_fog(place.scene, HOURS[place.view]), size=SIZE)
    camera, state, shown = place.camera(0.0), None, dict[str, Tensor]()
    pipeline, poses = Pipeline(fog=Fog()), place.scene.poses([0.0])
    g = gbuffer(place.scene, camera, previous_camera=camera)
    for index in range(FRAMES):
        place.say(f"{place.view} in fog, frame {index + 1} of {FRAMES}")
        frame = foggy(place.scene, Frame(gbuffer=g, index=index), poses=poses, index=index)
        with torch.no_grad():
            after, state = pipeline(frame, state)
        shown["ours"] = after.read("fog")
        shown.setdefault("one frame", after.read("fog"))
    halves = truth(place)
    wanted = (halves[0] + halves[1]) / 2
    everywhere = torch.ones_like(wanted[:, :1], dtype=torch.bool)
    level = float(wanted.mean())
    relative = lambda light: float(rms_error(light, halves, everywhere)) / level
    result = Outcome(pictures=compared("fog", shown, wanted))
    result.figures = {"fog.error": relative(shown["ours"]), "fog.error_1": relative(shown["one frame"])}
    result.figures["fog.mean"] = float(shown["ours"].mean()) / level
    result.figures |= {
        "fog.if_even": relative(wanted.mean((2, 3), keepdim=True).expand_as(wanted)),
        "fog.if_none": relative(0 * wanted),
    }
    result.figures["fog.truth_error"] = float((halves[0] - halves[1]).square().mean().sqrt()) / 2 / level
    return result


def in_fog(scene: Scene, hour: float) -> Scene:
    """The scene in fog, under a low sun."""
    from tracer import Fog, at_hour

    return replace(at_hour(scene, hour), fog=Fog(extinction=-math.log(1 - TAKEN) / OVER))


def truth(place: Place) -> Pair:
    """Light of fog by brute force, in two halves."""
    from tracer import fog_truth, gbuffer

    camera = place.camera(0.0)

    def make() -> dict[str, Tensor]:
        g, poses = gbuffer(place.scene, camera), place.scene.poses([0.0])
        found = {}
        for name, seed in (("first", 0), ("second", 1)):
            place.say(f"{place.view} in fog, {name} half of the truth")
            found[name] = fog_truth(place.scene, g, poses=poses, steps=STEPS, seed=seed)["fog"]
        return found

    kept = place.kept("fog", camera, [0.0], STEPS, make)
    return kept["first"], kept["second"]
