"""What a pixel shows: one ray whose closest hit program hands back what it met."""

from dataclasses import dataclass

import torch
from torch import Tensor

import tracer

scene = tracer.load("valley")
camera = scene.views["lake"].camera(0.0, size=(540, 960))


@dataclass
class Picked:
    instance: Tensor
    material: Tensor


def pick(row, column):
    origins, directions = (part[0, row, column] for part in camera.rays())
    nothing = Picked(*torch.full((2,), -1, dtype=torch.int32))
    program = lambda launch, place, payload: Picked(place.hits.instance, place.hits.material)
    rays = {"pick": tracer.RayType(groups={"*": tracer.HitGroup(closest_hit=program)})}
    send = lambda launch: launch.trace("pick", origins, directions, nothing)
    return tracer.dispatch(scene, send, rays, poses=scene.poses([0.0])[0])


for row, column in ((100, 300), (360, 545), (150, 110)):
    got = pick(row, column)
    material, instance = int(got.material), int(got.instance)  # instance 0: the world
    print(row, column, f"{scene.materials.names[material]} of instance {instance}" if instance >= 0 else "sky")
