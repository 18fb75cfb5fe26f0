"""Programmable rays: what happens where a ray hits, or misses, is up to functions of the user's.

As in DirectX Raytracing: a ray generation program sends rays of several types; hit groups, chosen by ray type and
instance, say what a hit does; each instance has a mask, and each ray says which bits it sees; a payload travels along.
Here a program does not run for one ray, but once for all rays that came to it: its tensors have a row for each.

Source: Microsoft, "DirectX Raytracing (DXR) Functional Spec".
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeVar

import torch
from torch import Tensor

from gbufrt.names import unknown
from gbufrt.numeric import check_bits, check_counts, check_kind
from gbufrt.tree import map_tensors
from tracer.scene.checks import check_is_scene
from tracer.scene.scene import MASK_ALL, Scene
from tracer.traversal.hits import Hits, Place
from tracer.traversal.payloads import accepted, changed, check_programs, described, flat_rows, taken, with_rows
from tracer.traversal.rays import trace

P = TypeVar("P")
EVERY = "*"  # instances without a hit group of their own; the name of the world is `WORLD`
WORLD = "world"
MOST_IGNORED = 64  # hits that a ray passes by at most


@dataclass(frozen=True, kw_only=True)
class HitGroup:
    """What hits on some instances do.

    Args:
        closest_hit: ``(launch, place, payload) -> payload``, run for the nearest hits that are not ignored.
        any_hit: ``(launch, place, payload) -> (N,) bool``, run for hits as they are found; where it is False the hit is
            ignored, and the ray goes on behind it as if its material were not there.
    """

    closest_hit: Callable[[Launch, Place, Any], Any] | None = None
    any_hit: Callable[[Launch, Place, Any], Tensor] | None = None

    def __post_init__(self) -> None:
        check_programs(closest_hit=self.closest_hit, any_hit=self.any_hit)


@dataclass(frozen=True, kw_only=True)
class RayType:
    """What rays of a type do.

    Args:
        groups: hit groups by the name of an instance, ``world`` for the world, ``*`` for all others.
        miss: ``(launch, place, payload) -> payload``, run for rays that hit nothing.
        mask: instances that share a bit with it are hit; `Launch.trace` may say another.
        first_hit: rays that ask only whether there is something: their closest hit programs do not run, so that the
            payload tells by what the miss program makes of it.
    """

    groups: Mapping[str, HitGroup] = field(default_factory=dict)
    miss: Callable[[Launch, Place, Any], Any] | None = None
    mask: int = MASK_ALL
    first_hit: bool = False

    def __post_init__(self) -> None:
        groups = self.groups.values() if isinstance(self.groups, Mapping) else [self.groups]
        if wrong := [group for group in groups if not isinstance(group, HitGroup)]:
            told = f"got {described(wrong[0])}"
            raise TypeError(f'groups must be hit groups by instance, as in {{"*": tracer.HitGroup(...)}}, {told}')
        check_programs(miss=self.miss)
        check_bits(mask=self.mask)


@dataclass(frozen=True, eq=False, kw_only=True)
class Launch:
    """Rays under way: what programs send further rays with.

    Args:
        scene: what there is to hit.
        poses: ``(I, 4, 4)`` of its instances.
        rays: types by name.
        depth: how many rays led here.
        deepest: the most that may.
    """

    scene: Scene
    poses: Tensor | None
    rays: Mapping[str, RayType]
    depth: int = 0
    deepest: int = 8

    def trace(
        self,
        kind: str,
        origins: Tensor,
        directions: Tensor,
        payload: P,
        *,
        mask: int | None = None,
        t_min: Tensor | float = 0.0,
        t_max: Tensor | float = torch.inf,
    ) -> P:
        """Send rays, and run the programs of what they meet.

        Args:
            kind: name of their type.
            origins: ``(..., 3)`` world space.
            directions: ``(..., 3)``; t is in units of their length.
            payload: a dataclass of tensors, each beginning with the rays' shape.
            mask: which instances they see; by default the type's.
            t_min: where they begin, a number or ``(...)``; after a bounce a little above 0.
            t_max: where they end.

        Returns:
            The payload as the programs left it.

        Raises:
            ValueError: there is no such type, shapes do not fit, or rays led to rays too often.
            TypeError: a payload is no dataclass of tensors, or a program returns something else.
        """
        if kind not in self.rays:
            raise ValueError(unknown("ray type", kind, "the dispatch", self.rays))
        if self.depth >= self.deepest:
            raise ValueError(f"rays of type {kind!r} recurse deeper than {self.deepest}: give dispatch a larger depth")
        check_kind(Tensor, "origins", origins)
        check_kind(Tensor, "directions", directions)
        shape = origins.shape[:-1]
        flat = flat_rows(payload, shape, f"the payload of rays {kind!r}")
        place = Place(origins=origins.reshape(-1, 3), directions=directions.reshape(-1, 3))
        ends = [torch.as_tensor(t, dtype=torch.float32, device=origins.device).expand(shape) for t in (t_min, t_max)]
        done = self._run(self.rays[kind], kind, place, flat, self.rays[kind].mask if mask is None else mask, ends)
        return map_tensors(lambda x: x.reshape(shape + x.shape[1:]), done)

    def _run(self, rays: RayType, kind: str, place: Place, payload: Any, mask: int, ends: list[Tensor]) -> Any:
        begin, end = (t.reshape(-1) for t in ends)
        deeper = Launch(scene=self.scene, poses=self.poses, rays=self.rays, depth=self.depth + 1, deepest=self.deepest)
        groups = self._groups(rays, kind)
        hits = trace(self.scene, place.origins, place.directions, poses=self.poses, mask=mask, t_min=begin, t_max=end)
        place = Place(origins=place.origins, directions=place.directions, hits=hits)
        if any(group.any_hit for _, group in groups):
            hits = deeper._accepted(groups, place, payload, mask, end)
            place = Place(origins=place.origins, directions=place.directions, hits=hits)
        if not rays.first_hit:
            for members, group in groups:
                if group.closest_hit is not None:
                    at = hits.hit & torch.isin(hits.instance, members)
                    payload = changed(group.closest_hit, deeper, place, payload, at)
        if rays.miss is not None:
            missed = Place(origins=place.origins, directions=place.directions)
            payload = changed(rays.miss, deeper, missed, payload, ~hits.hit)
        return payload

    def _accepted(self, groups: Groups, place: Place, payload: Any, mask: int, end: Tensor) -> Hits:
        """The nearest hits that no program ignores."""
        hits, pending = place.found, place.found.hit
        for _ in range(MOST_IGNORED):
            ignored = torch.zeros_like(pending)
            for members, group in groups:
                at = pending & torch.isin(hits.instance, members)
                if group.any_hit is not None and bool(at.any()):
                    here = taken(Place(origins=place.origins, directions=place.directions, hits=hits), at)
                    ignored[at] = ~accepted(group.any_hit, self, here, taken(payload, at))
            if not bool(ignored.any()):
                return hits
            some = taken(Place(origins=place.origins, directions=place.directions, hits=hits), ignored)
            after = trace(
                self.scene, some.origins, some.directions, poses=self.poses, mask=mask, t_max=end[ignored],
                beyond=some.found, ignoring=True,
            )  # fmt: skip
            hits = with_rows(hits, ignored, after)
            pending = ignored & hits.hit
        raise ValueError(
            f"a ray ignored more than {MOST_IGNORED} hits: let any-hit programs accept some, or end it with t_max"
        )

    def _groups(self, rays: RayType, kind: str) -> Groups:
        """Which instances, 0 the world, each hit group of a type is for."""
        left = set(range(len(self.names)))
        found = []
        for name, group in rays.groups.items():
            if name == EVERY:
                continue
            members = {i for i, known in enumerate(self.names) if known == name}
            if not members:
                raise ValueError(unknown("instance", name, f"hit groups of rays {kind!r}", self.names))
            left -= members
            found.append((members, group))
        if EVERY in rays.groups:
            found.append((left, rays.groups[EVERY]))
        device = self.scene.world.device
        return [(torch.tensor(sorted(members), dtype=torch.int32, device=device), group) for members, group in found]

    @cached_property
    def names(self) -> list[str]:
        """Of the world and of all instances, by their number in `Hits.instance`."""
        return [WORLD, *(instance.name for instance in self.scene.instances)]


Groups = list[tuple[Tensor, HitGroup]]


def dispatch(
    scene: Scene,
    generation: Callable[[Launch], P],
    rays: Mapping[str, RayType],
    *,
    poses: Tensor | None = None,
    depth: int = 8,
) -> P:
    """Run a ray generation program over a scene.

    Args:
        scene: world and instances; `Instance.mask` says which rays see an instance.
        generation: sends rays with `Launch.trace`, and returns what it makes of their payloads.
        rays: types by name, with the programs of their hits and misses.
        poses: ``(I, 4, 4)`` of the instances, see `Scene.poses`; may be left out where there are none.
        depth: how many rays may follow from one another; a shadow ray from a first hit is the second.

    Returns:
        What ``generation`` returns.

    Raises:
        ValueError: depth is below 1, or poses do not fit the scene.
    """
    check_is_scene(scene)
    if not callable(generation):
        raise TypeError(f"generation must be a function that takes a Launch, got {described(generation)}")
    if not isinstance(rays, Mapping) or not all(isinstance(kind, RayType) for kind in rays.values()):
        raise TypeError(f'rays must be ray types by name, as in {{"shadow": tracer.RayType()}}, got {rays!r}')
    check_counts(depth=depth)
    if depth < 1:
        raise ValueError(f"depth must be at least 1, got {depth}")
    return generation(Launch(scene=scene, poses=poses, rays=rays, deepest=depth))
