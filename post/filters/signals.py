"""Signals as the denoise and accumulate stages use them: stacked by name, led by the first, albedo divided out."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypedDict

import torch
from torch import Tensor

from gbufrt import SIGNALS, Frame
from gbufrt.channels import check_picture
from gbufrt.names import several
from gbufrt.numeric import check_counts
from gbufrt.validation.known import is_known, know
from post.filters.units import unit_vectors

UNIT_VECTORS = frozenset(name for name, row in SIGNALS.items() if "unit length" in row.meaning)
MIN_ALBEDO = 1e-2  # below this, dividing by albedo would amplify noise more than it removes detail


class Guides(TypedDict):
    """Keywords that denoisers share."""

    lead: int
    variance: Tensor | None
    roughness: Tensor | None
    confidence: Tensor | None


def signal_names(signal: str | Iterable[str]) -> tuple[str, ...]:
    """One name or several as a tuple; a lone reflection also gets its confidence.

    Raises:
        ValueError: there is no name.
    """
    names = several("signal", signal, ("ao", "bent_normal"))
    return ("reflection", "reflection_confidence") if names == ("reflection",) else names


def wants_albedo(names: tuple[str, ...], demodulate: bool | None) -> bool:
    """Whether albedo is divided out: as requested, by default only for diffuse bounce light."""
    return names[0] == "gi" if demodulate is None else demodulate


def stack(frame: Frame, names: tuple[str, ...], *, demodulate: bool = False) -> Tensor:
    """Those of the named signals that the frame has, in one ``(B, C, H, W)``; it must have the first.

    Raises:
        TypeError: a signal holds no floats.
        ValueError: a signal is no picture, or the first is not there.
    """
    present = [frame.read(names[0])] + [tensor for name in names[1:] if (tensor := frame.get(name)) is not None]
    for name in names:
        if (extra := frame.extra.get(name)) is not None:
            check_picture(name, extra, "any unit", None)
    known = all(map(is_known, present))
    if demodulate and present[0].shape[1] == 3:
        present[0] = present[0] / guarded_albedo(frame)
    stacked = torch.cat(present, dim=1) if len(present) > 1 else present[0]
    if known:
        know(stacked)
    return stacked


def unstack(
    frame: Frame, names: tuple[str, ...], stacked: Tensor, *, demodulate: bool = False, views: bool = False
) -> Frame:
    """The inverse of `stack`: write the signals back, unit vectors normalized, sky pixels unchanged.

    Args:
        frame: that the signals are of.
        names: theirs.
        stacked: ``(B, C, H, W)``.
        demodulate: whether albedo was divided out.
        views: whether ``stacked`` stays in memory anyway, as the mean that a history holds. Without gradients, signals
            that are as in it are then views of it in place of copies, and its sky pixels are written over; those of
            several elements of a batch, which do not lie side by side, are copied all the same.
    """
    start = 0
    for name in names:
        before = frame.get(name)
        if before is None:
            continue
        signal = part = stacked[:, start : start + before.shape[1]]
        start += before.shape[1]
        if demodulate and name == names[0] and before.shape[1] == 3:
            signal = signal * guarded_albedo(frame)
        if name in UNIT_VECTORS:
            signal = unit_vectors(signal, before)
        own = views and signal is part and part.is_contiguous() and not torch.is_grad_enabled()
        signal = torch.where(frame.gbuffer.hit, signal, before, out=part if own else None)
        frame = frame.write(name, signal)
    return frame


def guides(frame: Frame, names: tuple[str, ...]) -> Guides:
    """Further inputs of a denoiser for these signals, as keywords."""
    specular = names[0] == "reflection"
    return {
        "lead": frame.read(names[0]).shape[1],
        "variance": frame.extra.get(f"{names[0]}_variance"),
        "roughness": frame.gbuffer.roughness if specular else None,
        "confidence": frame.reflection_confidence if specular else None,
    }


def check_lead(lead: int | None, signal: Tensor) -> None:
    """Raise unless ``lead`` is None or counts channels that a signal ``(B, C, H, W)`` has.

    Raises:
        TypeError: it is no whole number.
        ValueError: it is below 1 or beyond the channels.
    """
    if lead is None:
        return
    check_counts(lead=lead)
    if not 1 <= lead <= signal.shape[1]:
        raise ValueError(f"lead must lie in 1 to {signal.shape[1]}, the channels of the signal, got {lead}")


def guarded_albedo(frame: Frame) -> Tensor:
    """What diffuse light is divided by: multiplying back is exact for any guard, and `unstack` keeps the sky's light.

    Frames without albedo divide by one.
    """
    albedo = frame.gbuffer.albedo
    return torch.ones_like(frame.gbuffer.depth) if albedo is None else albedo.clamp_min(MIN_ALBEDO)
