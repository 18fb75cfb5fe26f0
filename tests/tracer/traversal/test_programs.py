"""Programmable rays: which programs run for which rays, and what they may do to payloads."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import pytest
import torch
import voxels
from torch import Tensor

from tracer.scene.scene import MASK_SHADOW, Instance, Scene
from tracer.traversal.hits import Place
from tracer.traversal.programs import MOST_IGNORED, HitGroup, Launch, RayType, dispatch
from tracer.traversal.rays import trace

FRONT, BACK = 0x40, 0x80


@dataclass
class Mark:
    number: Tensor


def post(name: str, x: float, mask: int) -> Instance:
    """A pillar on the x axis, which rays along x meet."""
    model = voxels.world((2, 4, 4), (voxels.STONE, (0, 0, 0), (2, 4, 4)))
    pose = voxels.pose((x, -2.0, -2.0))
    return Instance(model=model, pose=lambda time: pose, mask=mask, name=name)


def scene() -> Scene:
    """Along x: a pillar in front, a pillar behind, and the world's wall."""
    wall = voxels.world((30, 3, 3), (voxels.STONE, (28, 0, 0), (30, 3, 3)), origin=(0, -1, -1))
    return Scene(world=wall, instances=(post("near", 5.0, FRONT), post("far", 15.0, BACK)))


def marks(value: float) -> HitGroup:
    return HitGroup(closest_hit=lambda launch, place, payload: Mark(torch.full_like(payload.number, value)))


GROUPS = {"near": marks(1.0), "far": marks(2.0), "world": marks(3.0)}
MISS = lambda launch, place, payload: Mark(payload.number - 1)


def shot(rays: RayType, *, height: tuple[float, ...] = (0.2, 50.0), **more: Any) -> list[float]:
    """What rays along x are marked with, the second high above everything."""
    found = scene()
    origins = torch.tensor([[-1.0, y, 0.3] for y in height])
    ways = torch.tensor([[1.0, 0.0, 0.0]]).expand_as(origins)
    send = lambda launch: launch.trace("plain", origins, ways, Mark(torch.zeros(len(origins), 1)), **more)
    return dispatch(found, send, {"plain": rays}, poses=found.poses([0.0])[0]).number[:, 0].tolist()


def test_masks_choose_what_rays_see_and_instances_what_happens():
    rays = RayType(groups=GROUPS, miss=MISS)
    assert shot(rays, mask=FRONT) == [1, -1]
    assert shot(rays, mask=BACK) == [2, -1]
    assert shot(rays, mask=FRONT | BACK) == [1, -1]
    assert shot(rays) == [3, -1]
    assert shot(replace(rays, mask=BACK)) == [2, -1]
    assert shot(rays, mask=8) == [-1, -1]


def test_a_star_is_for_those_that_are_not_named():
    rays = RayType(groups={"near": marks(1.0), "*": marks(9.0)}, miss=MISS)
    assert [shot(rays, mask=m)[0] for m in (FRONT, BACK, 7)] == [1, 9, 9]
    assert shot(RayType(groups={"near": marks(1.0)}), mask=BACK) == [0, 0], "no program, no change"


def test_what_any_hit_ignores_is_passed_as_if_it_were_not_there():
    passing = HitGroup(any_hit=lambda launch, place, payload: torch.zeros(len(place.origins), dtype=torch.bool))
    rays = RayType(groups=GROUPS | {"near": passing}, miss=MISS)
    assert shot(rays, mask=0xFF) == [2, -1]
    rays = RayType(groups={"near": passing, "far": passing, "world": passing}, miss=MISS)
    assert shot(rays, mask=0xFF) == [-1, -1]
    assert shot(RayType(groups=GROUPS | {"near": passing}, miss=MISS), mask=0xFF, t_max=10.0) == [-1, -1]


def test_another_material_directly_behind_an_ignored_one_is_found():
    solid = voxels.world((6, 1, 1), (voxels.STONE, (1, 0, 0), (3, 1, 1)), (voxels.LAMP, (3, 0, 0), (5, 1, 1)))
    found = Scene(world=solid)
    seen: list[tuple[float, int]] = []

    def stone(launch: Launch, place: Place, payload: Mark) -> Tensor:
        return place.found.material != voxels.STONE

    def note(launch: Launch, place: Place, payload: Mark) -> Mark:
        seen.append((float(place.found.t), int(place.found.material)))
        return Mark(place.points[:, :1])

    rays = {"x": RayType(groups={"*": HitGroup(any_hit=stone, closest_hit=note)})}
    at, way = torch.tensor([[-1.0, 0.5, 0.5]]), torch.tensor([[1.0, 0.0, 0.0]])
    got = dispatch(found, lambda launch: launch.trace("x", at, way, Mark(torch.zeros(1, 1))), rays)
    assert seen == [(4.0, voxels.LAMP)]
    assert float(got.number) == 3.0


def test_programs_send_rays_whose_first_hit_is_enough():
    """A shadow ray's payload says what the miss program makes of it: closest hits do not run."""
    lit = RayType(
        groups={"*": marks(7.0)}, miss=lambda launch, place, payload: Mark(payload.number + 5), first_hit=True
    )

    def lighted(launch: Launch, place: Place, payload: Mark) -> Mark:
        start = place.points + 1e-3 * place.found.normal
        along, up = (torch.tensor(way).expand_as(start) for way in ((-1.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
        zero = Mark(torch.zeros(len(start), 1))
        free = [launch.trace("shadow", start, way, zero, mask=FRONT).number for way in (along, up)]
        return Mark(10 * free[0] + free[1])

    found = scene()
    rays = {"plain": RayType(groups={"far": HitGroup(closest_hit=lighted)}), "shadow": lit}
    at, way = torch.tensor([[-1.0, 0.2, 0.3]]), torch.tensor([[1.0, 0.0, 0.0]])
    send = lambda launch: launch.trace("plain", at, way, Mark(torch.zeros(1, 1)), mask=BACK)
    got = dispatch(found, send, rays, poses=found.poses([0.0])[0])
    assert got.number.tolist() == [[5.0]], "the near pillar is in the way of one ray, nothing in the other's"
    with pytest.raises(ValueError, match="rays of type 'shadow' recurse deeper than 1: give dispatch a larger depth"):
        dispatch(found, send, rays, poses=found.poses([0.0])[0], depth=1)


def test_a_plain_program_sees_what_trace_finds():
    found = voxels.polished_scene(2)
    origins, ways = voxels.random_rays(4, 600)
    poses = found.poses([0.3])[0]
    hits = trace(found, origins, ways, poses=poses)
    distance = lambda launch, place, payload: Mark(place.found.t[:, None])
    rays = {"plain": RayType(groups={"*": HitGroup(closest_hit=distance)}, mask=1)}
    shape = lambda x: x.view(20, 30, *x.shape[1:])
    send = lambda launch: launch.trace("plain", shape(origins), shape(ways), Mark(torch.full((20, 30, 1), -1.0)))
    got = dispatch(found, send, rays, poses=poses).number
    assert torch.equal(got[..., 0], shape(torch.where(hits.hit, hits.t, -1.0)))


def test_payloads_carry_gradients():
    found = scene()
    weight = torch.tensor(2.0, requires_grad=True)
    shade = HitGroup(closest_hit=lambda launch, place, payload: Mark(payload.number * weight))
    at = torch.tensor([[-1.0, 0.2, 0.3], [-1.0, 50.0, 0.3]])
    send = lambda launch: launch.trace("plain", at, torch.eye(3)[:1].expand(2, 3), Mark(torch.full((2, 1), 3.0)))
    dispatch(found, send, {"plain": RayType(groups={"*": shade})}, poses=found.poses([0.0])[0]).number.sum().backward()
    assert weight.grad is not None
    assert float(weight.grad) == 3.0


def test_wrong_programs_are_told_by_name():
    def narrow(launch: Launch, place: Place, payload: Mark) -> Mark:
        return Mark(payload.number[:, 0])

    def bare(launch: Launch, place: Place, payload: Mark) -> Tensor:
        return payload.number

    for program, words in (
        (narrow, r"narrow must return Mark.number as \(1, 1\) float32, got \(1,\) float32"),
        (bare, r"bare must return a Mark, got \(1, 1\) float32"),
    ):
        with pytest.raises(TypeError, match=words):
            shot(RayType(groups={"world": HitGroup(closest_hit=program)}))
    with pytest.raises(TypeError, match=r"bare must return \(1,\) bool, whether each hit counts; got \(1, 1\) float32"):
        shot(RayType(groups={"world": HitGroup(any_hit=bare)}))
    with pytest.raises(ValueError, match=r"no instance 'fra' in hit groups of rays 'plain' \(did you mean far\?\)"):
        shot(RayType(groups={"fra": HitGroup()}))
    at = torch.zeros(1, 3)
    for payload, words in (
        (torch.zeros(1), "the payload of rays 'plain' must be a dataclass"),
        (Mark(torch.zeros(2, 1)), "must begin with the rays' shape"),
    ):
        with pytest.raises((TypeError, ValueError), match=words):
            dispatch(
                Scene(world=voxels.random_world(0)),
                lambda ray, p=payload: ray.trace("plain", at, at, p),
                {"plain": RayType()},
            )
    with pytest.raises(ValueError, match="no ray type 'shade' in the dispatch"):
        dispatch(scene(), lambda ray: ray.trace("shade", at, at, Mark(at)), {"shadow": RayType()})
    with pytest.raises(ValueError, match="depth must be at least 1"):
        dispatch(scene(), lambda ray: ray, {}, depth=0)


WRONG: Any = "village"
AT = torch.zeros(1, 3)
TENSOR: Any = AT


@pytest.mark.parametrize(
    ("make", "kind", "words"),
    [
        (lambda: HitGroup(closest_hit=WRONG), TypeError, r"closest_hit must be a function \(launch, .*, got a str"),
        (lambda: HitGroup(any_hit=TENSOR), TypeError, r"any_hit must be a function .*, got \(1, 3\) float32"),
        (lambda: RayType(miss=WRONG), TypeError, "miss must be a function"),
        (lambda: RayType(groups=WRONG), TypeError, "groups must be hit groups by instance, .*, got a str"),
        (lambda: RayType(groups={"*": WRONG}), TypeError, "groups must be hit groups by instance, .*, got a str"),
        (lambda: RayType(mask=WRONG), TypeError, "mask must be a whole number, got 'village'"),
        (lambda: RayType(mask=1 << 40), ValueError, "mask must lie in "),
        (lambda: trace(scene(), AT, AT, mask=WRONG), TypeError, "mask must be a whole number, got 'village'"),
        (lambda: sent(mask=WRONG), TypeError, "mask must be a whole number, got 'village'"),
        (lambda: sent(origins=WRONG), TypeError, r"origins must be a torch\.Tensor, got str"),
        (lambda: sent(depth=WRONG), TypeError, "depth must be a whole number, got 'village'"),
    ],
)
def test_what_is_no_program_and_no_mask_is_told(make: Callable[[], Any], kind: type[Exception], words: str):
    assert RayType(mask=~MASK_SHADOW).mask == -3
    with pytest.raises(kind, match=f"^{words}"):
        make()


def sent(origins: Any = AT, depth: int = 2, **how: Any) -> Any:
    send = lambda launch: launch.trace("plain", origins, AT, Mark(AT), **how)
    return dispatch(Scene(world=voxels.random_world(0)), send, {"plain": RayType()}, depth=depth)


def test_rays_that_ignore_without_end_are_told():
    stripes = torch.zeros(4 * MOST_IGNORED, 1, 1, dtype=torch.int16)
    stripes[::2] = voxels.STONE
    found = Scene(world=voxels.World.from_dense(stripes, voxels.TABLE))
    never = HitGroup(any_hit=lambda launch, place, payload: torch.zeros(len(place.origins), dtype=torch.bool))
    at, way = torch.tensor([[-1.0, 0.5, 0.5]]), torch.tensor([[1.0, 0.0, 0.0]])
    with pytest.raises(ValueError, match=f"a ray ignored more than {MOST_IGNORED} hits"):
        dispatch(found, lambda ray: ray.trace("x", at, way, Mark(at)), {"x": RayType(groups={"*": never})})
