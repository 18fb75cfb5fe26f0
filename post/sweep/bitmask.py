"""Ambient occlusion by visibility bitmasks: taps cover sectors of each slice's arc."""

from __future__ import annotations

import math
from typing import Any

import torch
from torch import Tensor

from gbufrt.camera import Camera
from gbufrt.channels import check_tensor
from gbufrt.compute.resident import number
from gbufrt.gbuffer import CHANNELS
from gbufrt.mending import held
from gbufrt.noise.noise import blue_noise
from gbufrt.numeric import check_between
from post.margin.op import scene
from post.sweep import arcs, slices
from post.sweep.chords import thickness_from_depth
from post.sweep.layout import Receiving
from post.sweep.op import sweep
from post.sweep.open_sky import sky_beyond
from post.sweep.thickness import planar_thickness


def bitmask_ao(
    depth: Tensor,
    normal: Tensor,
    camera: Camera,
    *,
    hit: Tensor | None = None,
    where: Tensor | None = None,
    thickness: Tensor | float | None = None,
    radius: float | Tensor | None = 0.5,
    directions: int = 4,
    steps: int = 12,
    scales: int = 1,
    hidden: float = 0.15,
    soft: bool | None = None,
    index: int | Tensor = 0,
    seed: int = 0,
    compiled: bool | None = None,
) -> tuple[Tensor, Tensor]:
    """Ambient visibility within a radius, and the mean open direction.

    Every tap covers the sectors between the front and the back of its surface. Successive taps whose depth ranges
    overlap are one body without a gap. A body that crosses the radius covers sectors up to the crossing. Surfaces cut
    by the picture's border continue beyond it, see `post.margin`.

    Args:
        depth: ``(B, 1, H, W)`` planar view z, world units.
        normal: ``(B, 3, H, W)`` world space, unit length.
        camera: of the picture.
        hit: ``(B, 1, H, W)`` bool; by default every pixel.
        where: ``(B, 1, H, W)`` bool: pixels whose visibility is wanted; others may get any. By default all that hit.
        thickness: ``(B, 1, H, W)`` measured along the view ray, world units; or one assumed for everything; by default
            estimated, see `post.thickness_from_depth`.
        radius: world units; occluders farther away do not count. None for no limit: `post.sweep.open_sky` then
            estimates how open the uncovered directions are that leave the picture. A 0-dim tensor to get its gradient,
            by torch code that takes over a hundred times as long as the kernel; without ``requires_grad``, or under
            ``torch.no_grad``, it is as fast as a number.
        directions: slices, each through the pixel to both sides.
        steps: taps on each side of a slice.
        scales: number of radii, at most 16, each twice the one before; the result is their mean. All share the taps of
            one sweep.
        hidden: radii added behind measured backs, for hidden geometry there (see samples/fit_ao.py).
        soft: fractional coverage of edge sectors, differentiable in depth, normal, thickness and radius; by default
            where gradients are wanted. Otherwise edges are dithered.
        index: frame number, for the noise.
        seed: another seed, another noise.
        compiled: whether to use the kernel; by default for float32 on the CPU, where edges are dithered and no gradient
            is wanted.

    Returns:
        ao ``(B, 1, H, W)``, 1 open (also where nothing was hit); bent_normal ``(B, 3, H, W)``, world space, unit
        length, 0 where nothing was hit.

    Raises:
        ValueError: directions, steps, scales or radius are not positive, thickness or hidden is negative, or a kernel
            is requested with soft edges, or for tensors that it does not take.

    Source: Therrien et al. 2023, "Screen Space Indirect Lighting with Visibility Bitmask".
    """
    given = {"depth": depth, "normal": normal, "hit": hit, "thickness": thickness}
    slices.check_sweep(camera, directions, steps, radius, scales, **given)
    check_between(0, math.inf, hidden=hidden)
    if where is not None:
        row, like = CHANNELS["hit"], {"batch": camera.batch, "size": camera.size, "device": camera.device}
        check_tensor("where", where, row, **like)
    hit = torch.ones_like(depth, dtype=torch.bool) if hit is None else hit
    depth, hit, normal = held(depth, hit, normal, camera.far)
    reach = None if radius is None else number(radius, depth)
    radii = () if reach is None else tuple(reach * 2**scale for scale in range(scales))
    thickness = thickness_from_depth(depth, normal, camera, hit=hit) if thickness is None else thickness
    behind_back = 0.0 if reach is None else hidden * reach
    solid = planar_thickness(camera, depth, hit, thickness, behind_back, radii[-1] if radii else None)
    around = scene(camera, depth, normal, hit, solid, within=reach is None, compiled=compiled)
    if soft is None:
        soft = torch.is_grad_enabled() and any(
            t is not None and t.requires_grad for t in (around.picture, depth, normal, reach)
        )
    sky = None if radii else sky_beyond(camera, hit, normal)
    noise = blue_noise(*camera.size, index=index, dims=3, seed=seed, device=depth.device).to(depth.dtype)
    if compiled and soft:
        raise ValueError("soft edges have no compiled form; leave compiled at None or False")
    pixels = Receiving(camera, depth, normal, hit if where is None else hit & where)
    sizes: dict[str, Any] = {"directions": directions, "steps": steps, "soft": soft, "compiled": compiled}
    every = sweep(around, pixels, noise, radii, sky, **sizes)
    del around, noise, solid, thickness  # a quarter of what is in memory here at once
    return arcs.mean_of_scales([(found[:, :1], found[:, 1:]) for found in every], hit, normal)
