"""Motion blur: what an open shutter would record, rebuilt from one picture and its motion."""

from __future__ import annotations

from typing import Literal

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt import Frame, Pass
from gbufrt.compute.resident import number, waits
from gbufrt.demands.pictures import check_beside
from gbufrt.directions import length
from gbufrt.mending import finite
from gbufrt.noise.noise import blue_noise
from gbufrt.numeric import check_counts, check_each, check_for_each, check_numbers
from post.lens.arc_op import turned
from post.lens.constants import STILL
from post.lens.limits import tell_cut
from post.lens.op import blur_alike, reconstruct

Position = Literal["center", "trailing"]
Weights = Literal["reconstruction", "similarity"]
CELLS = 4  # to each side of a tile: the fastest of few pixels is more often what comes by
LARGEST = 8  # pixels of a cell: the fastest of more hides what comes by, however long paths may be,
RINGS = 32  # but no more cells to each side


def motion_blur(
    color: Tensor,
    depth: Tensor,
    motion: Tensor,
    *,
    shutter: float | Tensor = 0.5,
    position: Position = "center",
    samples: int = 16,
    tile: int = 32,
    weights: Weights = "reconstruction",
    softness: float = 0.02,
    index: int | Tensor = 0,
    seed: int = 0,
) -> Tensor:
    """Blur moving things along their paths while the shutter is open.

    Each sample is a moment of the exposure. At that moment a pixel is covered by a point of its own surface or by one
    that comes by. The path of the fastest thing nearby, of the cells around from which something reaches here (their
    borders jittered), leads to where that may be now, and the motion found there to which point of it comes by: parts
    of a spinning body all move unlike. A candidate counts if its own motion really brings it here, and the nearer one
    occludes the other. Paths are straight, tangents of the arcs on which spinning bodies move. What is disoccluded is
    filled with the surface behind. Beyond the picture its border goes on.

    Args:
        color: ``(B, C, H, W)`` linear.
        depth: ``(B, 1, H, W)`` planar view z, world units.
        motion: ``(B, 2, H, W)`` previous minus current, pixels.
        shutter: share of the frame interval during which the shutter is open, a half for 180 degrees; a float or
            ``(B,)``.
        position: ``"center"`` exposes half before and half after the frame, ``"trailing"`` ends with it.
        samples: moments of the exposure a pixel.
        tile: pixels: the largest blur to either side, of which a warning tells where many would be larger; cells are a
            quarter of that, or 8 if that is less.
        weights: ``"reconstruction"``, or ``"similarity"``: the weights saturate(m_s . m_0 / m_0 . m_0) along the
            pixel's own motion, with which moving things do not spill over static ones.
        softness: relative difference in depth over which "in front" fades to "behind".
        index: frame number, for the jitter.
        seed: another seed, another jitter.

    Returns:
        ``(B, C, H, W)``.

    Raises:
        ValueError: shapes disagree, a choice is unknown, or a number is out of range.

    Source: McGuire et al. 2012 and Guertin et al. 2014 (tiles, two directions, soft depth); Bowles et al. 2012
    (iterated image warping) for the second look; Rosado 2007, GPU Gems 3 chapter 27, and BetterRTX for ``similarity``.
    """
    check_beside(color, depth=depth, motion=motion)
    _check(shutter, samples, tile, softness)
    check_for_each(len(color), shutter=shutter)
    if weights not in ("reconstruction", "similarity"):
        raise ValueError(f"weights must be 'reconstruction' or 'similarity', got {weights!r}")
    if position not in ("center", "trailing"):
        raise ValueError(f"position must be 'center' or 'trailing', got {position!r}")
    color, depth, motion = finite(color), finite(depth), finite(motion)
    opening = -0.5 if position == "center" else 0.0
    share = number(shutter, motion).reshape(-1, 1, 1, 1)
    motion, longest = motion.to(color.dtype), tile / (1 + opening)
    size = length(motion) * share
    if weights == "reconstruction" and not waits(color) and not bool((size > STILL).any()):
        return color
    tell_cut(size, longest, "motion blur", "tile", tile)
    path = turned(motion) * (share * (longest / size).clamp_max(1.0))
    cell = max(min(tile // CELLS, LARGEST), tile // RINGS, 1)
    noise = blue_noise(*color.shape[-2:], index=index, dims=3, seed=seed, device=color.device).to(color.dtype)
    if weights == "similarity":
        return blur_alike(color, path, noise[0], opening=opening, samples=samples)
    dominant = _dominant(_reaching(_longest(path, cell), cell, 1 + opening, tile), cell, noise[1:])
    return reconstruct(color, depth, path, dominant, noise[0], opening=opening, samples=samples, softness=softness)


def _dominant(around: Tensor, cell: int, noise: Tensor) -> Tensor:
    """``(B, 2, H, W)``: the longest path ``around`` a pixel's cell, looked up with jitter to hide the cells."""
    height, width = noise.shape[-2:]
    y = torch.arange(height, device=noise.device)[:, None] + (noise[0] - 0.5) * (cell / 2)
    x = torch.arange(width, device=noise.device)[None] + (noise[1] - 0.5) * (cell / 2)
    row = y.clamp_(0, height - 1).div_(cell).floor_()
    column = x.clamp_(0, width - 1).div_(cell).floor_()
    which = row.mul_(around.shape[-1]).add_(column).long().flatten()
    return around.flatten(2)[:, :, which].view(*around.shape[:2], height, width)


def _longest(path: Tensor, size: int) -> Tensor:
    """``(B, 2, h, w)``: the longest path in each cell of ``size`` pixels."""
    square = path.detach().square().sum(1, keepdim=True)
    _, where = F.max_pool2d(square, size, size, 0, ceil_mode=True, return_indices=True)
    return path.flatten(2).gather(2, where.flatten(2).expand(-1, 2, -1)).view(*path.shape[:2], *where.shape[2:])


def _reaching(cells: Tensor, size: int, most: float, reach: int) -> Tensor:
    """The longest of the paths of the cells around, across and then down, that lead into each cell or one beside it.

    Args:
        cells: ``(B, 2, h, w)``, see `_longest`.
        size: of a cell, pixels.
        most: share of a path that is covered to either side.
        reach: pixels that no path exceeds to either side.
    """
    rings = -(-reach // size)
    for axis, dim in ((0, 3), (1, 2)):
        around = F.pad(cells, (rings, rings, 0, 0) if dim == 3 else (0, 0, rings, rings)).unfold(dim, 2 * rings + 1, 1)
        apart = torch.arange(-rings, rings + 1, device=cells.device).abs().sub(1).clamp_min(0) * size
        leads = around[:, axis].abs() * most >= apart
        square = torch.where(leads, around.detach().square().sum(1), -1.0)
        best = square.argmax(-1, keepdim=True)
        cells = around.gather(-1, best[:, None].expand(-1, 2, -1, -1, -1))[..., 0]
    return cells


def _check(shutter: float | Tensor, samples: int, tile: int, softness: float) -> None:
    check_numbers(softness=softness)
    check_each(0, shutter=shutter)
    check_counts(samples=samples, tile=tile)
    for name, count in (("samples", samples), ("tile", tile)):
        if count < 1:
            raise ValueError(f"{name} must be at least 1, got {count}")
    if not softness > 0:
        raise ValueError(f"softness must be positive, got {softness}")


class MotionBlur(Pass):
    """See `motion_blur`. Without motion in the G-buffer the scene is taken as static under a moving camera.

    Args:
        target_frame_time: seconds; where given, the blur is as long as at this frame time, whatever the actual
            frame times (it needs `Frame.previous`, which a pipeline fills).
    """

    reads = frozenset({"color", "depth"})
    optional = frozenset({"motion"})
    writes = frozenset({"color"})

    def __init__(
        self,
        *,
        shutter: float = 0.5,
        position: Position = "center",
        samples: int = 16,
        tile: int = 32,
        weights: Weights = "reconstruction",
        softness: float = 0.02,
        target_frame_time: float | None = None,
        seed: int = 0,
    ) -> None:
        super().__init__()
        self.position: Position = position
        self.weights: Weights = weights
        self.shutter, self.samples, self.tile = shutter, samples, tile
        self.softness, self.seed = softness, seed
        self.target_frame_time = target_frame_time

    def forward(self, frame: Frame) -> Frame:
        g = frame.gbuffer
        blurred = motion_blur(
            frame.read("color"), g.depth, motion_of(frame),
            shutter=self.shutter * self._stretch(frame), position=self.position, samples=self.samples,
            tile=self.tile, weights=self.weights, softness=self.softness, index=frame.index, seed=self.seed,
        )  # fmt: skip
        return frame.replace(color=blurred)

    def _stretch(self, frame: Frame) -> float | Tensor:
        if self.target_frame_time is None or frame.previous is None:
            return 1.0
        check_each(0, above=True, unit="seconds", target_frame_time=self.target_frame_time)
        elapsed = frame.time - frame.previous.time
        if isinstance(elapsed, Tensor):
            return torch.where(elapsed > 0, self.target_frame_time / elapsed, 1.0)
        return self.target_frame_time / elapsed if elapsed > 0 else 1.0


def motion_of(frame: Frame) -> Tensor:
    """The G-buffer's motion, else the motion due to the camera alone; zero after a cut or without cameras."""
    g = frame.gbuffer
    motion = g.motion
    if motion is None and g.previous_camera is not None:
        motion, _ = g.camera.static_motion(g.previous_camera, g.depth, g.hit)
    if motion is None:
        motion = g.depth.new_zeros(g.batch, 2, *g.camera.size)
    return motion if frame.cut is None else torch.where(frame.cut[:, None, None, None], 0.0, motion)
