"""Pixels that are not finite: light is mended; geometry is refused, or confined to its own pixel.

In light, NaN and minus infinity become 0, and infinity the largest finite value of its channel (in its element of the
batch). A pixel whose depth or normal is not finite cannot be mended; passes treat it as a miss.

Most tensors are finite, and are left alone once that is known. On a GPU the host would wait to know it: there passes
mend whatever comes, which changes no finite number.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import torch
from torch import Tensor

from gbufrt.compute.resident import waits
from gbufrt.frame import SIGNALS, Frame
from gbufrt.gbuffer import CHANNELS, GBuffer
from gbufrt.numeric import check_kind
from gbufrt.validation.known import as_finite_as, is_known, keep, know, knowing
from gbufrt.validation.pixels import all_finite, check_finite, pixels

SURFACE = ("depth", "normal", "normal_geo")  # without these a pixel shows no surface
WHOLE = ("motion", "bent_normal")  # vectors: one component means nothing without the others


@dataclass(frozen=True, kw_only=True)
class Mended:
    """What `mended` did to one channel.

    Args:
        channel: its name, with the prefix ``behind.`` for what lies behind the first surface.
        pixels: how many pixels were mended.
        nan: how many of them held a NaN, which became 0.
        largest: what infinite light became; None where there was none.
    """

    channel: str
    pixels: int
    nan: int
    largest: float | None

    def __str__(self) -> str:
        what = [f"{self.nan} NaN to 0"] if self.nan else []
        what += [] if self.largest is None else [f"{self.pixels - self.nan} infinite to {self.largest:.4g}"]
        return f"{self.channel}: {self.pixels} pixel{'' if self.pixels == 1 else 's'} ({', '.join(what)})"


def mended(frame: Frame) -> tuple[Frame, tuple[Mended, ...]]:
    """The frame with finite light, and what was done to it.

    Light, emission and signals are mended as the module says, in ``behind`` too; ``previous`` is left alone. If there
    is nothing to mend, the frame itself is returned.

    Raises:
        ValueError: another G-buffer channel is not finite: names the channel, how many pixels, and one of them.
    """
    check_kind(Frame, "frame", frame)
    return _mended(frame, "")


def _mended(frame: Frame, prefix: str) -> tuple[Frame, tuple[Mended, ...]]:
    g, done = frame.gbuffer, []
    for name in g.present:
        if name != "emission":
            remedy = "; only light can be mended: render the frame again without them"
            check_finite(prefix + name, getattr(g, name), remedy)
    for name in ("emission", *SIGNALS, *frame.extra):
        before = frame.get(name)
        if before is None or _is_finite(before):
            continue
        after = finite(before)
        done.append(_account(prefix + name, before, after))
        frame = _with(frame, name, after)
    if frame.behind is not None:
        behind, more = _mended(frame.behind, f"{prefix}behind.")
        frame, done = (frame.replace(behind=behind) if more else frame), [*done, *more]
    return frame, tuple(done)


def finite(tensor: Tensor, *, nan: float = 0.0) -> Tensor:
    """``tensor`` without NaN and infinity; the same object where it is known that there are none.

    Args:
        tensor: ``(B, ...)`` of any type.
        nan: what NaN and minus infinity become.

    Returns:
        As ``tensor``. Where it was infinite it is the largest finite value of its element of the batch, at least
        ``nan``. Gradients pass through all other places.
    """
    if _known_finite(tensor):
        return tensor
    if waits(tensor) and not (torch.is_grad_enabled() and tensor.requires_grad):  # a third of the kernels
        largest = torch.nan_to_num(tensor, nan=nan, posinf=nan, neginf=nan).flatten(1).amax(1)
        open_above = torch.nan_to_num(tensor, nan=nan, posinf=torch.inf, neginf=nan)
        return torch.minimum(open_above, largest.view(-1, *(1,) * (tensor.ndim - 1)))
    known = torch.isfinite(tensor)
    largest = torch.where(known, tensor.detach(), nan).flatten(1).amax(1).clamp_min(nan)
    largest = largest.view(-1, *(1,) * (tensor.ndim - 1))
    return torch.where(known, tensor, torch.where(tensor == torch.inf, largest, nan))


def contained(frame: Frame, names: Iterable[str]) -> Frame:
    """The frame without NaN or infinity in the channels and signals called ``names``, so that no pass spreads them.

    Light, signals and materials are made `finite`, with the clear value for NaN. Where depth or normal is not finite,
    the pixel becomes a miss. ``behind`` and ``previous`` are treated alike. If all is known to be finite, the frame
    itself is returned; that costs one sum over each channel, and nothing where `remembering` knows it.
    """
    names = tuple(names)
    if _clean(frame, names):
        return frame
    frame = frame.replace(gbuffer=g) if (g := _geometry(frame.gbuffer, names)) is not frame.gbuffer else frame
    for name in names:
        before = None if name in CHANNELS else frame.get(name)
        if before is not None and (after := _signal(name, before)) is not before:
            frame = frame.write(name, after)
    for layer in ("behind", "previous"):
        other: Frame | None = getattr(frame, layer)
        if other is not None and (held := contained(other, names)) is not other:
            frame = frame.replace(**{layer: held})
    return frame


@contextmanager
def remembering(frame: Frame, names: Iterable[str]) -> Iterator[None]:
    """Inside, `contained` looks at each tensor once, or mends it once. Nothing may write into them until the end.

    Those of ``frame`` called ``names`` are looked at now, all together.

    Args:
        frame: that passes are to see.
        names: of the channels and signals that they read.
    """
    with knowing([] if frame.previous is None else _tensors(frame.previous)):
        _clean(frame, tuple(names))
        yield


def remember(previous: Frame) -> Frame:
    """Inside `remembering`: the same frame, of which what is known is known, too, when it is the one before."""
    keep(_tensors(previous))
    return previous


def _tensors(frame: Frame) -> list[Tensor]:
    return [frame.read(name) for name in frame.present]


def _clean(frame: Frame, names: tuple[str, ...]) -> bool:
    """Whether all tensors are known to be finite, by their sums."""
    layers = [layer for layer in (frame, frame.behind, frame.previous) if layer is not None]
    every = [tensor for layer in layers for name in names if (tensor := layer.get(name)) is not None]
    every = [tensor for tensor in every if tensor.is_floating_point() and not is_known(tensor)]
    if any(waits(tensor) for tensor in every):
        return False
    finite_ones = [tensor for tensor in every if all_finite(tensor)]
    for tensor in finite_ones:
        know(tensor)
    return len(finite_ones) == len(every)


def held(depth: Tensor, hit: Tensor, normal: Tensor, far: float) -> tuple[Tensor, Tensor, Tensor]:
    """Geometry for functions that read the whole picture: pixels that are not finite become misses.

    Args:
        depth: ``(B, 1, H, W)`` planar view z, world units.
        hit: ``(B, 1, H, W)`` bool.
        normal: ``(B, 3, H, W)``.
        far: the camera's far, the depth of a miss.

    Returns:
        Depth, hit and normal; the same objects where all are known to be finite.
    """
    if _known_finite(depth) and _known_finite(normal):
        return depth, hit, normal
    lost = ~(torch.isfinite(depth) & torch.isfinite(normal).all(dim=1, keepdim=True))
    return torch.where(lost, far, depth), hit & ~lost, torch.where(lost, 0.0, normal)


def _geometry(g: GBuffer, names: tuple[str, ...]) -> GBuffer:
    given: dict[str, Tensor] = {n: t for n in names if n in CHANNELS and (t := getattr(g, n)) is not None}
    bad = [name for name, tensor in given.items() if not _known_finite(tensor)]
    changes: dict[str, Tensor] = {}
    if surfaces := [name for name in SURFACE if name in bad]:
        lost = ~torch.stack([torch.isfinite(given[name]).all(dim=1, keepdim=True) for name in surfaces]).all(0)
        for name in g.present:
            before, clear = getattr(g, name), g.camera.far if name == "depth" else CHANNELS[name].clear
            cleared = torch.where(lost, before.new_full((), clear), before)
            changes[name] = as_finite_as(before, cleared)
    for name in bad:
        if name in surfaces:
            know(changes[name])
        else:
            changes[name] = _signal(name, changes.get(name, given[name]))
    return g.replace(**changes) if changes else g


def _signal(name: str, tensor: Tensor) -> Tensor:
    row = SIGNALS.get(name) or CHANNELS.get(name)
    if name in WHOLE and not _known_finite(tensor):
        after = torch.where(torch.isfinite(tensor).all(dim=1, keepdim=True), tensor, 0.0)
    else:
        after = finite(tensor, nan=0.0 if row is None else row.clear)
    if waits(after):
        know(after)
    return after


def _known_finite(tensor: Tensor) -> bool:
    """Whether a tensor is known to be finite; to look at it costs a sum on the CPU where `remembering`
    does not know it, and is left out on a GPU."""
    if is_known(tensor):
        return True
    return not tensor.is_floating_point() if waits(tensor) else _is_finite(tensor)


def _is_finite(tensor: Tensor) -> bool:
    """Whether it is; large numbers may be, although their sum overflows."""
    return not tensor.is_floating_point() or all_finite(tensor) or bool(torch.isfinite(tensor).all())


def _account(name: str, before: Tensor, after: Tensor) -> Mended:
    nan, infinite = torch.isnan(before), torch.isinf(before)
    largest = float(after[infinite].max()) if bool(infinite.any()) else None
    return Mended(channel=name, pixels=pixels(nan | infinite), nan=pixels(nan), largest=largest)


def _with(frame: Frame, name: str, tensor: Tensor) -> Frame:
    if name in CHANNELS:
        return frame.replace(gbuffer=frame.gbuffer.replace(**{name: tensor}))
    return frame.write(name, tensor)
