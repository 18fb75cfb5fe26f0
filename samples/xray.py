"""Ores and lamps through the rock: an any-hit program lets rays pass by all else."""

from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor

import tracer
from gbufrt.files.png import write_png

scene = tracer.load("valley")
table = scene.materials
precious = torch.tensor([table.names.index(n) for n in ("gold", "copper", "iron", "crystal", "amethyst", "lamp")])


@dataclass
class Color:
    rgb: Tensor


def shaded(launch, place, payload):
    material = place.hits.material.long()
    light = 0.4 + 0.6 * (place.hits.normal @ torch.tensor([0.48, 0.64, 0.6])).abs()[:, None]
    return Color(table.albedo[material] * light + table.emission[material].clamp(max=1))


kept = lambda launch, place, payload: torch.isin(place.hits.material.long(), precious)
rays = {
    "surface": tracer.RayType(groups={"*": tracer.HitGroup(closest_hit=shaded)}),
    "inside": tracer.RayType(groups={"*": tracer.HitGroup(closest_hit=shaded, any_hit=kept)}),
}
origins, directions = scene.views["lake"].camera(0.0, size=(540, 960)).rays()
black = Color(torch.zeros(1, 540, 960, 3))
both = lambda launch: [launch.trace(kind, origins, directions, black).rgb for kind in rays]
surface, inside = tracer.dispatch(scene, both, rays, poses=scene.poses([0.0])[0])
picture = torch.where(inside.sum(-1, keepdim=True) > 0, 0.8 * inside + 0.2 * surface, 0.4 * surface)
write_png(Path("out") / "xray.png", picture.permute(0, 3, 1, 2).clamp(0, 1) ** (1 / 2.2))
