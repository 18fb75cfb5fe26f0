"""Lamps that go out under a sun that moves: how soon A-SVGF shows it, and how well it does when nothing changes."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import torch
from torch import Tensor

from gbufrt.commands.ablation.figures.errors import Pair, rms_error
from gbufrt.commands.ablation.place import Place
from gbufrt.commands.ablation.subjects import Outcome
from gbufrt.commands.ablation.world.pictures import compared
from gbufrt.frame import Frame
from gbufrt.pipeline import Pipeline

if TYPE_CHECKING:
    from gbufrt.camera import Camera
    from tracer.scene.scene import Scene

SIZE = (72, 128)
OUT, LATER = 16, 4  # the first frame without lamps, and how many frames later the error is judged
EVEN_LATER = (7, 10)  # frames after `OUT` whose error is told beside it
STEADY = (29, 31)  # frames whose error is the steady one
PATHS = 48  # a pixel, of each half of the truth
SEEDS = (100, 101)  # of the truth
FPS, PACE = 30.0, 0.9  # world units a second, sideways
TURN = 0.15  # degrees of the sun a frame
GREY = 0.3  # radiance that the curve x / (x + GREY) takes to a half: errors are judged after it


def judge(place: Place) -> Outcome:
    """Errors of A-SVGF, of the same without gradients (SVGF), and of `Denoise`: a few frames after, and steady."""
    from post import ASVGF, Denoise

    apart = {
        name: Pipeline(diffuse=ASVGF(gradients=on), specular=ASVGF(signal="specular", gradients=on))
        for name, on in (("ours", True), ("SVGF", False))
    }
    pipelines = {**apart, "Denoise": Pipeline(denoise=Denoise(signal="radiance"))}
    states, before, errors = dict.fromkeys(pipelines), None, dict[int, dict[str, float]]()
    result, shown = Outcome(), dict[str, Tensor]()
    for number in range(STEADY[-1] + 1):
        spot = replace(place, scene=scene_at(place.scene, number), size=SIZE)
        place.say(f"{place.view}, frame {number + 1} of {STEADY[-1] + 1}")
        before = noisy(spot, number, before)
        shown = {"input": before.read("radiance")}
        for name, pipeline in pipelines.items():
            with torch.no_grad():
                done, states[name] = pipeline(before, states[name])  # pyright: ignore[reportArgumentType]
            shown[name] = done.read("radiance") if name == "Denoise" else outgoing(before, done)
        if number - OUT in (LATER, *EVEN_LATER) or number in STEADY:
            halves = truth(spot, before)
            errors[number] = {name: error(light, halves, judged(before)) for name, light in shown.items()}
            if number == OUT + LATER:
                result.pictures = compared("asvgf", shown, (halves[0] + halves[1]) / 2)
    steady = {name: math.hypot(*(errors[n][name] for n in STEADY)) / math.sqrt(len(STEADY)) for name in shown}
    for name in shown:
        result.figures[f"asvgf.steady_{name}"] = steady[name]
        result.figures[f"asvgf.late_{name}"] = errors[OUT + LATER][name] / steady[name]
        for after in EVEN_LATER:
            result.figures[f"asvgf.after_{after}_{name}"] = errors[OUT + after][name] / steady[name]
        result.figures[f"asvgf.over_denoise_{name}"] = steady[name] / steady["Denoise"]
    return result


def scene_at(scene: Scene, number: int) -> Scene:
    """The scene at a frame: the sun goes on, and from `OUT` on lamps are out."""
    from tracer import Sun

    sun, table, turn = scene.sun or Sun(), scene.world.materials, math.radians(TURN * number)
    (x, y, z), c, s = sun.direction, math.cos(turn), math.sin(turn)
    lit = torch.tensor([number < OUT or name != "lamp" for name in table.names])
    world = replace(scene.world, materials=replace(table, emission=table.emission * lit[:, None]))
    return replace(scene, world=world, sun=replace(sun, direction=(x * c + z * s, y, z * c - x * s)))


def noisy(place: Place, number: int, before: Frame | None) -> Frame:
    """A frame with light of one sample a pixel; all of it also as ``radiance``."""
    from tracer import render, sampled

    now, then = number / FPS, max(number - 1, 0) / FPS
    moment: dict[str, Any] = {"time": now, "previous_camera": camera(place, then), "previous_time": then}
    frame = render(place.scene, camera(place, now), light_samples=1, index=number, **moment).replace(behind=None)
    frame = sampled(place.scene, frame, before=before)
    return frame.replace(radiance=outgoing(frame, frame))


def camera(place: Place, time: float) -> Camera:
    """The view's, which goes sideways."""
    from gbufrt.camera import Camera

    view = place.scene.views[place.view]
    eye, target = torch.tensor(view.eye(0.0)), torch.tensor(view.target(0.0))
    side = torch.nn.functional.normalize(torch.linalg.cross(target - eye, torch.tensor([0.0, 1.0, 0.0])), dim=0)
    return Camera.look_at(eye + PACE * time * side, target, size=place.size, fov_y=view.fov_y)


def outgoing(frame: Frame, light: Any) -> Tensor:
    """What is seen, without what is behind glass, of a frame's surfaces in some light."""
    return frame.read("emission") + frame.read("albedo") * light.diffuse + light.specular


def truth(place: Place, frame: Frame) -> Pair:
    """`outgoing` by many paths, in two halves."""
    from tracer import light_truth

    g, poses = frame.gbuffer, place.scene.poses([float(frame.time)])

    def make() -> dict[str, Tensor]:
        found = (light_truth(place.scene, g, poses=poses, samples=PATHS, seed=seed) for seed in SEEDS)
        return dict(zip(("first", "second"), (outgoing(frame, light) for light in found), strict=True))

    kept = place.kept("light", g.camera, [float(frame.time)], (PATHS, SEEDS), make)
    return kept["first"], kept["second"]


def judged(frame: Frame) -> Tensor:
    """``(B, 1, H, W)`` bool: opaque surfaces that do not shine."""
    dark = frame.read("emission").sum(1, keepdim=True) == 0
    return frame.gbuffer.hit & (frame.read("opacity") == 1) & dark


def error(picture: Tensor, halves: Pair, mask: Tensor) -> float:
    """RMSE over the mean, both after the curve."""
    got, *want = (x / (x + GREY) for x in (picture, *halves))
    mean = want[0].mean(1, keepdim=True)[mask].mean()
    return float(rms_error(got, (want[0], want[1]), mask) / mean)
