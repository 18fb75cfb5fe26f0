"""Settings that a profile leaves to the pixels: the kind of depth, and the space of normals."""

from __future__ import annotations

import math
from dataclasses import replace

import torch
from torch import Tensor

from gbufrt.camera import Camera
from gbufrt.files.gbuffers.agreement import CLOSE
from gbufrt.files.gbuffers.convert import VIEWS, distances, planar, told, world_normals
from gbufrt.files.gbuffers.depths import stored_depth
from gbufrt.files.gbuffers.flatness import BEND, bend_of
from gbufrt.files.gbuffers.named import Named
from gbufrt.files.gbuffers.profile import AUTO, Profile
from gbufrt.files.gbuffers.surfaces import hit_of

KINDS = ("planar", "ray", "reciprocal")
PARALLEL = 0.9985  # cosine of normals and those of depth, half of which are above it where they lie in a camera's space
FITS = 0.25  # share of the normals within `CLOSE` of those of depth, from which on they tell its kind
MANY = 8  # a picture's sides, up to which its pixels tell nothing
ROUNDING = 1e-6  # of cosines
FLATTER = 0.1  # of the bend of planar depth, which another kind must stay below: curved surfaces bend by every kind


def settled(named: Named, camera: Camera, *, posed: bool = True) -> Named:
    """The same layers under a profile in which what was ``auto`` is as the pixels have it.

    Of all readings of depth and normals that are open, those are taken whose normals are most parallel. Without
    normals theirs stay open, and the kind of depth is that by which planes are flat, as it is where normals fit by no
    reading. Without a pose so do normals that fit no space of the camera.

    Args:
        named: channels of a file under the names of a profile.
        camera: of the picture.
        posed: whether the camera's pose is known.
    """
    depth, profile = stored_depth(named, camera, posed=posed)
    named, keys = Named(named.layers, profile), named.keys("normal")
    if not profile.is_open:
        return named
    kinds, ways = KINDS if profile.depth_kind == AUTO else (profile.depth_kind,), _ways(profile)
    normal = named.layers.stack(keys, camera.size) if keys else None
    if normal is not None and told(normal) and min(camera.size) > MANY:
        ways = ways if posed else [(space, up) for space, up in ways if space != "world"]
        read = [replace(profile, depth_kind=kind, normal_space=s, up=up) for kind in kinds for s, up in ways]
        found = min(read, key=lambda reading: _apart(_cosines(reading, depth, normal, camera)), default=profile)
        cosines = _cosines(found, depth, normal, camera)
        fits = float((cosines > math.cos(math.radians(CLOSE))).float().mean()) > FITS
        if float(cosines.median()) > PARALLEL or (posed and (fits or len(kinds) == 1)):
            return Named(named.layers, found)
        if posed:
            profile = replace(profile, normal_space=found.normal_space, up=found.up)
    known = len(kinds) == 1 or min(camera.size) <= MANY
    kind = kinds[0] if known else _flattest(profile, depth, camera)
    return Named(named.layers, replace(profile, depth_kind=kind))


def found_settings(before: Profile, after: Profile) -> str:
    """What `settled` has found, as a line of a profile; empty where nothing was open."""
    keys = [key for key in ("depth_kind", "normal_space", "up") if getattr(before, key) != getattr(after, key)]
    return ", ".join(f'{key} = "{getattr(after, key)}"' for key in keys)


def _ways(profile: Profile) -> list[tuple[str, str]]:
    """Spaces and upward axes that a profile allows."""
    spaces = ("world", *VIEWS) if profile.normal_space == AUTO else (profile.normal_space,)
    ups = ("y", "z") if profile.up == AUTO else (profile.up,)
    return [(space, up) for space in spaces for up in (ups if space == "world" else ups[:1])]


def _depth(profile: Profile, raw: Tensor, camera: Camera) -> tuple[Tensor, Tensor]:
    """Planar depth, and where something was hit."""
    hit = hit_of(raw, profile)
    return planar(torch.where(hit, distances(raw, profile), 1.0), profile, camera), hit


def _cosines(profile: Profile, raw: Tensor, normal: Tensor, camera: Camera) -> Tensor:
    """``(N,)`` how parallel normals are to those of the depth, whatever side they face; a 0 where there are none."""
    depth, hit = _depth(profile, raw, camera)
    like = camera.normals_from_depth(torch.where(hit, depth, camera.far))
    read, size = world_normals(normal, profile, camera)
    both = hit & (size > 0)
    return (read * like).sum(1, keepdim=True).abs()[both] if bool(both.any()) else raw.new_zeros(1)


def _apart(cosines: Tensor) -> float:
    """How far normals are from those of the depth: the mean logarithm, so that what is wrong at edges by every reading
    does not hide which one is right on surfaces."""
    return float((1 - cosines).clamp_min(ROUNDING).log().mean())


def _flattest(profile: Profile, raw: Tensor, camera: Camera) -> str:
    """On a plane 1 / z is linear over the picture. Planar depth, unless by another kind planes are far flatter."""
    bends = dict[str, float]()
    for kind in KINDS:
        depth, hit = _depth(replace(profile, depth_kind=kind), raw, camera)
        bends[kind] = bend_of(depth, hit, orthographic=camera.orthographic)
    best = min(bends, key=lambda kind: bends[kind])
    return best if bends[KINDS[0]] > BEND and bends[best] < FLATTER * bends[KINDS[0]] else KINDS[0]
