"""The lens of a real camera: rays through it, and where it focuses."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt import Camera
from gbufrt.focus import median_depth
from gbufrt.numeric import check_each, check_numbers
from gbufrt.tree import map_tensors
from tracer.sampling.sequence import disc
from tracer.scene.checks import check_is_scene, check_seen_by
from tracer.scene.scene import MASK_PRIMARY, Scene
from tracer.traversal.rays import trace

CENTRAL = ((0.0, 0.0), (-1.0, 0.0), (1.0, 0.0), (0.0, -1.0), (0.0, 1.0))  # times `region`, of half the picture


def one_of(camera: Camera, number: int) -> Camera:
    """A camera of a batch, as a batch of one."""
    return map_tensors(lambda x: x[number : number + 1], camera)


def lens_rays(
    camera: Camera, px: Tensor, u: Tensor, *, aperture_radius: float = 0.0, focus_distance: float = 1.0
) -> tuple[Tensor, Tensor, Tensor]:
    """Rays through a thin lens.

    Every ray through one place in the picture intersects the pinhole's ray on the focal plane. An orthographic camera
    gets the telecentric lens, whose cones all have parallel axes.

    Args:
        camera: one camera.
        px: ``(2, N)`` places in the picture.
        u: ``(2, N)`` in [0, 1): where on the lens, a disc.
        aperture_radius: of the lens, world units; 0 is a pinhole.
        focus_distance: planar depth of the focal plane, world units.

    Returns:
        Origins and unit directions ``(N, 3)``, world space; and ``(N,)`` planar depth per unit of distance.

    Source: Cook, Porter and Carpenter 1984; Potmesil and Chakravarty 1981 (thin lens).
    """
    depth = torch.full_like(px[:1], focus_distance)[None, :, None]
    target = camera.to_world(camera.unproject(depth, px[None, :, None]))[0, :, 0].T
    if camera.orthographic:
        origins = camera.to_world(camera.unproject(torch.zeros_like(depth), px[None, :, None]))[0, :, 0].T
    else:
        origins = camera.position.to(px.dtype).expand_as(target)
    if aperture_radius > 0:
        axes = camera.world_from_view[0, :3, :2].to(px.dtype)
        origins = origins + (axes @ (disc(u) * aperture_radius)).T
    directions = torch.nn.functional.normalize(target - origins, dim=1)
    return origins, directions, directions @ camera.forward[0].to(px.dtype)


def focus_distance(
    scene: Scene,
    camera: Camera,
    *,
    time: float = 0.0,
    previous: Tensor | float | None = None,
    rate: float = 0.1,
    region: float = 0.05,
) -> Tensor:
    """What a camera focuses on: the median depth that a few central rays find, approached over the frames.

    Args:
        scene: what is there.
        camera: B cameras.
        time: seconds.
        previous: ``(B,)`` what this function gave a frame ago; None focuses at once.
        rate: share of the way to the new distance that a frame goes.
        region: how far from the middle the rays are, as a share of half the picture.

    Returns:
        ``(B,)`` planar depth, world units; the camera's ``far`` where all rays miss.

    Raises:
        TypeError: rate or region is no number.
        ValueError: rate or region is not in (0, 1].

    Source: BetterRTX, camera with depth of field.
    """
    check_is_scene(scene)
    check_seen_by(scene, camera)
    check_numbers(rate=rate, region=region)
    if not 0 < rate <= 1 or not 0 < region <= 1:
        raise ValueError(f"rate and region must lie in (0, 1], got rate={rate}, region={region}")
    if previous is not None:
        check_each(0, above=True, unit="world units", previous=previous)
        if isinstance(previous, Tensor) and tuple(previous.shape) not in ((), (1,), (camera.batch,)):
            raise ValueError(f"previous must be a number or ({camera.batch},), got {tuple(previous.shape)}")
    poses, found = scene.poses([time])[0].to(camera.device), []
    for b in range(camera.batch):
        one = one_of(camera, b)
        half = one.intrinsics.new_tensor([one.width / 2, one.height / 2])[:, None]
        px = half * (1 + region * half.new_tensor(CENTRAL).T)
        origins, directions, along = lens_rays(one, px, torch.zeros_like(px))
        hits = trace(
            scene, origins, directions, poses=poses, mask=MASK_PRIMARY, t_min=one.near / along, t_max=one.far / along
        )
        found.append(torch.where(hits.hit, hits.t * along, torch.nan))
    target = median_depth(torch.stack(found), camera.far)
    if previous is None:
        return target
    return torch.lerp(
        torch.as_tensor(previous, dtype=target.dtype, device=target.device).expand_as(target), target, rate
    )
