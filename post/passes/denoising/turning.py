"""Bodies that turn by themselves: how many frames of light their surfaces may hold."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt import GBuffer
from gbufrt.compute.resident import waits
from gbufrt.directions import length
from gbufrt.luminance import luminance
from gbufrt.sampling import gather, sample
from post.filters.around import pooled

MOVES = 0.05  # pixels besides the motion of a still world, from which on a surface moves by itself
TURNS = 0.002  # radians a frame, from which on a surface turns
AGREE = 0.99  # length of the mean of four normals below which they are of an edge
AROUND = 5  # pixels: square over which turns are averaged, as normals between pixels are off to any side
NOISE = 7  # pixels: square over which noise is compared with light
SHARED = 6.0  # pixels besides its own whose noise a filter averages inside a surface


def frames_lit(light: Tensor, g: GBuffer, before: GBuffer) -> Tensor | None:
    """Frames that a mean of diffuse light may hold on surfaces that turn by themselves.

    Motion follows the surface, and so takes its light along from where it faced before. A mean of N frames lags by
    N / 2 turns, and has 1 / N of a frame's noise, which a filter then averages over pixels: the sum of squares is least
    where the cube of N is twice what is left of the variance, relative to the light, over the square of the turn.

    Args:
        light: ``(B, 3, H, W)`` of this frame, without albedo.
        g: of this frame.
        before: of the frame before.

    Returns:
        ``(B, 1, H, W)``, at least 1, infinite where surfaces do not turn; None where nothing moves by itself.
    """
    if g.motion is None:
        return None
    own = g.hit & (length(g.motion - g.camera.static_motion(before.camera, g.depth, g.hit)[0]) > MOVES)
    if not (waits(own) or bool(own.any())):
        return None
    turn, whole = turned(g, before, g.motion, own)
    shine = luminance(light)
    mean, square = pooled(torch.cat([shine, shine * shine], dim=1), g.hit.to(shine), NOISE).split(1, dim=1)
    noise = torch.where(mean > 0, (square - mean * mean) / (mean * mean).clamp_min(1e-12), torch.inf)
    frames = (2 * noise / (1 + SHARED * whole) / turn.square().clamp_min(TURNS**2)).clamp_min(1.0) ** (1 / 3)
    return torch.where(turn > TURNS, frames, torch.inf)


def turned(g: GBuffer, before: GBuffer, motion: Tensor, own: Tensor) -> tuple[Tensor, Tensor]:
    """How far surfaces have turned by themselves since the frame before.

    Args:
        g: of this frame.
        before: of the frame before.
        motion: ``(B, 2, H, W)`` pixels, previous minus current.
        own: ``(B, 1, H, W)`` bool: surfaces that move by themselves.

    Returns:
        Radians, ``(B, 1, H, W)``, 0 elsewhere; and the share, likewise, of the pixels around that lie inside such a
        surface.
    """
    here, there = (x.normal if x.normal_geo is None else x.normal_geo for x in (g, before))
    px = g.camera.pixel_centers(dtype=g.depth.dtype) + motion.to(g.depth)
    if before.camera.jitter is not None:
        px = px - before.camera.jitter.to(px)[:, :, None, None]
    was, column, row = sample(there, px), *px.floor().long().unbind(1)
    size = length(was)
    inside = own & (size > AGREE)
    if g.object_id is not None and before.object_id is not None:
        inside = inside & (gather(before.object_id, column, row) == g.object_id)
    turn, counted = torch.where(inside, here - was / size.clamp_min(AGREE), 0.0), inside.to(g.depth)
    around = length(pooled(turn, counted, AROUND))
    turn = torch.where(inside, torch.minimum(length(turn), around), around)
    return torch.where(own, turn, 0.0), pooled(counted, torch.ones_like(counted), AROUND)
