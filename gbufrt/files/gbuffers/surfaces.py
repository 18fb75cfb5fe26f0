"""Which pixels of a file's depth show a surface, and which the sky."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from gbufrt.files.gbuffers.convert import FARTHEST, distances
from gbufrt.files.gbuffers.profile import Profile
from gbufrt.files.precision import MOST_HALF

SHARES = ("device", "normalised")  # kinds of depth from near to far
SKY_SHARE = 0.99  # of the sky's depth, from which a pixel counts as sky
ALIKE = 0.001  # share of the pixels that hold the largest depth exactly, where it is the sky's
BEYOND = 1000.0  # how many times farther than surfaces such a sky is at least
MANY = 0.02  # share of the surfaces' pixels that may not be lost to the sky of halves
MOST_NOISE = 1e-6  # of the largest depths: negative ones below it are what lossy compression leaves of 0
NOISE = 4.0  # how many times larger than the negative ones positive leavings may be
ENOUGH = 1 << 20  # pixels that quantiles are taken of


def hit_of(raw: Tensor, profile: Profile) -> Tensor:
    """``(B, 1, H, W)`` where depth is a surface's: positive, nearer than `FARTHEST`, and not the sky's."""
    near_enough = distances(raw, profile) < FARTHEST  # not so of NaN
    raw = raw * profile.depth_scale
    sky = _sky_of(raw, profile)
    hit = near_enough & (raw > _leavings(raw)) & (raw < sky * SKY_SHARE if abs(profile.sky) > 1 else raw != sky)
    if profile.depth_kind in SHARES and not profile.reversed:
        hit = hit & (raw < 1)
    return hit


def _sky_of(raw: Tensor, profile: Profile) -> float:
    """From which depth on, scaled as the profile says, a pixel shows the sky: the profile's, if the pixels allow it.

    A largest depth that many pixels share and that is far beyond all others is a sky that the profile does not know.
    The largest half, as the sky of a profile, is that of halves: no sky where float depths of many surfaces are larger.
    """
    sky = profile.sky * profile.depth_scale
    sky = math.inf if sky <= 0 else sky
    there = raw[(raw > 0) & (raw < FARTHEST)]
    if profile.depth_kind in (*SHARES, "reciprocal") or not there.numel():
        return sky
    last = float(there.max())
    others = there[there < last]
    if not others.numel():
        return sky
    shared = there.numel() - others.numel() > ALIKE * raw.numel()
    middle, most = (_quantile(others, share) for share in (0.5, 1 - MANY))
    if profile.sky == MOST_HALF:
        lost = (others >= sky * SKY_SHARE) & (others < BEYOND * middle)
        if int(lost.sum()) > MANY * others.numel():
            sky = math.inf if not shared else last
    return min(sky, math.sqrt(most * last)) if shared and last > BEYOND * most else sky


def _leavings(raw: Tensor) -> float:
    """Up to which depth a pixel is empty: 0, but for what lossy compression makes of it, which is negative as often."""
    below = -float(torch.where(raw.isfinite(), raw, 0.0).min()) if raw.numel() else 0.0
    there = raw[(raw > 0) & raw.isfinite()]
    return NOISE * below if there.numel() and 0 < below < MOST_NOISE * float(there.max()) else 0.0


def _quantile(values: Tensor, share: float) -> float:
    some = values[:: values.numel() // ENOUGH + 1]
    return float(some.kthvalue(max(1, round(share * some.numel()))).values)
