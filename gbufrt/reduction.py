"""Where stages run: on a layer of the frame, or on a frame of another size, such as that of every second pixel."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from typing import Literal

from torch import Tensor

from gbufrt.camera import Camera
from gbufrt.frame import LIGHT, SIGNALS, Frame
from gbufrt.gbuffer import GBuffer
from gbufrt.validation.known import as_finite_as


class Reduction(ABC):
    """How a `Pipeline` runs stages on a frame of another size: what they see, and what the frame gets of theirs."""

    @abstractmethod
    def reduce(self, frame: Frame) -> Frame:
        """The frame that stages see; a smaller one has its ``previous`` reduced in the same way."""

    @abstractmethod
    def restored(self, written: frozenset[str]) -> frozenset[str]:
        """Which of the signals that stages write come back to the whole frame."""

    @abstractmethod
    def restore(self, frame: Frame, reduced: Frame, names: frozenset[str]) -> Frame:
        """``frame`` with the named signals of the one that stages saw, where it has them, as they are stored here."""


@dataclass(frozen=True)
class LightKept(Reduction):
    """The frame itself, whose light stages may change for those after them; it comes back as it came.

    So a denoiser may write over the light that it cleans, and files still hold what the renderer gave.
    """

    def reduce(self, frame: Frame) -> Frame:
        return frame

    def restored(self, written: frozenset[str]) -> frozenset[str]:
        return written - frozenset(LIGHT)

    def restore(self, frame: Frame, reduced: Frame, names: frozenset[str]) -> Frame:
        for name in sorted(names):
            if (signal := reduced.get(name)) is not None:
                frame = frame.write(name, signal)
        return frame


@dataclass(frozen=True)
class Place:
    """Which frame stages see: a layer of the frame, that frame reduced, or both; by default the frame itself.

    Raises:
        TypeError: ``reduction`` is none.
        ValueError: there is no such layer.
    """

    layer: Literal["behind"] | None = None
    reduction: Reduction | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.reduction, Reduction | None):
            raise TypeError(f"reduction must be one such as post.Reduced(), got {self.reduction!r}")
        if self.layer not in (None, "behind"):
            raise ValueError(f'layer must be "behind" or None, got {self.layer!r}')

    def enter(self, frame: Frame, names: Collection[str]) -> Frame | None:
        """The frame that stages see; None where there is no such layer. Only what they name is reduced."""
        own = frame if self.layer is None else frame.behind
        return own if own is None or self.reduction is None else self.reduction.reduce(own.only(names))

    def leave(self, frame: Frame, seen: Frame, written: Iterable[str]) -> Frame:
        """``frame`` with what stages have ``written`` on the frame that they saw."""
        own = frame if self.layer is None else frame.behind
        if self.reduction is not None and own is not None:
            seen = self.reduction.restore(own, seen, self.returned(written))
        return seen if self.layer is None else frame.replace(behind=seen)

    def returned(self, written: Iterable[str]) -> frozenset[str]:
        """Which of the signals that stages write come back to the whole frame."""
        return frozenset(written) if self.reduction is None else self.reduction.restored(frozenset(written))


def every_nth_camera(camera: Camera, stride: int) -> Camera:
    """The camera of every ``stride``-th pixel both ways, from the top left one on.

    The middle of a pixel of the smaller picture is that of the pixel it stands for, so the picture's position p in
    pixels becomes (p - 1/2) / stride + 1/2.
    """
    intrinsics = camera.intrinsics.clone()
    intrinsics[:, :2] = intrinsics[:, :2] / stride
    intrinsics[:, :2, 2] = intrinsics[:, :2, 2] + (0.5 - 0.5 / stride)
    return Camera(
        intrinsics=intrinsics,
        world_from_view=camera.world_from_view,
        size=(-(-camera.height // stride), -(-camera.width // stride)),
        near=camera.near,
        far=camera.far,
        orthographic=camera.orthographic,
        jitter=None if camera.jitter is None else camera.jitter / stride,
    )


def every_nth(frame: Frame, stride: int) -> Frame:
    """The frame of every ``stride``-th pixel both ways, from the top left one on; see `every_nth_camera`.

    Motion shrinks with the picture. ``behind`` and ``previous`` are reduced alike.
    """
    size = frame.gbuffer.camera.size

    def thinned(tensor: Tensor) -> Tensor:
        return _every_nth(tensor, stride) if tensor.shape[-2:] == size else tensor

    signals = {n: thinned(t) for n, row in SIGNALS.items() if row.full_size and (t := getattr(frame, n)) is not None}
    layers = {n: every_nth(layer, stride) for n in ("behind", "previous") if (layer := getattr(frame, n)) is not None}
    extra = {name: thinned(tensor) for name, tensor in frame.extra.items()}
    return frame.replace(gbuffer=_every_nth_gbuffer(frame.gbuffer, stride), extra=extra, **signals, **layers)


def _every_nth_gbuffer(g: GBuffer, stride: int) -> GBuffer:
    channels = {name: _every_nth(getattr(g, name), stride) for name in g.present}
    if "motion" in channels:
        channels["motion"] = as_finite_as(channels["motion"], channels["motion"] / stride)
    before = None if g.previous_camera is None else every_nth_camera(g.previous_camera, stride)
    return GBuffer(camera=every_nth_camera(g.camera, stride), previous_camera=before, **channels)


def _every_nth(tensor: Tensor, stride: int) -> Tensor:
    return as_finite_as(tensor, tensor[..., ::stride, ::stride].contiguous())
