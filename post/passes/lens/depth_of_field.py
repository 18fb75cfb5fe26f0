"""Depth of field: what a thin lens would show, rebuilt from a pinhole's picture and depth."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from gbufrt import Camera, Frame, History, TemporalPass
from gbufrt.compute.resident import waits
from gbufrt.demands.pictures import check_beside, check_camera
from gbufrt.mending import finite
from gbufrt.numeric import check_numbers
from post.lens.constants import TINY
from post.lens.limits import tell_cut
from post.lens.op import layer_radii, spread_layers
from post.lens.thin_lens import autofocus, circle_of_confusion


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
    on highlights. The run time grows with the radii; as torch code it grows with the number of layers alone.

    Args:
        color: ``(B, C, H, W)`` linear.
        depth: ``(B, 1, H, W)`` planar view z, world units.
        camera: where the picture was taken.
        hit: ``(B, 1, H, W)`` bool; False marks the sky, which is infinitely far.
        focus_distance: planar depth that is sharp, world units; a float, ``(B,)``, or None for `autofocus`.
        aperture_radius: of the lens, world units: its focal length over twice its f-number; a float or ``(B,)``.
        max_radius_px: the largest blur radius, pixels; a warning tells where many would be larger.
        layer_step: relative step between the blur radii of neighbouring layers; smaller is smoother and slower.

    Returns:
        ``(B, C, H, W)``.

    Raises:
        ValueError: shapes disagree or a number is out of range.

    Source: after the layered compositing of Kraus and Strengert 2007, with exact discs and coverage that adds
    up rather than multiplies; see `circle_of_confusion` for the lens.
    """
    check_camera(camera)
    check_beside(color, depth=depth)
    _check(max_radius_px, layer_step)
    color, depth = finite(color), finite(depth, nan=camera.far)  # discs would spread one bad pixel
    if focus_distance is None:
        focus_distance = autofocus(depth, camera, hit=hit)
    coc = circle_of_confusion(depth, camera, focus_distance=focus_distance, aperture_radius=aperture_radius, hit=hit)
    tell_cut(coc, max_radius_px, "depth of field", "max_radius_px", max_radius_px)
    coc = coc.clamp(-max_radius_px, max_radius_px).to(color.dtype)
    largest = max_radius_px if waits(coc) else float(coc.detach().abs().max())
    if largest < TINY:
        return color
    return spread_layers(color, coc, layer_radii(largest, layer_step))


def _check(max_radius_px: float, layer_step: float) -> None:
    check_numbers(max_radius_px=max_radius_px, layer_step=layer_step)
    if not 1 <= max_radius_px < math.inf:
        raise ValueError(f"max_radius_px must be finite and at least 1, got {max_radius_px}")
    if not 0 < layer_step <= 1:
        raise ValueError(f"layer_step must lie in (0, 1], got {layer_step}")


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
        check_numbers(focus_speed=focus_speed)
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
