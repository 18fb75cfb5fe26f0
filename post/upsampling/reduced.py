"""Stages at a half or a third of the resolution: they see few pixels, and the rest is interpolated along surfaces."""

from __future__ import annotations

from dataclasses import dataclass

import torch

from gbufrt import SIGNALS, Frame
from gbufrt.numeric import check_counts
from gbufrt.reduction import Reduction, every_nth
from post.filters.signals import MIN_ALBEDO, UNIT_VECTORS, guarded_albedo, wants_albedo
from post.filters.surfaces import surface
from post.filters.units import unit_vectors
from post.upsampling.op import upsample


@dataclass(frozen=True)
class Reduced(Reduction):
    """Every ``stride``-th pixel both ways; signals come back by `upsample`, ``gi`` without its albedo.

    Of what the stages write, signals that `gbufrt.Frame` has fields for come back, and those named in ``extra``.

    Raises:
        TypeError: the stride is no whole number, or ``extra`` no names.
        ValueError: the stride is not positive.
    """

    stride: int = 2
    extra: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check_counts(stride=self.stride)
        several = isinstance(self.extra, (tuple, list, set, frozenset))
        if not several or not all(isinstance(name, str) for name in self.extra):
            raise TypeError(f"extra must be names of signals, as in extra=('fog',), got {self.extra!r}")
        if self.stride < 1:
            raise ValueError(f"stride must be at least 1, got {self.stride}")

    def reduce(self, frame: Frame) -> Frame:
        return every_nth(frame, self.stride)

    def restored(self, written: frozenset[str]) -> frozenset[str]:
        return frozenset(name for name in written if name in SIGNALS or name in self.extra)

    def restore(self, frame: Frame, reduced: Frame, names: frozenset[str]) -> Frame:
        g, present = frame.gbuffer, [name for name in sorted(names) if reduced.get(name) is not None]
        lit = frozenset(name for name in present if wants_albedo((name,), None))
        low = [reduced.read(n) / guarded_albedo(reduced) if n in lit else reduced.read(n) for n in present]
        sizes = [signal.shape[1] for signal in low]
        clear = [
            SIGNALS[n].clear if n in SIGNALS else 0.0
            for n, size in zip(present, sizes, strict=True)
            for _ in range(size)
        ]
        geometry = surface(g.depth, g.normal, g.hit, g.camera)
        found = upsample(torch.cat(low, dim=1), geometry, stride=self.stride, clear=clear)
        for name, signal in zip(present, found.split(sizes, dim=1), strict=True):
            if name in lit:  # what hit nothing holds 0, whatever its albedo
                signal = signal if g.albedo is None else signal * g.albedo.clamp_min(MIN_ALBEDO)
            elif name in UNIT_VECTORS:
                signal = unit_vectors(signal, g.normal * g.hit)
            frame = frame.write(name, signal)
        return frame
