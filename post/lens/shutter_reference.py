"""An open shutter in torch: the definitions of `post.lens.op.reconstruct` and `blur_alike`, with their gradients.

Beyond the border of the picture its border goes on. What comes in from there is not known; but left out, pixels there
would be the mean of one end of their path alone, and noisy.
"""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt.directions import length
from gbufrt.sampling import pixel_centers, sample, shifted
from post.lens.constants import ALIKE, LANDING_RELATIVE, LANDING_TOLERANCE, OVERSHOOT, OWN_WEIGHT, STILL


def reconstruct_reference(
    color: Tensor,
    depth: Tensor,
    path: Tensor,
    dominant: Tensor,
    noise: Tensor,
    opening: float,
    samples: int,
    softness: float | Tensor,
) -> Tensor:
    """``(B, C, H, W)``. Arguments and result are those of `post.lens.op.reconstruct`."""
    px, sharp = pixel_centers(color), prefiltered(color, path, opening)
    known = torch.cat([depth.to(color.dtype), path], dim=1)
    total, weight = color * OWN_WEIGHT, torch.full_like(color[:, :1], OWN_WEIGHT)
    for time in moments(noise, opening, samples):
        visible, share = _moment(sharp, known, px, path, dominant, time, softness)
        total, weight = total + visible, weight + share
    moves = dominant.detach().square().sum(1, keepdim=True) > STILL**2
    return torch.where(moves, total / weight, color)


def similar_reference(color: Tensor, path: Tensor, noise: Tensor, opening: float, samples: int) -> Tensor:
    """``(B, C, H, W)``. Arguments and result are those of `post.lens.op.blur_alike`."""
    px, sharp = pixel_centers(color), prefiltered(color, path, opening)
    total, weight = color, torch.ones_like(color[:, :1])
    for time in moments(noise, opening, samples):
        at = px - path * time
        there = sample(path, at, mode="nearest")
        alike = (there * path).sum(1, keepdim=True) / path.square().sum(1, keepdim=True).clamp_min(1e-12)
        alike = alike.clamp(0, 1)
        total, weight = total + alike * sample(sharp, at), weight + alike
    return total / weight


def prefiltered(color: Tensor, path: Tensor, opening: float) -> Tensor:
    """The picture to read between pixels: sharper along each path by what linear interpolation will blur.

    Linear interpolation at a fraction f between two pixels spreads them by a variance of f (1 - f). Over a path of many
    moments its mean is known, 1/6 for long ones, and second differences take away as much. Noise and edges hardly leave
    the range of the pixels beside them.

    Args:
        color: ``(B, C, H, W)``.
        path: ``(B, 2, H, W)`` pixels, the way of each pixel's surface while the shutter is open.
        opening: see `post.lens.op.reconstruct`.

    Returns:
        ``(B, C, H, W)``.

    Source: our own; second differences undo a blur to the order of its variance.
    """
    reach = (path.abs() * farthest(opening)).clamp_max(1.0)
    across, down = (reach * (0.5 - reach / 3)).split(1, dim=1)  # means of f (1 - f)
    left, right, above, below = (shifted(color, *at) for at in ((-1, 0), (1, 0), (0, -1), (0, 1)))
    sharp = color - across / 2 * (left + right - 2 * color) - down / 2 * (above + below - 2 * color)
    around = torch.stack([color, left, right, above, below])
    low, high = around.amin(0), around.amax(0)
    beyond = torch.minimum(
        OVERSHOOT * (high - low), low.clamp_min(0.0)
    )  # what cannot get darker may not brighten others
    return torch.minimum(torch.maximum(sharp, low - beyond), high + beyond)


def farthest(opening: float) -> float:
    """The moment of an exposure that is farthest from the frame, in exposures."""
    return max(-opening, 1 + opening)


def moments(noise: Tensor, opening: float, samples: int) -> list[Tensor]:
    """``(1, 1, H, W)`` each: the moments of an exposure that lasts a frame and starts at ``opening``, in frames."""
    return [opening + (i + noise[None, None]) / samples for i in range(samples)]


def _moment(
    color: Tensor, known: Tensor, px: Tensor, path: Tensor, dominant: Tensor, time: Tensor, softness: float | Tensor
) -> tuple[Tensor, Tensor]:
    """A pixel's weighted colour at one moment, and the weight."""
    guess = sample(known, px - dominant * time, mode="nearest")[:, 1:]  # the path of what comes by is seldom quite that
    guess = torch.where((guess - path).detach().square().sum(1, keepdim=True) < ALIKE**2, path, guess)
    a_color, a_depth, a_lands, a_behind = _candidate(color, known, px, guess, time, softness)
    b_color, b_depth, b_lands, b_behind = _candidate(color, known, px, path, time, softness)
    a_front = _in_front(a_depth, b_depth, softness)
    # Where nothing lands at this moment, a surface behind the pixel's own shows; one in front of it does not count.
    bare = (1 - a_lands) * (1 - b_lands) / (a_behind + b_behind).clamp_min(1.0)
    a = a_lands * (1 - b_lands * (1 - a_front)) + bare * a_behind
    b = b_lands * (1 - a_lands * a_front) + bare * b_behind
    return a * a_color + b * b_color, a + b


def _candidate(
    color: Tensor, known: Tensor, px: Tensor, path: Tensor, time: Tensor, softness: float | Tensor
) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """The point that ``path`` brings here at ``time``: colour, depth, whether its own path does so, and whether it
    lies behind what is here now."""
    at = px - path * time
    found = sample(known, at, mode="nearest")
    miss = length((found[:, 1:] - path) * time)
    lands = (2 - miss / (LANDING_TOLERANCE + LANDING_RELATIVE * length(path * time))).clamp(0, 1)
    behind = 2 * (_in_front(known[:, :1], found[:, :1], softness) - 0.5).clamp_min(0)
    return sample(color, at), found[:, :1], lands, behind


def _in_front(near: Tensor, far: Tensor, softness: float | Tensor) -> Tensor:
    """1 where ``near`` is nearer than ``far``, 0 where it is farther, a half where they are equal."""
    scale = 2 * softness * torch.minimum(near, far).abs().clamp_min(1e-12)
    return (0.5 + (far - near) / scale).clamp(0, 1)
