"""Rays with programs: what stands in front is seen by rays of mask 0x40 alone, and shines through."""

from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor

import tracer
from gbufrt import Camera
from gbufrt.files.png import write_png

FRONT, BACK, ALL = 0x40, 0x80, 0xFF
LIGHT = torch.nn.functional.normalize(torch.tensor([0.4, 1.0, 0.5]), dim=0)


@dataclass
class Seen:
    color: Tensor  # (N, 3)
    covered: Tensor  # (N, 1): 0 where there is nothing


def shaded(launch, place, payload):
    """Colours run over each face, as barycentric coordinates do over a triangle."""
    albedo = launch.scene.materials.albedo[place.hits.material.long()]
    facing = 0.35 + 0.65 * (place.hits.normal @ LIGHT).clamp_min(0)[:, None]
    return Seen(albedo * facing * (0.75 + 0.25 * place.hits.uv().sum(1, keepdim=True)), payload.covered + 1)


def floor(launch, place, payload):
    """A plane, in the shadow of all that stands on it, whatever the camera's rays see."""
    begin = place.points + 1e-3 * place.hits.normal
    lit = launch.trace("shadow", begin, LIGHT.expand_as(begin), payload, mask=ALL).color
    return Seen(0.08 + 0.5 * lit, payload.covered + 1)


def instance(name, color, size, at, mask):
    pose = torch.eye(4)
    pose[:3, 3] = torch.tensor(at)
    table = tracer.MaterialTable.of([tracer.Material(name="body", albedo=color)])
    model = tracer.World.from_dense(torch.ones(size, dtype=torch.int16), table)
    return tracer.Instance(model=model, pose=lambda time: pose, mask=mask, name=name)


things = [instance("plane", (0.5, 0.5, 0.5), (64, 1, 64), (-32.0, -1.0, -32.0), BACK)]
for i, color in enumerate(((0.9, 0.2, 0.1), (0.2, 0.8, 0.2), (0.2, 0.3, 0.9))):
    things.append(instance("front", color, (4, 6, 4), (12.0 * i - 14, 0.0, 8.0), FRONT))
    things.append(instance("behind", color[::-1], (6, 12, 6), (14.0 * i - 17, 0.0, -14.0), BACK))
air = tracer.World.from_dense(torch.zeros(1, 1, 1, dtype=torch.int16), things[0].model.materials)
scene = tracer.Scene(world=air, instances=tuple(things))
clear = lambda launch, place, payload: Seen(payload.color + torch.tensor([0.35, 0.5, 0.8]), payload.covered)
lit = lambda launch, place, payload: Seen(payload.color + 1, payload.covered)
groups = {"plane": tracer.HitGroup(closest_hit=floor), "*": tracer.HitGroup(closest_hit=shaded)}
rays = {"seen": tracer.RayType(groups=groups, miss=clear), "shadow": tracer.RayType(miss=lit, first_hit=True)}
origins, ways = Camera.look_at((0.0, 16.0, 42.0), (0.0, 3.0, 0.0), size=(540, 960), fov_y=45.0).rays()
start = Seen(torch.zeros(1, 540, 960, 3), torch.zeros(1, 540, 960, 1))
both = lambda launch: [launch.trace("seen", origins, ways, start, mask=mask) for mask in (BACK, FRONT)]
behind, front = tracer.dispatch(scene, both, rays, poses=scene.poses([0.0])[0])
picture = torch.lerp(behind.color, front.color, 0.55 * front.covered)
write_png(Path("out") / "instance_masks.png", picture.permute(0, 3, 1, 2).clamp(0, 1) ** (1 / 2.2))
