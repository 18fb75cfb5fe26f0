"""All three traversals over a few rays, for tests that compare their forms. Run as a script, it answers in the CUDA
form by numba's simulator and saves what it finds: ``NUMBA_ENABLE_CUDASIM=1 python traversals.py FILE``."""

from __future__ import annotations

from typing import Any

import torch
import voxels
from simulated import save
from torch import Tensor
from voxels import GLASS, STONE, WATER

from tracer.scene.scene import MASK_ALL, MASK_PRIMARY, MASK_SHADOW, Instance, Scene
from tracer.scene.weather import Waves
from tracer.traversal.hits import Hits
from tracer.traversal.rays import run_lengths, trace, transmission
from tracer.weather.caustics import _focused as focus
from tracer.weather.water import Water
from tracer.weather.waves import _meet as meet_waves

SIZE = (8, 12)


def scene() -> Scene:
    """A floor and a wall, with a pane of glass and a pool; a small turned block of glass and stone in front."""
    world = voxels.world(
        (18, 14, 18), (STONE, (0, 0, 0), (18, 1, 18)), (STONE, (0, 0, 15), (18, 14, 18)), (WATER, (2, 1, 2), (8, 3, 9)),
        (GLASS, (9, 1, 8), (17, 11, 9)),
    )  # fmt: skip
    model = voxels.world((3, 6, 3), (STONE, (0, 0, 0), (3, 3, 3)), (GLASS, (0, 3, 0), (3, 6, 3)), origin=(-1, 0, -1))
    block = Instance(model=model, pose=lambda t: voxels.pose((7.0, 2.0, 11.0 + t), yaw=0.5), scale=0.9)
    return Scene(world=world, instances=(block,))


def answers(device: str = "cpu") -> dict[str, Tensor]:
    """Hits of two batches of 12x8 rays at two times, what lies behind them, how much light comes through; and the
    hits of rays that begin in the pool."""
    things = scene().to(device)
    y, x = torch.meshgrid(torch.linspace(-0.45, 0.75, SIZE[0]), torch.linspace(-0.8, 0.8, SIZE[1]), indexing="ij")
    directions = torch.nn.functional.normalize(torch.stack([x, -y, torch.ones_like(x)], dim=-1), dim=-1)
    directions = directions.expand(2, *SIZE, 3).to(device)
    origins = torch.tensor([8.6, 6.4, -3.2], device=device).expand_as(directions)
    given: dict[str, Any] = {"poses": things.poses([0.0, 0.6]).to(device)}
    first = trace(things, origins, directions, mask=MASK_PRIMARY, **given)
    behind = trace(things, origins, directions, beyond=first, mask=MASK_ALL, t_max=30.0, **given)
    inside = trace(things, torch.tensor([5.1, 2.2, 5.3], device=device).expand_as(directions), -directions, **given)
    found = {
        "transmission": transmission(things, origins, directions, mask=MASK_SHADOW, t_max=16.0, **given),
        "runs": torch.stack(run_lengths(things, origins, directions, first, cap=5.0, **given)),
    }
    for name, hits in (("first", first), ("behind", behind), ("inside", inside)):
        found |= {f"{name} {key}": value for key, value in numbers(hits).items()}
    return {key: value.cpu() for key, value in (found | waters(device)).items()}


def waters(device: str | torch.device = "cpu") -> dict[str, Tensor]:
    """Where rays meet waves, or end before, and how much sunlight waves send to points on a wall."""
    field = Water.of(Waves(amplitude=0.2), 2.0, torch.tensor([1.0, 6.0, -2.0]).to(device))
    y, x = torch.meshgrid(torch.linspace(0.0, 1.0, SIZE[0]), torch.linspace(0.0, 1.0, SIZE[1]), indexing="ij")
    place = torch.stack([x, y], dim=-1).view(-1, 2)
    origins = torch.cat([9 * place, torch.full_like(place[:, :1], 6.0)], dim=1)[:, [0, 2, 1]]
    ways = torch.nn.functional.normalize(
        torch.cat([place - 0.4, torch.full_like(place[:, :1], -1.0)], 1)[:, [0, 2, 1]], dim=1
    )
    begin = -2.0 / ways[:, 1]
    end = begin + 0.4 * place[:, 0]
    walls = torch.stack([9 * place[:, 0], 4.5 + 2 * place[:, 1], torch.full_like(begin, 1.0)], dim=1)
    facing, level = torch.tensor([[0.0, 0.0, 1.0]]).repeat(len(walls), 1), torch.full_like(begin, 3.8)
    sun = torch.nn.functional.normalize(torch.tensor([0.25, 0.6, 0.75]), dim=0)
    return {
        "waves": meet_waves(field, *(t.to(device) for t in (origins, ways, begin, end, level > 0))),
        "caustics": focus(field, *(t.to(device) for t in (walls, facing, level, sun))),
    }


def numbers(hits: Hits) -> dict[str, Tensor]:
    """The fields of hits; 0 where nothing was hit."""
    keep = hits.hit
    fields = ("material", "instance", "cell", "face", "back_face", "t", "local", "normal")
    values = {name: getattr(hits, name) for name in fields}
    return {"hit": keep} | {
        name: torch.where(keep if value.ndim == keep.ndim else keep[..., None], value, 0)
        for name, value in values.items()
    }


def looks_free(scene: Scene, name: str, time: float, near: float) -> float:
    """The share of rays that hit something, once it is clear that nothing is before the lens."""
    camera = scene.views[name].camera(time, size=(18, 32))
    assert not scene.world.at(camera.position[0].floor().long()).any(), f"{name} at {time} s is in a block"
    hits = trace(scene, *camera.rays(), poses=scene.poses([time]))
    close = (hits.t < near) & hits.hit
    assert close.float().mean() < 0.03, f"{name} at {time} s is against something"
    return float(hits.hit.float().mean())


if __name__ == "__main__":
    save(answers)
