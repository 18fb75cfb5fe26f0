"""Depth of field: what a thin lens would show, rebuilt from a pinhole's picture and depth."""

from __future__ import annotations

import math
from collections.abc import Iterator

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt import Camera, Frame, History, TemporalPass
from gbufrt.mending import finite
from post.shading.thin_lens import autofocus, circle_of_confusion

CONFIDENT = 1e-3  # share of known background from which on it fills what a near edge disoccludes
BRIGHT = 1.0  # of the picture's mean level: pixels this bright count half where the background is guessed
FINEST = 0.25  # pixels between the radii of the two sharpest layers
TINY = 1e-6  # coverage below this is rounding


def depth_of_field(
    color: Tensor,
    depth: Tensor,
    camera: Camera,
    *,
    hit: Tensor | None = None,
    focus_distance: float | Tensor | None = None,
    aperture_radius: float | Tensor = 0.05,
    max_radius_px: float = 32.0,
    layer_step: float = 0.12,
) -> Tensor:
    """Blur what lies off the focal plane of a thin lens.

    The picture is cut into layers of like blur; each is spread by its own disc, exactly and without noise, and the
    layers are laid over one another from the nearest to the farthest until a pixel is covered. A spread pixel carries
    its coverage, so that near things become transparent at their edges, sharp things do not bleed into blurred ones
    behind them, and one surface that crosses layers stays whole. Where the pinhole's picture
    has no background to show through a near edge, the mean of what lies behind within reach fills in, with less weight
    on highlights. The run time does not depend on the radii.

    Args:
        color: ``(B, C, H, W)`` linear.
        depth: ``(B, 1, H, W)`` planar view z, world units.
        camera: where the picture was taken.
        hit: ``(B, 1, H, W)`` bool; False marks the sky, which is infinitely far.
        focus_distance: planar depth that is sharp, world units; a float, ``(B,)``, or None for `autofocus`.
        aperture_radius: of the lens, world units; a float or ``(B,)``.
        max_radius_px: the largest blur radius, pixels.
        layer_step: relative step between the blur radii of neighbouring layers; smaller is smoother and slower.

    Returns:
        ``(B, C, H, W)``.

    Raises:
        ValueError: shapes disagree or a number is out of range.

    Source: after the layered compositing of Kraus and Strengert 2007, with discs by Fourier transform and coverage
    that adds up rather than multiplies; see `circle_of_confusion` for the lens.
    """
    _check(color, depth, max_radius_px, layer_step)
    color, depth = finite(color), finite(depth, nan=camera.far)  # Fourier transforms would spread one bad pixel
    if focus_distance is None:
        focus_distance = autofocus(depth, camera, hit=hit)
    coc = circle_of_confusion(depth, camera, focus_distance=focus_distance, aperture_radius=aperture_radius, hit=hit)
    coc = coc.clamp(-max_radius_px, max_radius_px).to(color.dtype)
    largest = float(coc.detach().abs().max())
    if largest < TINY:
        return color
    return _layered(color, coc, _radii(max_radius_px, layer_step), 2 * (math.ceil(largest) + 1))


def _layered(color: Tensor, coc: Tensor, radii: list[float], margin: int) -> Tensor:
    """Lay the spread layers over one another, nearest first."""
    height, width = color.shape[-2:]
    rows, columns = _fast_size(height + 2 * margin), _fast_size(width + 2 * margin)
    border = (margin, columns - width - margin, margin, rows - height - margin)
    source = F.pad(torch.cat([color, torch.ones_like(coc)], dim=1), border, mode="replicate")
    coc = F.pad(coc, border, mode="replicate")
    calm = _calm(source[:, :-1])
    result, free = torch.zeros_like(color), torch.ones_like(color[:, :1])
    fill = torch.zeros_like(source[..., :height, :width])

    def spread(share: Tensor, radius: float) -> Tensor:
        picture = source * share
        if radius:
            disc = _disc_spectrum(abs(radius), source)
            picture = torch.fft.irfft2(torch.fft.rfft2(picture) * disc, s=(rows, columns))
        return picture[..., margin : margin + height, margin : margin + width]

    for radius, share, behind in _layers(coc, radii):
        layer = spread(share, radius)
        coverage = layer[:, -1:].clamp_min(0)
        taken = torch.minimum(coverage, free)
        result = result + layer[:, :-1] * (taken / coverage.clamp_min(TINY))
        free = free - taken
        if behind is not None:
            fill = fill + taken * spread(behind * calm, radius)
    known = fill[:, -1:].clamp_min(0)
    trusted = free * known / (known + CONFIDENT)
    result = result + trusted * fill[:, :-1] / known.clamp_min(TINY)
    return result / (1 - free + trusted).clamp_min(TINY)


def _calm(color: Tensor) -> Tensor:
    """Weights that keep one highlight from conspicuously filling all the unknown background around it."""
    level = color.detach().mean(dim=1, keepdim=True)
    return 1 / (1 + level / (BRIGHT * level.mean(dim=(1, 2, 3), keepdim=True)).clamp_min(TINY))


def _layers(coc: Tensor, radii: list[float]) -> Iterator[tuple[float, Tensor, Tensor | None]]:
    """Signed radii from the nearest layer to the farthest, each with every pixel's share in it.

    A pixel between two radii belongs to both, so shared that the variance of its blur is right, hence the squares.
    Layers in front of the focal plane also come with the share of what lies clearly behind them.
    """
    signed = [-r for r in reversed(radii[1:])] + radii
    square = coc * coc.abs()
    at = [r * abs(r) for r in signed]
    for i, radius in enumerate(signed):
        share = torch.ones_like(coc)
        if i > 0:
            share = torch.minimum(share, (square - at[i - 1]) / (at[i] - at[i - 1]))
        if i + 1 < len(at):
            share = torch.minimum(share, (at[i + 1] - square) / (at[i + 1] - at[i]))
        share = share.clamp_min(0)
        if bool((share > 0).any()):
            behind = (square - at[i + 1]) / (at[i + 2] - at[i + 1]) if radius < 0 and i + 2 < len(at) else None
            yield radius, share, None if behind is None else behind.clamp(0, 1)


def _radii(largest: float, step: float) -> list[float]:
    """Radii from 0 to the largest; the steps start at a quarter of a pixel and grow in proportion."""
    radii = [0.0]
    while radii[-1] < largest:
        radii.append(radii[-1] * (1 + step) + FINEST)
    return radii


def _disc_spectrum(radius: float, like: Tensor) -> Tensor:
    """Transform of a disc that sums to one, centred on the first pixel and wrapped around."""
    rows, columns = like.shape[-2:]
    y = torch.fft.fftfreq(rows, 1 / rows, dtype=like.dtype, device=like.device)
    x = torch.fft.fftfreq(columns, 1 / columns, dtype=like.dtype, device=like.device)
    disc = (radius + 0.5 - torch.hypot(y[:, None], x[None])).clamp(0, 1)
    return torch.fft.rfft2(disc / disc.sum())


def _fast_size(size: int) -> int:
    """The next number without prime factors above 5, for fast Fourier transforms."""
    rest = size
    for factor in (2, 3, 5):
        while rest % factor == 0:
            rest //= factor
    return size if rest == 1 else _fast_size(size + 1)


def _check(color: Tensor, depth: Tensor, max_radius_px: float, layer_step: float) -> None:
    expected = (color.shape[0], 1, *color.shape[2:])
    if tuple(depth.shape) != expected:
        raise ValueError(f"depth must be {expected} like color, got {tuple(depth.shape)}")
    if max_radius_px < 1:
        raise ValueError(f"max_radius_px must be at least 1, got {max_radius_px}")
    if layer_step <= 0:
        raise ValueError(f"layer_step must be positive, got {layer_step}")


class DepthOfField(TemporalPass):
    """See `depth_of_field`. Its state is the focus distance.

    Args:
        focus_distance: world units; None focuses on what is at the middle of the picture, see `autofocus`.
        focus_speed: share of the way to a new focus covered per frame, in 1/distance, so that blur changes evenly.
            The first frame is in focus at once.
        focus_region: the middle's height and width as a share of the picture's.
    """

    reads = frozenset({"color", "depth", "hit"})
    writes = frozenset({"color"})

    def __init__(
        self,
        *,
        focus_distance: float | Tensor | None = None,
        aperture_radius: float | Tensor = 0.05,
        max_radius_px: float = 32.0,
        layer_step: float = 0.12,
        focus_speed: float = 0.15,
        focus_region: float = 0.1,
    ) -> None:
        super().__init__()
        if not 0 < focus_speed <= 1:
            raise ValueError(f"focus_speed must lie in (0, 1], got {focus_speed}")
        self.focus_distance, self.aperture_radius = focus_distance, aperture_radius
        self.max_radius_px, self.layer_step = max_radius_px, layer_step
        self.focus_speed, self.focus_region = focus_speed, focus_region

    def forward(self, frame: Frame, state: History | None = None) -> tuple[Frame, History]:
        g = frame.gbuffer
        focus = self._focus(frame, state)
        color = depth_of_field(
            frame.read("color"), g.depth, g.camera, hit=g.hit, focus_distance=focus,
            aperture_radius=self.aperture_radius, max_radius_px=self.max_radius_px, layer_step=self.layer_step,
        )  # fmt: skip
        value = focus.reshape(-1, 1, 1, 1)
        return frame.replace(color=color), History(length=torch.ones_like(value), signals={"focus_distance": value})

    def _focus(self, frame: Frame, state: History | None) -> Tensor:
        g = frame.gbuffer
        target = autofocus(g.depth, g.camera, hit=g.hit, region=self.focus_region)
        if self.focus_distance is not None:
            target = torch.zeros_like(target) + self.focus_distance
        if state is None:
            return target
        before = state.signals["focus_distance"].flatten()
        eased = 1 / torch.lerp(1 / before, 1 / target, self.focus_speed)
        return torch.where(state.length.flatten() > 0, eased, target)
