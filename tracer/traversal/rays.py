"""What a ray hits in a scene, and how much light it transmits."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from gbufrt.compute.resident import number
from gbufrt.numeric import check_bits
from gbufrt.tree import map_tensors
from tracer.scene.grids import HIGH, LOW, ORIGIN
from tracer.scene.poses import inverse
from tracer.scene.scene import MASK_PRIMARY, MASK_SHADOW, Scene
from tracer.traversal import op as ops
from tracer.traversal.checks import check_beyond, check_ends, check_rays
from tracer.traversal.hits import Hits

FARTHEST = 1e20  # where every ray ends, so that one without a direction hits nothing
MARGIN = 1e-6  # of bounding spheres, against rounding


def trace(
    scene: Scene,
    origins: Tensor,
    directions: Tensor,
    *,
    poses: Tensor | None = None,
    mask: int = MASK_PRIMARY,
    t_min: Tensor | float = 0.0,
    t_max: Tensor | float = torch.inf,
    beyond: Hits | None = None,
    ignoring: bool = False,
) -> Hits:
    """The nearest surface of world and instances along each ray.

    A surface is where the material changes: from air into something, between a transmissive material and another one,
    or from a transmissive one back into air. A ray that begins in an opaque voxel first leaves it without a hit, so a
    camera inside a block looks through back faces. A ray that begins exactly on a face is in the voxel it heads into.

    Args:
        scene: world and instances.
        origins: ``(..., 3)`` world space.
        directions: ``(..., 3)`` world space; ``t`` is in units of their length.
        poses: ``(I, 4, 4)`` of the instances, or ``(B, I, 4, 4)`` for rays ``(B, ..., 3)``; see `Scene.poses`. May be
            left out where there are no instances.
        mask: which instances rays can hit: those whose own mask shares a bit.
        t_min: where rays begin; a number or ``(...)``.
        t_max: where they end.
        beyond: earlier hits of the same rays: continue behind each, through the transmissive material hit there, to the
            next surface. Rays whose earlier hit is opaque, or a miss, miss.
        ignoring: with ``beyond``: continue behind opaque hits too, as if their material were not there.

    Returns:
        `Hits` of the shape of the rays.

    Raises:
        TypeError: an argument is of another kind.
        ValueError: shapes or devices do not fit each other or the scene.
    """
    check_bits(mask=mask)
    shape, rays = _rays(scene, origins, directions, poses, t_min, t_max)
    left = rays.origins.new_zeros(0, 5, dtype=torch.int32)
    if beyond is not None:
        check_beyond(beyond, shape)
        passes = beyond.hit
        if not ignoring:
            passes = passes & (scene.materials.opacity[beyond.material.long()] < 1)
        begin = torch.where(passes, beyond.t, torch.inf).reshape(-1)
        rays.spans[:, 0] = torch.maximum(rays.spans[:, 0], begin)
        left = _starts(beyond)
    numbers, ids = ops.surface(list(rays), scene.grids.tensors, left, mask)
    hit = ids[:, 1] >= 0
    hits = Hits(
        t=numbers[:, 0],
        hit=hit,
        material=ids[:, 0],
        instance=ids[:, 1].clamp_min(0),
        normal=_normals(ids, rays.transforms),
        cell=ids[:, 4:],
        local=numbers[:, 1:],
        face=ids[:, 2],
        back_face=ids[:, 3] > 0,
    )
    return map_tensors(lambda x: x.reshape(shape + x.shape[1:]), hits)


def transmission(
    scene: Scene,
    origins: Tensor,
    directions: Tensor,
    *,
    poses: Tensor | None = None,
    mask: int = MASK_SHADOW,
    t_min: Tensor | float = 0.0,
    t_max: Tensor | float = torch.inf,
) -> Tensor:
    """Share of light that is transmitted between the ends of each ray.

    Anything opaque blocks it, also where the ray begins inside. Each run through one transmissive material multiplies
    it by ``(1 - opacity) * tint ** length``, and by the share that the entry face does not reflect, or the exit face if
    the ray begins inside. Faces are assumed smooth.

    Args:
        scene: world and instances.
        origins: ``(..., 3)`` world space. To leave a surface, begin a little above it.
        directions: ``(..., 3)`` world space; ``t`` and run lengths are in units of their length: use unit vectors.
        poses: as for `trace`.
        mask: as for `trace`.
        t_min: as for `trace`.
        t_max: as for `trace`.

    Returns:
        ``(..., 3)`` in [0, 1].

    Raises:
        ValueError: shapes do not fit each other or the scene.
    """
    check_bits(mask=mask)
    shape, rays = _rays(scene, origins, directions, poses, t_min, t_max)
    passed = ops.transmit(list(rays), scene.grids.tensors, mask)
    return passed.reshape(*shape, 3)


def run_lengths(
    scene: Scene,
    origins: Tensor,
    directions: Tensor,
    hits: Hits,
    *,
    poses: Tensor | None = None,
    cap: float = 64.0,
) -> tuple[Tensor, Tensor]:
    """Length of each ray inside what it hit.

    Args:
        scene: world and instances.
        origins: ``(..., 3)`` world space.
        directions: ``(..., 3)`` world space, unit length.
        hits: of these rays.
        poses: as for `trace`.
        cap: look no farther than this, world units.

    Returns:
        Two of ``(...)``, world units: through voxels of the same grid that are not air; and through those of the
        material that was hit, before any other. Both are 0 on a miss and on a back face.
    """
    shape, rays = _rays(scene, origins, directions, poses, hits.t, hits.t + cap)
    starts = _starts(hits)
    starts[:, 1] = torch.where((hits.hit & ~hits.back_face).reshape(-1), starts[:, 1], -1)
    lengths = ops.runs(list(rays), scene.grids.tensors, starts)
    return lengths[:, 0].reshape(shape), lengths[:, 1].reshape(shape)


class _Rays(NamedTuple):
    origins: Tensor
    directions: Tensor
    spans: Tensor
    transforms: Tensor


def _rays(
    scene: Scene,
    origins: Tensor,
    directions: Tensor,
    poses: Tensor | None,
    t_min: Tensor | float,
    t_max: Tensor | float,
) -> tuple[tuple[int, ...], _Rays]:
    """Rays as flat float32 rows, with the transforms into every grid; and the shape they had."""
    check_rays(scene, origins, directions, poses)
    shape = tuple(origins.shape[:-1])
    check_ends(shape, t_min=t_min, t_max=t_max)
    transforms = grid_from_world(scene, poses, origins.device)
    if transforms.shape[0] > 1 and (not shape or shape[0] != transforms.shape[0]):
        raise ValueError(
            f"rays must be ({transforms.shape[0]},...,3) for the batch of poses, got {tuple(origins.shape)}"
        )
    ends = [number(t, origins).float().expand(shape) for t in (t_min, t_max)]
    flat = _Rays(
        origins=origins.detach().float().reshape(-1, 3).contiguous(),
        directions=directions.detach().float().reshape(-1, 3).contiguous(),
        spans=torch.stack([ends[0], ends[1].clamp_max(FARTHEST)], dim=-1).reshape(-1, 2),
        transforms=transforms,
    )
    return shape, flat


def grid_from_world(scene: Scene, poses: Tensor | None, device: torch.device) -> Tensor:
    """``(B, I + 1, 4, 4)`` float64, see `tracer.traversal.op`: where a grid counts voxels from its index's corner.

    Raises:
        ValueError: the poses do not fit the scene.
    """
    count = len(scene.instances)
    if poses is None:
        poses = torch.zeros(0, 4, 4)
        if count:
            raise ValueError(f"poses must be given for a scene with {count} instances: scene.poses([time])")
    poses = poses[None] if poses.ndim == 3 else poses
    if poses.ndim != 4 or poses.shape[1:] != (count, 4, 4) or not len(poses):
        raise ValueError(f"poses must be ({count},4,4) or (B,{count},4,4), got {tuple(poses.shape)}")
    matrices = torch.eye(4, dtype=torch.float64, device=device).repeat(poses.shape[0], count + 1, 1, 1)
    matrices[:, 1:] = scene.world_from_model(poses.to(device=device, dtype=torch.float64))
    into = inverse(matrices)
    entries = scene.grids.entries.to(device=device, dtype=torch.float64)
    origin, low, high = (entries[:, first : first + 3] for first in (ORIGIN, LOW, HIGH))
    into[..., 3] -= origin
    center = (matrices[..., :3, :3] @ ((low + high) / 2 + origin)[..., None])[..., 0] + matrices[..., :3, 3]
    radius = matrices[..., :3, 0].norm(dim=-1) * (high - low).norm(dim=-1) / 2
    sphere = torch.cat([center, radius[..., None] * (1 + MARGIN) + MARGIN], dim=-1)
    return torch.cat([into, sphere[..., None, :]], dim=-2)


def _starts(hits: Hits) -> Tensor:
    parts = hits.material.reshape(-1, 1), hits.instance.reshape(-1, 1), hits.cell.reshape(-1, 3)
    return torch.cat(parts, dim=1)


def _normals(ids: Tensor, transforms: Tensor) -> Tensor:
    """World normals of faces: the rows of a grid-from-world matrix are the gradients of the grid's coordinates."""
    rows = torch.nn.functional.normalize(transforms[..., :3, :3], dim=-1).float()
    faces = torch.stack([-rows, rows], dim=3).flatten(1, 3)  # (B, (I + 1) * 6, 3)
    faces = torch.nn.functional.pad(faces, (0, 0, 6, 0))  # entry -1, of rays that hit nothing, has no normal
    place = (ids[:, 1] * 6 + (ids[:, 2] + 6)).view(len(faces), -1)
    if len(faces) > 1:
        place = place + torch.arange(len(faces), dtype=place.dtype, device=ids.device)[:, None] * faces.shape[1]
    return faces.flatten(0, 1).index_select(0, place.flatten())
