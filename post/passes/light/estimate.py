"""Stand-ins for G-buffer channels that a source does not have. They are guesses, and are marked as such."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import torch
from torch import Tensor

from gbufrt import Camera, Frame, Pass
from gbufrt.channels import check_one_kind, check_picture
from gbufrt.compute.resident import resident
from gbufrt.demands.pictures import check_camera, check_pictures
from gbufrt.directions import length
from gbufrt.luminance import luminance
from gbufrt.names import several
from gbufrt.numeric import check_between, check_counts
from gbufrt.sampling import inside, pixel_centers, sample, shifted
from post.sweep.chords import thickness_from_depth

TINY = 1e-12
DISTANCE_COST = 1e-3  # relative depth difference that one pixel of distance outweighs in the motion search
ESTIMATES = ("motion", "motion_z", "roughness", "metallic", "thickness")


def normals_from_depth(
    depth: Tensor,
    camera: Camera,
    *,
    hit: Tensor | None = None,
    method: Literal["edge_aware", "plain"] = "edge_aware",
) -> Tensor:
    """Normals guessed from depth.

    ``edge_aware`` takes the slope, along each axis, from the side that continues straight on: at an edge
    or a silhouette between two planes, each pixel follows its own. ``plain`` differentiates across them.

    Args:
        depth: ``(B, 1, H, W)`` planar view z, world units; at least 2x2.
        camera: where the picture was taken.
        hit: ``(B, 1, H, W)`` bool; False marks the sky, whose normal is zero.
        method: which.

    Returns:
        ``(B, 3, H, W)`` world space, unit length, facing the camera.

    Raises:
        ValueError: unknown method, or the picture is smaller than 2x2.

    Source: after Wu 2020 ("accurate normal reconstruction", the side with the smaller second difference).
    """
    if method not in ("edge_aware", "plain"):
        raise ValueError(f"method must be 'edge_aware' or 'plain', got {method!r}")
    check_pictures(camera, depth=depth, hit=hit)
    if method == "plain" or min(depth.shape[-2:]) < 2:
        normal = camera.normals_from_depth(depth)
    else:
        points = camera.unproject(depth)
        # Planes are straight in 1/z under perspective and in z under parallel projection.
        straight = depth if camera.orthographic else 1 / depth.clamp_min(TINY)
        away = torch.linalg.cross(_slope(points, straight, 1, 0), _slope(points, straight, 0, 1), dim=1)
        away = away / length(away).clamp_min(TINY)
        facing = torch.where((away * camera.to_eye(points)).sum(1, keepdim=True) < 0, -away, away)
        normal = camera.rotate_to_world(facing)
    return normal if hit is None else torch.where(hit, normal, 0.0)


def _slope(points: Tensor, straight: Tensor, dx: int, dy: int) -> Tensor:
    """Difference of points to one neighbour along an axis, on the side with the smaller second difference."""
    bend = []
    for side in (-1, 1):
        one, two = shifted(straight, side * dx, side * dy), shifted(straight, 2 * side * dx, 2 * side * dy)
        place = pixel_centers(straight)
        step = resident((side * dx, side * dy), place)[None, :, None, None]
        reach, further = (inside(place + count * step, _size(straight)) for count in (1, 2))
        second = torch.where(further, (straight - 2 * one + two).abs(), (straight - one).abs())
        bend.append(torch.where(reach, second, torch.inf))
    before, after = points - shifted(points, -dx, -dy), shifted(points, dx, dy) - points
    return torch.where(bend[0] < bend[1], before, after)


def motion_from_depth(
    depth: Tensor,
    camera: Camera,
    previous_depth: Tensor,
    previous_camera: Camera,
    *,
    hit: Tensor | None = None,
    radius: int = 2,
) -> tuple[Tensor, Tensor]:
    """Motion guessed by searching the previous frame for each pixel's depth, around its static back-projection.

    Args:
        depth: ``(B, 1, H, W)`` planar view z, world units.
        camera: where the picture was taken.
        previous_depth: as ``depth``, of the frame before.
        previous_camera: where that was taken.
        hit: ``(B, 1, H, W)`` bool; False marks the sky, which is not searched for.
        radius: how far to search, pixels to each side; 0 assumes a static world.

    Returns:
        ``motion`` ``(B, 2, H, W)``, previous minus current pixels, and ``motion_z`` ``(B, 1, H, W)``.

    Raises:
        ValueError: ``radius`` is negative.

    Source: the depth search of ME1 Path Tracing, started from camera reprojection.
    """
    check_counts(radius=radius)
    check_pictures(camera, depth=depth, hit=hit)
    check_camera(previous_camera, "previous_camera")
    check_pictures(previous_camera, previous_depth=previous_depth)
    check_one_kind(depth=depth, previous_depth=previous_depth)
    check_between(0, math.inf, radius=radius)
    hit = torch.ones_like(depth, dtype=torch.bool) if hit is None else hit
    still, still_z = camera.static_motion(previous_camera, depth, hit)
    expected, start = depth + still_z, camera.pixel_centers(dtype=depth.dtype) + still
    start = start if previous_camera.jitter is None else start - previous_camera.jitter[:, :, None, None]
    best = torch.full_like(depth, torch.inf)
    offset, found = torch.zeros_like(still), expected
    steps = range(-radius, radius + 1)
    for dx, dy in sorted(((x, y) for x in steps for y in steps), key=lambda s: s[0] ** 2 + s[1] ** 2):
        step = still.new_tensor([float(dx), float(dy)])[None, :, None, None]
        there = sample(previous_depth, start + step, mode="nearest")
        cost = (there - expected).abs() / expected.clamp_min(TINY) + DISTANCE_COST * float(dx * dx + dy * dy) ** 0.5
        better = hit & (cost < best) & inside(start + step, _size(depth))
        best = torch.where(better, cost, best)
        offset, found = torch.where(better, step, offset), torch.where(better, there, found)
    motion_z = torch.where(hit, (still_z if radius == 0 else found - depth), 0.0)
    return still + offset, motion_z


def roughness_from_color(color: Tensor, *, scale: float = 4.0) -> Tensor:
    """Roughness guessed from fine detail: the mean difference of luminance to the eight neighbours.

    Args:
        color: ``(B, 3, H, W)`` linear radiance or albedo.
        scale: how much roughness a relative difference makes.

    Returns:
        ``(B, 1, H, W)`` perceptual, in [0, 1].

    Raises:
        TypeError: ``color`` is no tensor of float32 or float64.
        ValueError: ``color`` is not ``(B, 3, H, W)``, or ``scale`` is negative.

    Source: ME1 Path Tracing, taken relative to the local brightness so that exposure does not matter.
    """
    check_picture("color", color, "linear radiance or albedo")
    check_between(0, math.inf, scale=scale)
    level = luminance(color, 3)
    around = [shifted(level, dx, dy) for dy in (-1, 0, 1) for dx in (-1, 0, 1) if dx or dy]
    difference = torch.stack([(one - level).abs() for one in around]).mean(0)
    mean = (torch.stack(around).sum(0) + level) / 9
    return (scale * difference / mean.clamp_min(1e-4)).clamp(0, 1)


def metallic_from_color(color: Tensor, *, dark: float = 0.2, bright: float = 0.8) -> Tensor:
    """Metalness guessed from saturation, for colours that are not too dark.

    Args:
        color: ``(B, 3, H, W)`` linear albedo, or radiance where there is none.
        dark: brightness below which nothing counts as metal.
        bright: brightness from which saturation alone decides.

    Returns:
        ``(B, 1, H, W)`` in [0, 1].

    Raises:
        ValueError: ``dark`` is negative, or not less than ``bright``.

    Source: ME1 Path Tracing.
    """
    check_picture("color", color, "linear albedo or radiance")
    check_between(0, math.inf, dark=dark, bright=bright)
    if dark >= bright:
        raise ValueError(f"dark must be less than bright, got {dark} and {bright}")
    most, least = color.amax(1, keepdim=True), color.amin(1, keepdim=True)
    t = ((color.mean(1, keepdim=True) - dark) / (bright - dark)).clamp(0, 1)
    return ((most - least) / most.clamp_min(1e-4) * t * t * (3 - 2 * t)).clamp(0, 1)


class EstimateMissing(Pass):
    """Fill motion, roughness, metalness and thickness where the G-buffer lacks them; channels that are there stay.

    For every channel filled, the frame's extra signals get ``<channel>_estimated``, ``(B, 1, H, W)`` of ones. See
    `motion_from_depth`, `roughness_from_color`, `metallic_from_color` and `thickness_from_depth`. Every G-buffer has
    normals: where they are unknown, `normals_from_depth` guesses them before one is built.

    Args:
        search_radius: of the search for motion by depth, pixels.
        roughness_scale: factor from the spread of colour to roughness.
        channels: those to fill; ``EstimateMissing(channels=("thickness",))`` leaves all others alone.

    Raises:
        ValueError: there is no such channel to estimate.
    """

    reads = frozenset({"depth", "hit", "normal"})
    optional = frozenset({"radiance", "albedo", "object_id"})
    writes = frozenset(ESTIMATES) | frozenset(f"{name}_estimated" for name in ESTIMATES)

    def __init__(
        self, *, search_radius: int = 2, roughness_scale: float = 4.0, channels: str | Sequence[str] = ESTIMATES
    ) -> None:
        super().__init__()
        self.channels = several("channels", channels, ESTIMATES)
        if unknown := [name for name in self.channels if name not in ESTIMATES]:
            raise ValueError(f"channels must be some of {', '.join(ESTIMATES)}, got {', '.join(map(repr, unknown))}")
        self.search_radius, self.roughness_scale = search_radius, roughness_scale
        self.writes = frozenset(self.channels) | frozenset(f"{name}_estimated" for name in self.channels)

    def forward(self, frame: Frame) -> Frame:
        missing = frozenset(name for name in self.channels if getattr(frame.gbuffer, name) is None)
        guesses = {**self._motion(frame, missing), **self._material(frame, missing), **self._solid(frame, missing)}
        guesses = {name: guess for name, guess in guesses.items() if name in missing}
        frame = frame.replace(gbuffer=frame.gbuffer.replace(**guesses))
        for name in guesses:
            frame = frame.write(f"{name}_estimated", torch.ones_like(frame.gbuffer.depth))
        return frame

    def _motion(self, frame: Frame, missing: frozenset[str]) -> dict[str, Tensor]:
        g, previous = frame.gbuffer, None if frame.previous is None else frame.previous.gbuffer
        camera = g.previous_camera or (previous.camera if previous is not None else None)
        if camera is None or g.motion is not None or not missing & {"motion", "motion_z"}:
            return {}
        before = g.depth if previous is None else previous.depth
        radius = 0 if previous is None else self.search_radius
        motion, motion_z = motion_from_depth(g.depth, g.camera, before, camera, hit=g.hit, radius=radius)
        return {"motion": motion, "motion_z": motion_z}

    def _material(self, frame: Frame, missing: frozenset[str]) -> dict[str, Tensor]:
        g = frame.gbuffer
        color = g.albedo if g.albedo is not None else frame.radiance
        if color is None or not missing & {"roughness", "metallic"}:
            return {}
        rough = torch.where(g.hit, roughness_from_color(color, scale=self.roughness_scale), 1.0)
        return {"roughness": rough, "metallic": torch.where(g.hit, metallic_from_color(color), 0.0)}

    def _solid(self, frame: Frame, missing: frozenset[str]) -> dict[str, Tensor]:
        if "thickness" not in missing:
            return {}
        g = frame.gbuffer
        return {"thickness": thickness_from_depth(g.depth, g.normal, g.camera, hit=g.hit, object_id=g.object_id)}


def _size(image: Tensor) -> tuple[int, int]:
    return (image.shape[-2], image.shape[-1])
