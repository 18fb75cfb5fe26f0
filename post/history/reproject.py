"""Reprojection for temporal passes: where this frame's pixels were in the previous frame, and which are valid."""

from __future__ import annotations

from dataclasses import dataclass, replace

import torch
from torch import Tensor

from gbufrt import Camera, GBuffer, History
from gbufrt.sampling import gather
from post.filters.edges import offsets
from post.history.catmull_rom import catmull_rom_taps
from post.history.constants import ANY_WAY, FARTHEST, KEPT, STILL, WHOLE

NORMAL, HIT, OBJECT, POINT, FOOTPRINT = slice(0, 3), slice(3, 4), slice(4, 5), slice(5, 8), slice(8, 9)


@dataclass(frozen=True, eq=False)
class Taps:
    """Pixels of the previous frame for each pixel of this one: K is 4, or 16 for a sharp history.

    Args:
        x: ``(B, K, H, W)`` integer columns.
        y: as ``x``, rows.
        weight: ``(B, K, H, W)`` summing to 1, or to 0 where the previous frame does not show this surface.
        support: ``(B, 1, H, W)`` in [0, 1]: how much of the bilinear footprint showed this surface.
    """

    x: Tensor
    y: Tensor
    weight: Tensor
    support: Tensor
    lent: Tensor
    """``(B, 1, H, W)`` bool: whether all there is lies as deep, but may be of another surface."""

    @property
    def valid(self) -> Tensor:
        """``(B, 1, H, W)`` bool: whether there is any history."""
        return self.weight.sum(dim=1, keepdim=True) > 0

    def fetch(self, image: Tensor) -> Tensor:
        """The previous frame's ``image`` ``(B, C, H, W)`` read at this frame's pixels; zero where not valid."""
        result, taps = torch.zeros_like(image), self.weight.shape[1]
        low, high = torch.full_like(image, torch.inf), torch.full_like(image, -torch.inf)
        for k in range(taps):
            weight = self.weight[:, k : k + 1].to(image.dtype)
            picked = gather(image, self.x[:, k], self.y[:, k])
            result = result + weight * torch.where(weight != 0, picked, torch.zeros_like(picked))
            if taps > 4:  # negative lobes may ring
                low = torch.where(weight != 0, torch.minimum(low, picked), low)
                high = torch.where(weight != 0, torch.maximum(high, picked), high)
        return torch.where(self.valid, torch.minimum(torch.maximum(result, low), high), result) if taps > 4 else result


def find_taps(
    now: Tensor,
    before: Tensor,
    shift: Tensor,
    plane_tolerance: float = 2.0,
    normal_tolerance: float = 0.9,
    search: bool = True,
    sharp: bool = False,
    lenient: bool = False,
) -> Taps:
    """The pixels of the previous frame that show each pixel's surface, by what `correspondence_reference` returns.

    The definition of which pixels count is that of `post.history.op.read_history`.
    """
    y, x = (torch.arange(n, dtype=shift.dtype, device=shift.device) for n in shift.shape[-2:])
    column, row = x + shift[:, 0], y[:, None] + shift[:, 1]
    left, top = torch.floor(column), torch.floor(row)
    fx, fy = (column - left), (row - top)
    xs, ys, weights = [], [], []
    for dx, dy in ((0, 0), (1, 0), (0, 1), (1, 1)):
        x, y = (left + dx).long(), (top + dy).long()
        share = (fx if dx else 1 - fx) * (fy if dy else 1 - fy)
        same = _same_surface(now, before, x, y, plane_tolerance, normal_tolerance)
        xs.append(x)
        ys.append(y)
        weights.append(share * same)
    total = sum(weights, torch.zeros_like(fx))
    kept = total > KEPT
    weight = torch.stack([torch.where(kept, w / total.clamp_min(KEPT), torch.zeros_like(w)) for w in weights], dim=1)
    support = torch.where(kept, total, torch.zeros_like(total))[:, None]
    taps = Taps(torch.stack(xs, dim=1), torch.stack(ys, dim=1), weight, support, torch.zeros_like(kept[:, None]))
    if search:
        taps = _search(taps, ~kept, column, row, now, before, plane_tolerance, normal_tolerance)
    if search and lenient:
        failed = ~taps.valid
        taps = _search(taps, failed[:, 0], column, row, now, before, plane_tolerance, ANY_WAY)
        taps = replace(taps, lent=failed & taps.valid)
    if not sharp:
        return taps
    x, y, weight = catmull_rom_taps(
        taps.x, taps.y, taps.weight, fx, fy, whole=support > WHOLE,
        same=lambda x, y: _same_surface(now, before, x, y, plane_tolerance, normal_tolerance),
    )  # fmt: skip
    return Taps(x, y, weight, support, taps.lent)


def correspondence_reference(
    gbuffer: GBuffer, previous: GBuffer, length: Tensor | None = None, motion: Tensor | None = None
) -> tuple[Tensor, Tensor, Tensor]:
    """What each pixel expects of its surface in the previous frame, what that frame's pixels hold, and where to look.

    Args:
        gbuffer: of this frame.
        previous: of the frame before.
        length: ``(B, 1, H, W)`` history length of the frame before; pixels of length zero match nothing.
        motion: ``(B, 2, H, W)`` pixels, previous minus current, to look elsewhere than where the surface was, as for
            reflections; by default the G-buffer's, and without one that of the cameras.

    Returns:
        ``(B, 9, H, W)``: normal, hit, object and position in the previous view, and the size of a pixel there;
        ``(B, 8, H, W)``: the first eight of these of the previous frame's pixels; ``(B, 2, H, W)`` pixels.

    Raises:
        ValueError: the frames differ in batch or size.
    """
    check_alike(gbuffer, previous)
    moved, moved_z = motion_of(gbuffer, previous.camera)
    by_object = gbuffer.object_id is not None and previous.object_id is not None
    now = _expected(gbuffer, previous.camera, moved, moved_z, by_object)
    shift = torch.nan_to_num(moved if motion is None else motion).clamp(-FARTHEST, FARTHEST)
    whole = shift.detach().round()  # what stands still but for rounding is read from one pixel, not from four
    shift = torch.where((shift.detach() - whole).abs() < STILL, shift + (whole - shift).detach(), shift)
    return now, _actual(previous, length, by_object), shift


def check_alike(gbuffer: GBuffer, previous: GBuffer) -> None:
    """Raise ValueError unless two frames have one batch and size."""
    if (gbuffer.batch, gbuffer.camera.size) != (previous.batch, previous.camera.size):
        raise ValueError(
            f"the history must have the frame's batch {gbuffer.batch} and size {gbuffer.camera.size}, got "
            f"batch {previous.batch} and size {previous.camera.size}; start with state=None after a change"
        )


def motion_of(gbuffer: GBuffer, previous: Camera) -> tuple[Tensor, Tensor]:
    """``motion`` and ``motion_z`` of a G-buffer, from the cameras where it lacks them.

    Args:
        gbuffer: of this frame.
        previous: camera of the frame before.

    Returns:
        ``(B, 2, H, W)`` pixels and ``(B, 1, H, W)`` world units, previous minus current.
    """
    if gbuffer.motion is not None and gbuffer.motion_z is not None:
        return gbuffer.motion, gbuffer.motion_z
    motion, motion_z = gbuffer.camera.static_motion(previous, gbuffer.depth, gbuffer.hit)
    return (
        motion if gbuffer.motion is None else gbuffer.motion,
        motion_z if gbuffer.motion_z is None else gbuffer.motion_z,
    )


def history_for(history: History | None, cut: Tensor | None) -> History | None:
    """The history that a frame may use: batch elements whose camera jumped start anew."""
    return history.reset(cut) if cut is not None and isinstance(history, History) else history


def _expected(g: GBuffer, previous: Camera, motion: Tensor, motion_z: Tensor, by_object: bool) -> Tensor:
    """Expected values of a tap: normal, hit, object, position of the surface in the previous view, and tolerance."""
    px = g.camera.pixel_centers(dtype=g.depth.dtype) + motion
    depth = g.depth + motion_z
    footprint = 1 / previous.pixels_per_unit(depth)
    return torch.cat([*_identity(g, previous, by_object), previous.unproject(depth, px), footprint], dim=1)


def _actual(g: GBuffer, length: Tensor | None, by_object: bool) -> Tensor:
    """Actual values of taps, in the same layout; where there is no history they match nothing."""
    normal, hit, object_id = _identity(g, g.camera, by_object)
    if length is not None:
        hit = torch.where(length > 0, hit, torch.full_like(hit, -1.0))
    return torch.cat([normal, hit, object_id, g.points_view()], dim=1)


def _identity(g: GBuffer, camera: Camera, by_object: bool) -> tuple[Tensor, Tensor, Tensor]:
    dtype = g.depth.dtype
    normal = g.normal if g.normal_geo is None else g.normal_geo
    object_id = g.object_id.to(dtype) if by_object and g.object_id is not None else torch.zeros_like(g.depth)
    return camera.rotate_to_view(normal.to(dtype)), g.hit.to(dtype), object_id


def _same_surface(
    now: Tensor, before: Tensor, x: Tensor, y: Tensor, plane_tolerance: float, normal_tolerance: float
) -> Tensor:
    """``(B, h, w)`` bool: whether pixel (x, y) of the previous frame shows the surface that ``now`` describes."""
    height, width = before.shape[-2:]
    tap = gather(before, x, y)
    inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    same = inside & (tap[:, HIT] == now[:, HIT])[:, 0] & (tap[:, OBJECT] == now[:, OBJECT])[:, 0]
    away = tap[:, POINT] - now[:, POINT]
    distance = away[:, 2] if normal_tolerance <= ANY_WAY else (now[:, NORMAL] * away).sum(1)
    on_plane = distance.abs() <= plane_tolerance * now[:, FOOTPRINT][:, 0]
    alike = (now[:, NORMAL] * tap[:, NORMAL]).sum(1) >= normal_tolerance
    return same & ((on_plane & alike) | (now[:, HIT] == 0)[:, 0])


def _search(
    taps: Taps, failed: Tensor, column: Tensor, row: Tensor, now: Tensor, before: Tensor, plane: float, normal: float
) -> Taps:
    """Give each failed pixel the nearest of the 3x3 pixels that shows its surface. Works only on failed pixels."""
    most = int(failed.flatten(1).sum(1).max())
    if most == 0:
        return taps
    batch, height, width = failed.shape
    picked = failed.flatten(1).to(torch.uint8).topk(most, dim=1).indices  # failures first, then harmless others
    py, px = picked // width, picked % width
    wanted = gather(failed[:, None], px[:, None], py[:, None])[:, 0, 0]
    here = gather(now, px[:, None], py[:, None])
    at_x = column.expand(batch, height, width).flatten(1).gather(1, picked)
    at_y = row.expand(batch, height, width).flatten(1).gather(1, picked)
    near_x, near_y = torch.floor(at_x + 0.5), torch.floor(at_y + 0.5)
    best = torch.full_like(at_x, torch.inf)
    best_x, best_y = near_x.long(), near_y.long()
    for dy, dx in offsets(1):
        x, y = (near_x + dx).long(), (near_y + dy).long()
        same = _same_surface(here, before, x[:, None], y[:, None], plane, normal)[:, 0]
        distance = (near_x + dx - at_x) ** 2 + (near_y + dy - at_y) ** 2
        better = same & (distance < best)
        best = torch.where(better, distance, best)
        best_x, best_y = torch.where(better, x, best_x), torch.where(better, y, best_y)
    found = wanted & torch.isfinite(best)

    def placed(plane_of_first: Tensor, values: Tensor) -> Tensor:
        flat = plane_of_first.flatten(1)
        kept = flat.gather(1, picked)
        return flat.scatter(1, picked, torch.where(found, values.to(flat.dtype), kept)).view(batch, 1, height, width)

    def with_first(stacked: Tensor, values: Tensor) -> Tensor:
        return torch.cat([placed(stacked[:, 0], values), stacked[:, 1:]], dim=1)

    weight = with_first(taps.weight, torch.ones_like(best))
    return Taps(with_first(taps.x, best_x), with_first(taps.y, best_y), weight, taps.support, taps.lent)
