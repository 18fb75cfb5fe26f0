"""Light that arrives from one source, its shadow sampled where there is one.

A source knows in closed form what it would send with nothing between; only the share that comes through is sampled.
Vectors are planes, ``(3, N)``, over the pixels of one picture.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt.noise import PLASTIC
from tracer.form_factor import cross, disc_cosine, dot, rectangle_irradiance
from tracer.scene import Sun

CHUNK = 1 << 13  # pixels at a time: bounds memory, and keeps planes in the cache
REACH = 2  # pixels around, in which samples must agree too before a pixel needs no more
AGREE = 0.02  # samples agree whose transmission differs by no more than this
SHORT = 1e-3  # world units that a ray to a lamp ends before its face


@dataclass(frozen=True, eq=False, kw_only=True)
class Surface:
    """What one picture shows, flat: ``points`` and ``normals`` ``(3, N)`` world space, ``lit`` ``(N,)`` bool (whether a
    pixel can show direct light at all), and ``size`` ``(H, W)`` with H W = N."""

    points: Tensor
    normals: Tensor
    lit: Tensor
    size: tuple[int, int]


Draw = Callable[[Tensor], tuple[Tensor, Tensor, Tensor]]
"""Two numbers in [0, 1) a pixel, ``(2, n)``, to directions ``(3, n)``, distances ``(n,)`` and weights ``(n,)``."""
Source = Callable[[Tensor], tuple[Tensor, Tensor, Draw]]
"""Pixel numbers ``(n,)`` to which of them the source can reach, ``(n,)`` bool, and for these: the unblocked irradiance
``(m,)``, and how to sample it."""
Rectangles = Callable[[Tensor], Sequence[Tensor]]
"""Pixel numbers to corner, edge_u and edge_v of what shines on them, as `rectangle_irradiance` takes them."""
Through = Callable[[Tensor, Tensor, Tensor], Tensor]
"""Pixel numbers, directions ``(3, n)`` and distances ``(n,)`` to how much light comes through, ``(3, n)``."""


def arriving(
    source: Source, through: Through, wanted: Tensor, refine: Tensor, noise: Tensor, *, samples: int, start: int
) -> Tensor:
    """Irradiance from a source of unit radiance (the sun: of unit irradiance) through what stands between.

    A quarter of the samples comes first. Where these agree with each other and with those of the pixels around, as they
    do away from the edges of shadows, they are enough; elsewhere all are taken. That leaves out less than half a per
    cent of a source's light at the faint outer rim of its penumbra. What comes through is the weighted mean over
    the samples, so that light without shadow is exact.

    Args:
        source: see `Source`.
        through: see `Through`.
        wanted: ``(H, W)`` bool: where the source matters.
        refine: ``(H, W)`` bool: where it matters enough for more than the first samples.
        noise: ``(2, H, W)`` in [0, 1): how each pixel's sample points are rotated.
        samples: at most so many rays a pixel.
        start: number of the first point of the R2 sequence.

    Returns:
        ``(3, H, W)``.

    Source: Roberts 2018 (R2); Heitz et al. 2018 (ratio of shadowed to analytic light).
    """
    arrived = noise.new_zeros(3, *wanted.shape)
    if not bool(wanted.any()):
        return arrived
    crop = _crop(wanted)
    wanted, refine, flat = wanted[crop], refine[crop], noise[:, *crop].flatten(1)
    numbers = torch.arange(arrived[0].numel(), device=flat.device).view(arrived.shape[1:])[crop].flatten()
    irradiance, weight = flat.new_zeros(len(numbers)), flat.new_zeros(len(numbers))
    passed, low, high = flat.new_zeros(3, len(numbers)), flat.new_ones(len(numbers)), flat.new_zeros(len(numbers))

    def shoot(where: Tensor, points: range) -> None:
        for part in where.flatten().nonzero()[:, 0].split(CHUNK):
            reached, energy, draw = source(numbers[part])
            part = part[reached]
            irradiance[part] = energy
            for point in points:
                turn = flat.new_tensor([[point / PLASTIC % 1], [point / PLASTIC**2 % 1]])
                directions, distances, weights = draw((flat[:, part] + turn) % 1.0)
                seen = through(numbers[part], directions, distances)
                passed[:, part] += seen * weights
                weight[part] += weights
                shade = seen.mean(dim=0)
                low[part] = torch.minimum(low[part], torch.where(weights > 0, shade, 1.0))
                high[part] = torch.maximum(high[part], torch.where(weights > 0, shade, 0.0))

    first = max(1, samples // 4)
    shoot(wanted, range(start, start + first))
    if samples > first:
        spread = _widest(high.view(wanted.shape)) + _widest(-low.view(wanted.shape))
        shoot(wanted & refine & (spread > AGREE), range(start + first, start + samples))
    arrived[:, *crop] = (passed * (irradiance / weight.clamp_min(1e-20))).view(3, *wanted.shape)
    return arrived


def sun_source(sun: Sun, surface: Surface) -> Source:
    """The sun's disc; its unblocked irradiance is what lies above the surface's horizon."""
    sine = math.sin(math.radians(sun.angular_radius))
    toward = F.normalize(torch.tensor(sun.direction, dtype=surface.points.dtype), dim=0)
    helper = torch.tensor([1.0, 0.0, 0.0] if abs(float(toward[0])) < 0.6 else [0.0, 1.0, 0.0])
    across = F.normalize(cross(helper.to(toward), toward), dim=0)
    basis = torch.stack([across, cross(toward, across), toward], dim=1).to(surface.points.device)

    def source(pixels: Tensor) -> tuple[Tensor, Tensor, Draw]:
        energy = disc_cosine(dot(surface.normals[:, pixels], basis[:, 2]), sine)
        reached = energy > 0
        normals = surface.normals[:, pixels[reached]]

        def draw(u: Tensor) -> tuple[Tensor, Tensor, Tensor]:
            x, y = _disc(u) * sine
            directions = basis @ torch.stack([x, y, (1 - x * x - y * y).sqrt()])
            weights = dot(normals, directions).clamp_min(0)
            return directions, torch.full_like(weights, torch.inf), weights

        return reached, energy[reached], draw

    return source


def lamp_source(surface: Surface, rectangles: Rectangles) -> Source:
    """One lamp, or one a pixel: its rectangles are chosen by their unblocked irradiance, and points on each evenly."""

    def source(pixels: Tensor) -> tuple[Tensor, Tensor, Draw]:
        each = rectangle_irradiance(surface.points[:, pixels], surface.normals[:, pixels], *rectangles(pixels))
        reached = each.sum(dim=0) > 0
        pixels, each = pixels[reached], each[:, reached]
        points, normals = surface.points[:, pixels], surface.normals[:, pixels]
        table = [t.expand(3, *each.shape) for t in rectangles(pixels)]
        upto = each.cumsum(dim=0)
        energy = upto[-1]

        def draw(u: Tensor) -> tuple[Tensor, Tensor, Tensor]:
            place = u[0] * energy
            which = (place >= upto).sum(dim=0).clamp_max(len(each) - 1)[None]
            mine = each.gather(0, which)[0].clamp_min(1e-20)
            first = ((place - upto.gather(0, which)[0]) / mine + 1).clamp(0, 1)
            corner, edge_u, edge_v = (t.gather(1, which[None].expand(3, -1, -1))[:, 0] for t in table)
            way = corner + edge_u * first + edge_v * u[1] - points
            square = dot(way, way).clamp_min(1e-12)
            distance = square.sqrt()
            directions = way / distance
            here = dot(normals, directions).clamp_min(0)
            there = -dot(cross(edge_u, edge_v), directions).clamp_max(0)  # times the rectangle's area
            return directions, (distance - SHORT).clamp_min(0), here * there / (square * mine)

        return reached, energy, draw

    return source


def _crop(mask: Tensor) -> tuple[slice, slice]:
    """Rows and columns around all that is set."""
    rows, columns = mask.any(dim=1).nonzero()[:, 0], mask.any(dim=0).nonzero()[:, 0]
    return slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)


def _widest(plane: Tensor) -> Tensor:
    """The greatest value in the square of `REACH` pixels around."""
    side = 2 * REACH + 1
    rows = F.max_pool2d(plane[None, None], (side, 1), stride=1, padding=(REACH, 0))
    return F.max_pool2d(rows, (1, side), stride=1, padding=(0, REACH))[0, 0]


def _disc(u: Tensor) -> Tensor:
    """The unit square ``(2, n)`` onto the unit disc, evenly and without tearing (Shirley and Chiu 1997)."""
    a, b = 2 * u[0] - 1, 2 * u[1] - 1
    wide = a.abs() > b.abs()
    radius = torch.where(wide, a, b)
    ratio = torch.where(wide, b, a) / torch.where(radius == 0, 1.0, radius)
    angle = torch.where(wide, math.pi / 4 * ratio, math.pi / 2 - math.pi / 4 * ratio)
    return torch.stack([radius * angle.cos(), radius * angle.sin()])
