"""Direct light of sun and lamps on one picture: the torch reference of `tracer.direct.kernel`.

Vectors are planes, ``(3, N)``, over the pixels of the picture.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt.noise.noise import PLASTIC
from tracer.direct.choice_reference import CHUNK, choices
from tracer.lights.emitters import Lamps
from tracer.lights.form_factor import cross, disc_cosine, dot, rectangle_irradiance
from tracer.lights.shadows import (
    ALL,
    FIRST,
    LEAST,
    MOST,
    PASSED,
    SHORT,
    UNBLOCKED,
    WEIGHT,
    ShadowRays,
    Surface,
    arriving,
)
from tracer.sampling.sequence import disc
from tracer.scene.scene import Scene, Sun
from tracer.traversal.rays import transmission

Draw = Callable[[Tensor], tuple[Tensor, Tensor, Tensor]]
"""From two numbers in [0, 1) a pixel, ``(2, n)``: directions ``(3, n)``, distances ``(n,)`` and weights ``(n,)``."""
Source = Callable[[Tensor], tuple[Tensor, Draw]]
"""From pixel numbers ``(n,)``: the unblocked irradiance there ``(n,)``, and how to sample it."""
Rectangles = Callable[[Tensor], Sequence[Tensor]]
"""From pixel numbers: corner, edge_u and edge_v of what shines on them, as `rectangle_irradiance` takes them."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Direct:
    """What shines on a picture.

    Args:
        scene: what may occlude.
        poses: ``(I, 4, 4)`` of its instances.
        surface: what the picture shows.
        lamps: of the scene at these poses.
    """

    scene: Scene
    poses: Tensor
    surface: Surface
    lamps: Lamps

    def arriving(self, noise: Tensor, samples: int) -> Tensor:
        """Irradiance from the sun and all lamps.

        Args:
            noise: ``(3, H, W)`` in [0, 1): how each pixel's sample points are rotated, and which lamp it draws.
            samples: most rays a pixel to each source.

        Returns:
            ``(3, H, W)``.
        """
        size, sun = self.surface.size, self.scene.sun
        arrived = torch.zeros_like(self.surface.points).view(3, *size)
        if sun is not None:
            level = ALL * (self._seen > 0).byte()
            coming = arriving(self.sun(sun), level, noise[:2], seen=self._seen, samples=samples, start=0)
            arrived = coming * coming.new_tensor(sun.irradiance)[:, None, None]
        return arrived + self._lamp_light(noise, samples, arrived) if len(self.lamps) else arrived

    def _lamp_light(self, noise: Tensor, samples: int, known: Tensor) -> Tensor:
        """``(3, H, W)`` irradiance from lamps, where ``known`` ``(3, H, W)`` comes from elsewhere."""
        size, radiance = self.surface.size, self.lamps.radiance
        levels, chosen, scale = self.choices(self._known(known), noise[2].flatten(), samples)
        arrived, given = torch.zeros_like(known), {"seen": self._seen}
        for lamp, level in enumerate(levels.view(-1, *size)):
            coming = arriving(self.lamp(lamp), level, noise[:2], samples=samples, start=samples * lamp, **given)
            arrived += coming * radiance[lamp][:, None, None]
        for draw, (lamp, ratio) in enumerate(zip(chosen, scale, strict=True)):
            level, start = FIRST * (ratio > 0).view(size).byte(), samples * len(self.lamps) + draw
            coming = arriving(self.lamp_of_each(lamp), level, noise[:2], samples=1, start=start, **given)
            arrived += coming * (radiance[lamp].T * ratio).view_as(coming)
        return arrived

    def _known(self, arrived: Tensor) -> Tensor:
        """``(N,)`` irradiance that lamps are weighed against, where ``arrived`` ``(3, ...)`` comes from the sun."""
        known, besides = arrived.mean(dim=0).flatten(), self.surface.besides
        return known if besides is None else known + besides

    @property
    def _seen(self) -> Tensor:
        """``(H, W)``, see `Surface.seen`."""
        return self.surface.share.view(self.surface.size)

    def sun(self, sun: Sun) -> ShadowRays:
        """Samples of the sun's disc; its unblocked irradiance is what lies above the surface's horizon."""
        sine, basis = sun_frame(sun)
        basis = basis.to(self.surface.points)

        def source(pixels: Tensor) -> tuple[Tensor, Draw]:
            normals = self.surface.normals[:, pixels]

            def draw(u: Tensor) -> tuple[Tensor, Tensor, Tensor]:
                x, y = disc(u) * sine
                directions = basis @ torch.stack([x, y, (1 - x * x - y * y).sqrt()])
                weights = dot(normals, directions).clamp_min(0)
                return directions, torch.full_like(weights, torch.inf), weights

            return disc_cosine(dot(normals, basis[:, 2]), sine).clamp_min(0), draw

        return self._shadow_rays(source)

    def lamp(self, number: int) -> ShadowRays:
        """Samples of one lamp."""
        count = int((self.lamps.edge_u[number].abs().sum(dim=1) > 0).sum())
        own = [t[:, :count, number, None] for t in _planes(self.lamps)]
        return self._shadow_rays(self._rectangles(lambda _: own))

    def lamp_of_each(self, numbers: Tensor) -> ShadowRays:
        """Samples of one lamp a pixel, ``numbers`` ``(N,)`` int64."""
        tables = _planes(self.lamps)
        return self._shadow_rays(self._rectangles(lambda pixels: [t[:, :, numbers[pixels]] for t in tables]))

    def choices(self, known: Tensor, dice: Tensor, samples: int) -> tuple[Tensor, Tensor, Tensor]:
        """See `tracer.direct.choice_reference.choices`."""
        return choices(self.lamps, self.surface, known, dice, samples)

    def _rectangles(self, rectangles: Rectangles) -> Source:
        """Importance sampling: rectangles by their unblocked irradiance, points on each uniformly."""

        def source(pixels: Tensor) -> tuple[Tensor, Draw]:
            points, normals = self.surface.points[:, pixels], self.surface.normals[:, pixels]
            each = rectangle_irradiance(points, normals, *rectangles(pixels))
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

            return energy, draw

        return source

    def _shadow_rays(self, source: Source) -> ShadowRays:
        def through(pixels: Tensor, directions: Tensor, distances: Tensor) -> Tensor:
            origins = self.surface.points[:, pixels].T
            return transmission(self.scene, origins, directions.T, poses=self.poses, t_max=distances).T

        def shadow_rays(pixels: Tensor, turned: Tensor, points: range) -> Tensor:
            sums = turned.new_zeros(MOST + 1, len(pixels))
            sums[LEAST] = 1.0
            for part in torch.arange(len(pixels), device=turned.device).split(CHUNK):
                energy, _ = source(pixels[part])
                sums[UNBLOCKED, part] = energy
                part = part[energy > 0]
                _, draw = source(pixels[part])
                for point in points:
                    turn = turned.new_tensor([[point / PLASTIC % 1], [point / PLASTIC**2 % 1]])
                    directions, distances, weights = draw((turned[:, part] + turn) % 1.0)
                    visible = through(pixels[part], directions, distances)
                    sums[PASSED, part] += visible * weights
                    sums[WEIGHT, part] += weights
                    shade = visible.mean(dim=0)
                    sums[LEAST, part] = sums[LEAST, part].minimum(torch.where(weights > 0, shade, 1.0))
                    sums[MOST, part] = sums[MOST, part].maximum(torch.where(weights > 0, shade, 0.0))
            return sums

        return shadow_rays


def sun_frame(sun: Sun) -> tuple[float, Tensor]:
    """The sine of the sun's angular radius; and ``(3, 3)``: as columns two axes across the direction to it, and it."""
    toward = F.normalize(torch.tensor(sun.direction, dtype=torch.float32), dim=0)
    helper = torch.tensor([1.0, 0.0, 0.0] if abs(float(toward[0])) < 0.6 else [0.0, 1.0, 0.0])
    across = F.normalize(cross(helper, toward), dim=0)
    return math.sin(math.radians(sun.angular_radius)), torch.stack([across, cross(toward, across), toward], dim=1)


def _planes(lamps: Lamps) -> list[Tensor]:
    """Corner, edge_u and edge_v, ``(3, K, L)``."""
    return [t.permute(2, 1, 0) for t in (lamps.corner, lamps.edge_u, lamps.edge_v)]
