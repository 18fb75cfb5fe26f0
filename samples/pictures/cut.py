"""The first frame after a cut inside the hall, without and with the light that frames before left. `cut.py OUT.jpg`."""

import sys

import torch

import tracer
from gbufrt import Camera, Frame
from gbufrt.files.png import to_pil
from post import minecraft_rtx

SIZE, BEFORE = (126, 224), 16  # what is traced; frames of another view before the cut
hall = tracer.load("valley")


def traced(camera: Camera, index: int) -> Frame:
    return tracer.render(hall, camera, light_samples=1, index=index, previous_camera=camera).replace(ambient=None)


def shown(frame: Frame) -> torch.Tensor:
    return minecraft_rtx("high")(frame)[0].read("image")


with torch.no_grad():
    cache, elsewhere = None, hall.views["hall"].camera(0.0, size=SIZE)
    for index in range(BEFORE):
        _, cache = tracer.sampled_with_cache(hall, traced(elsewhere, index), cache, bounces=4)
    frame = traced(Camera.look_at((173.5, 37.0, 79.5), (199.0, 33.5, 92.0), size=SIZE, fov_y=58.0), BEFORE)
    left = shown(tracer.sampled(hall, frame, bounces=4))
    right = shown(tracer.sampled_with_cache(hall, frame, cache, bounces=4)[0])
    to_pil(torch.cat([left, torch.ones_like(left[..., :2]), right], dim=-1)).save(sys.argv[1], quality=86)
