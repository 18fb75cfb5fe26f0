"""Irradiance from one source, its shadow sampled where there is one.

The unoccluded irradiance is known in closed form; only the transmitted share is sampled.
Vectors are planes, ``(3, N)``, over the pixels of one picture.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import torch
import torch.nn.functional as F
from torch import Tensor

REACH = 2  # pixels around a pixel whose samples must agree too before it needs no more
NEXT = 1  # pixels around one where they must agree for it to need no more than a quarter of all
AGREE = 0.02  # samples agree if their transmission differs by no more than this
SHORT = 1e-3  # world units before a lamp's face at which a shadow ray ends

ShadowRays = Callable[[Tensor, Tensor, range], Tensor]
"""Maps pixel numbers ``(n,)``, a rotation of each pixel's samples ``(2, n)`` in [0, 1), and a range of points of the R2
sequence to ``(7, n)`` with the rows below."""
UNBLOCKED, PASSED, WEIGHT, LEAST, MOST = 0, slice(1, 4), 4, 5, 6
"""Unoccluded irradiance (0 where the source cannot reach the pixel); over the samples, the sums of transmission times
weight and of the weights, and the least and greatest transmission, 1 and 0 for no samples."""


FIRST, QUARTER, ALL = 1, 2, 3
"""How much a source matters to a pixel: enough for the first of its samples, for a quarter, for all; 0 for less."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Surface:
    """The surfaces of one picture, flat.

    Args:
        points: ``(3, N)`` world space.
        normals: ``(3, N)`` world space, unit length.
        lit: ``(N,)`` bool, whether a pixel can receive direct light at all.
        size: ``(H, W)`` with H W = N.
        seen: ``(N,)`` in [0, 1], how much of a pixel's light reaches the camera; by default all. Where it is little,
            so are the samples.
        besides: ``(N,)`` irradiance that lamps are weighed against, as they are against the sun's; by default 0.
    """

    points: Tensor
    normals: Tensor
    lit: Tensor
    size: tuple[int, int]
    seen: Tensor | None = None
    besides: Tensor | None = None

    @cached_property
    def share(self) -> Tensor:
        """``(N,)`` what ``seen`` says, 0 where a pixel is not lit."""
        share = self.lit.to(self.points.dtype)
        return share if self.seen is None else share * self.seen


def arriving(
    shadow_rays: ShadowRays, level: Tensor, noise: Tensor, *, seen: Tensor, samples: int, start: int
) -> Tensor:
    """Irradiance from a source of unit radiance (the sun: of unit irradiance), with shadows.

    A sixteenth of the samples comes first. Away from the edges of shadows these agree with each other and with those of
    the pixels around, as far as the difference is seen, and are enough. Elsewhere a quarter is taken and, where these
    too or the pixels next to this one differ, all. So it is where the first were not sent, because they chose a place
    of the source that the surface does not see: their weight is 0, and without others the pixel would stay dark. That
    omits about one per cent of a source's light in its penumbra, at the faint outer rim. Transmission is the weighted
    mean over the samples, so that light without shadow is exact.

    Args:
        shadow_rays: samples of the source; see `ShadowRays`.
        level: ``(H, W)`` uint8: how much the source matters; see `FIRST`.
        noise: ``(2, H, W)`` in [0, 1): how each pixel's sample points are rotated.
        seen: ``(H, W)`` in [0, 1], how much of a pixel's light reaches the camera.
        samples: at most so many rays a pixel.
        start: number of the first point of the R2 sequence.

    Returns:
        ``(3, H, W)``.

    Source: Roberts 2018 (R2); Heitz et al. 2018 (ratio of shadowed to analytic light).
    """
    arrived, wanted = noise.new_zeros(3, *level.shape), level > 0
    if not bool(wanted.any()):
        return arrived
    crop = _crop(wanted)
    level, seen, flat = level[crop], seen[crop], noise[:, *crop].flatten(1)
    numbers = torch.arange(arrived[0].numel(), device=flat.device).view(arrived.shape[1:])[crop].flatten()
    sums = flat.new_zeros(MOST + 1, len(numbers))
    sums[LEAST] = 1.0

    def send(where: Tensor, begin: int, end: int) -> None:
        part = where.flatten().nonzero()[:, 0]
        found = shadow_rays(numbers[part], flat[:, part], range(start + begin, start + end))
        sums[UNBLOCKED, part] = found[UNBLOCKED]
        sums[PASSED, part] += found[PASSED]
        sums[WEIGHT, part] += found[WEIGHT]
        sums[LEAST, part] = sums[LEAST, part].minimum(found[LEAST])
        sums[MOST, part] = sums[MOST, part].maximum(found[MOST])

    def differ(reach: int) -> Tensor:
        least, most = (sums[row].view(level.shape) for row in (LEAST, MOST))
        unsent = (sums[WEIGHT] <= 0) & (sums[UNBLOCKED] > 0)
        return ((_widest(most, reach) + _widest(-least, reach)) * seen > AGREE) | unsent.view(level.shape)

    first, second = stages(samples)
    send(level >= FIRST, 0, first)
    if samples > first:
        around, beside = (level >= QUARTER) & differ(REACH), differ(NEXT)
        send(around, first, second)
        send(around & (level >= ALL) & (beside | differ(0)), second, samples)
    through = sums[PASSED] / sums[WEIGHT].clamp_min(1e-20)
    arrived[:, *crop] = (through * sums[UNBLOCKED]).view(3, *level.shape)
    return arrived


def stages(samples: int) -> tuple[int, int]:
    """How many rays to a source come first, and how many before those that are sent only where rays still differ."""
    return max(1, samples // 16), max(min(4, samples), samples // 4)


def _crop(mask: Tensor) -> tuple[slice, slice]:
    """Rows and columns of the bounding box of all that is set."""
    rows, columns = mask.any(dim=1).nonzero()[:, 0], mask.any(dim=0).nonzero()[:, 0]
    return slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)


def _widest(plane: Tensor, reach: int) -> Tensor:
    """The greatest value within ``reach`` pixels along both axes."""
    side = 2 * reach + 1
    rows = F.max_pool2d(plane[None, None], (side, 1), stride=1, padding=(reach, 0))
    return F.max_pool2d(rows, (1, side), stride=1, padding=(0, reach))[0, 0]
