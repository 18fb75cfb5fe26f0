"""Temporal anti-aliasing of a jittered camera."""

from __future__ import annotations

import math
from typing import Any

import torch
from torch import Tensor

from gbufrt import Camera, Frame, GBuffer, History, TemporalPass
from gbufrt.demands.pictures import check_pictures
from gbufrt.history import check_history
from gbufrt.mending import finite
from gbufrt.names import single
from gbufrt.numeric import check_between
from post.history.op import anti_alias
from post.history.reproject import history_for, motion_of


def taa(
    color: Tensor,
    gbuffer: GBuffer,
    history: History | None = None,
    *,
    blend: float = 0.93,
    gamma: float = 1.25,
) -> tuple[Tensor, History]:
    """Average jittered frames into one anti-aliased picture on the grid without jitter.

    Each frame is resampled to pixel centres by a narrow Gaussian window around its jittered samples. The history is
    read with Catmull-Rom weights along the pixel's motion, or that of the edge of a body in front of its plane in 3x3,
    and clipped in YCoCg to the mean and variance of the current 3x3 pixels. It holds fewer frames where it is read
    between pixels, since every such read softens it: four where halfway in one direction, two in both. All colours are
    weighted by 1 / (1 + luminance), so that bright edges are anti-aliased as they will be displayed.

    Args:
        color: ``(B, 3, H, W)`` linear radiance.
        gbuffer: of this frame; its camera holds the jitter.
        history: what this function returned for the frame before; None at first.
        blend: largest share of history, where it is read at pixel centres.
        gamma: standard deviations to which the history is clipped.

    Returns:
        ``(B, 3, H, W)`` linear radiance and the history for the next frame.

    Raises:
        TypeError: color is no tensor, or of another kind of floats than the G-buffer.
        ValueError: a number is out of range, or color or history has another size than the G-buffer.

    Source: Karis 2014; Salvi 2016 (variance clipping); Jimenez 2016 (Catmull-Rom history).
    """
    check_between(0, 1, blend=blend)
    check_between(0, math.inf, gamma=gamma)
    check_history(gbuffer, history, "toned")
    check_pictures(gbuffer.camera, depth=gbuffer.depth, color=color)
    if history is not None and history.length.shape != gbuffer.depth.shape:
        raise ValueError(
            f"the history must be {tuple(gbuffer.depth.shape)} like the frame, got {tuple(history.length.shape)}; "
            "start with state=None after a change of size"
        )
    color = finite(color)  # the history would keep a bad pixel for ever
    depth = torch.where(gbuffer.hit, gbuffer.depth, torch.inf)
    before, age, motion = None, torch.zeros_like(gbuffer.depth), torch.zeros_like(color[:, :2])
    if history is not None and history.gbuffer is not None:
        before, age = history.signals["toned"], history.length
        motion = motion_of(gbuffer, history.gbuffer.camera)[0]
    given = color, gbuffer.camera.jitter, depth, motion, before, age
    result, toned, length = anti_alias(*given, **_planes(gbuffer), blend=blend, gamma=gamma)
    return result, History(length=length, signals={"toned": toned}, gbuffer=gbuffer.geometry())


@torch.no_grad()
def _planes(g: GBuffer) -> dict[str, Any]:
    """What `anti_alias` is to know of the planes that pixels show."""
    normal = g.normal if g.normal_geo is None else g.normal_geo
    return {
        "normal": normal.detach().to(g.depth),
        "rays": ray_matrix(g.camera).to(g.depth),
        "parallel": g.camera.orthographic,
    }


def ray_matrix(camera: Camera) -> Tensor:
    """``(B, 3, 3)``, see `anti_alias`."""
    focal_x, focal_y, center_x, center_y, jitter_x, jitter_y = camera.lens.unbind(1)
    zero, one = torch.zeros_like(focal_x), torch.ones_like(focal_x)
    x, y = (0.5 + jitter_x - center_x) / focal_x, (0.5 + jitter_y - center_y) / focal_y
    if camera.orthographic:
        x, y = zero, zero
    seen = torch.stack([1 / focal_x, zero, x, zero, 1 / focal_y, y, zero, zero, one], dim=1).unflatten(1, (3, 3))
    return camera.rotation_to_view.mT @ seen


class TAA(TemporalPass):
    """Anti-alias ``color``, or other light. See `taa`.

    Samples need not lie where the camera's jitter says: after `Denoise`, edges of a path tracer that takes a random
    place in each pixel become smooth too.

    Args:
        signal: name of the light, such as ``radiance`` after `Denoise`.
        blend: see `taa`.
        gamma: see `taa`.
    """

    optional = frozenset({"motion", "normal_geo"})

    def __init__(self, *, signal: str = "color", blend: float = 0.93, gamma: float = 1.25) -> None:
        super().__init__()
        self.signal = single("signal", signal, "radiance")
        self.reads = frozenset({"depth", "normal", "hit", signal})
        self.writes = frozenset({signal})
        self.blend = blend
        self.gamma = gamma

    def forward(self, frame: Frame, state: History | None = None) -> tuple[Frame, History]:
        history = history_for(state, frame.cut)
        color, state = taa(frame.read(self.signal), frame.gbuffer, history, blend=self.blend, gamma=self.gamma)
        return frame.write(self.signal, color), state
