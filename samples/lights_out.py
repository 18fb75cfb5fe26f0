"""Lamps go out under a sun that moves: error of A-SVGF, of plain SVGF and of `Denoise`, frame by frame, as
``lights_out.py [VIEW] [SAMPLES of the truth]``."""

import math
import sys
from dataclasses import replace

import torch

import tracer
from gbufrt import Camera, Pipeline
from post import ASVGF, Denoise

SIZE, OUT, CHECKED = (72, 128), 16, (15, 16, 17, 18, 19, 20, 21, 23, 26, 31)
GREY = 0.3  # radiance that the curve x / (x + GREY) takes to a half; errors are judged after it
view, samples = (sys.argv[1:2] or ["hall"])[0], int((sys.argv[2:3] or [64])[0])
valley = tracer.load("valley")
shown, table, sun = valley.views[view], valley.world.materials, valley.sun or tracer.Sun()
unlit = replace(table, emission=table.emission * torch.tensor([name != "lamp" for name in table.names])[:, None])
eye, target = torch.tensor(shown.eye(0.0)), torch.tensor(shown.target(0.0))
side = torch.nn.functional.normalize(torch.linalg.cross(target - eye, torch.tensor([0.0, 1.0, 0.0])), dim=0)


def scene_at(number: int) -> tracer.Scene:
    (x, y, z), turn = sun.direction, math.radians(0.15 * number)
    way = (x * math.cos(turn) + z * math.sin(turn), y, z * math.cos(turn) - x * math.sin(turn))
    world = valley.world if number < OUT else replace(valley.world, materials=unlit)
    return replace(valley, world=world, sun=replace(sun, direction=way))


def outgoing(gbuffer, light):
    return gbuffer.emission + gbuffer.albedo * light.diffuse + light.specular  # before what is behind glass


def error(picture, halves, mask):  # against two halves of the truth, whose noise cancels; relative to the mean
    got, *want = (x / (x + GREY) for x in (picture, *halves))
    product = ((got - want[0]) * (got - want[1])).mean(1, keepdim=True)[mask].mean()
    return float(product.clamp_min(0).sqrt() / want[0].mean(1, keepdim=True)[mask].mean())


pair = [Pipeline(diffuse=ASVGF(gradients=on), specular=ASVGF(signal="specular", gradients=on)) for on in (True, False)]
pipelines = {"A-SVGF": pair[0], "SVGF": pair[1], "Denoise": Pipeline(denoise=Denoise(signal="radiance"))}
states, before = dict.fromkeys(pipelines), None
for number in range(CHECKED[-1] + 1):
    times, scene = (number / 30, max(number - 1, 0) / 30), scene_at(number)
    now, then = (Camera.look_at(eye + 0.9 * t * side, target, size=SIZE, fov_y=shown.fov_y) for t in times)
    moment = {"time": times[0], "previous_camera": then, "previous_time": times[1], "index": number}
    frame = tracer.render(scene, now, light_samples=1, **moment).replace(behind=None)
    before = tracer.sampled(scene, frame, before=before)
    g, noisy, found = before.gbuffer, before.replace(radiance=outgoing(before.gbuffer, before)), {}
    for name, pipeline in pipelines.items():
        done, states[name] = pipeline(noisy, states[name])
        found[name] = done.radiance if name == "Denoise" else outgoing(g, done)
    if number in CHECKED:
        given, opaque = {"poses": scene.poses(times[:1]), "samples": samples}, g.hit & (before.read("opacity") == 1)
        halves = [outgoing(g, tracer.light_truth(scene, g, **given, seed=seed)) for seed in (100, 101)]
        mask = opaque & (before.read("emission").sum(1, keepdim=True) == 0)
        print(number, *(f"{name} {error(light, halves, mask):.4f}" for name, light in found.items()), flush=True)
