"""Pictures of what any EXR file holds, before anything is known of its meaning: by names of channels and by values."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import torch
from torch import Tensor

from gbufrt.files.color_maps import flow, ids, to_srgb, viridis
from gbufrt.files.gbuffers.layers import Layers

TOGETHER = ("RGB", "XYZ", "xyz", "XY", "ZW", "UV", "uv")  # channels that make one picture
SKY = 1e9  # where renderers write such a distance, or more, there is nothing
NOT_FINITE = (1.0, 0.0, 1.0)
ENDS = (0.01, 0.99)  # quantiles at the ends of a scale
SAMPLES = 100_000  # pixels that quantiles are taken of
UNIT = 0.02  # from length 1, of vectors that are directions


def pictures(layers: Layers) -> Iterator[tuple[str, Tensor]]:
    """All of a file's channels as ``(1, 3, H, W)`` pictures in [0, 1], each with its name and the range of its values.

    Colours up to 1 are shown as they are and brighter ones darkened together; unit vectors as directions; other vectors
    and numbers between their 1st and 99th percentile, by a colour map where there is one number, and one value
    everywhere as on a scale from 0 to 1; pairs XY, ZW and uv as motion, up to the 99th percentile of its length.
    Numbers from 1e9 on are black, what is not finite magenta.
    """
    for base, keys in layers.groups().items():
        for letters, some in _pieces(keys):
            planes = [layers.pixels(key) for key in some]
            raw = torch.from_numpy(np.stack(planes).astype(np.float32))[None]
            finite = raw.isfinite().all(1, keepdim=True)
            seen = _seen(letters, raw.nan_to_num(0.0, 0.0, 0.0), whole=planes[0].dtype.kind == "u")
            shown = torch.where(finite, seen.clamp(0, 1), raw.new_tensor(NOT_FINITE).view(1, 3, 1, 1))
            yield f"{base}.{letters}".removeprefix(".") + f"  {span(planes)}", shown


def span(planes: Sequence[np.ndarray]) -> str:
    """The lowest and the highest finite value of planes, as text."""
    finite = [plane[np.isfinite(plane)] for plane in planes]
    values = [float(end) for some in finite if some.size for end in (some.min(), some.max())]
    if not values:
        return "nothing finite"
    low, high = min(values), max(values)
    return f"{low:.4g}" if low == high else f"{low:.4g} to {high:.4g}"


def _pieces(keys: list[str]) -> Iterator[tuple[str, list[str]]]:
    """Channels of one layer that make a picture together: `TOGETHER`, and the others alone."""
    left = {key.rpartition(".")[2]: key for key in keys}
    pairs = TOGETHER[3:] if "W" in left else TOGETHER
    for letters in pairs:
        if left.keys() >= set(letters):
            yield letters, [left.pop(letter) for letter in letters]
    for letter, key in left.items():
        yield letter, [key]


def _seen(letters: str, raw: Tensor, *, whole: bool) -> Tensor:
    if letters == "RGB":
        bright = float(_ends(raw)[1])
        return to_srgb(raw if bright <= 1 else raw / (raw + bright / 4))
    if letters in ("XY", "ZW", "uv"):
        return flow(raw / _ends(raw.norm(dim=1, keepdim=True))[1].clamp_min(1e-12))
    if raw.shape[1] == 3 and _directions(raw):
        return torch.where(raw.square().sum(1, keepdim=True) > 0, raw * 0.5 + 0.5, 0.0)
    if raw.shape[1] > 1:
        scaled = torch.cat([_scaled(plane) for plane in raw.split(1, 1)], 1)
        return torch.nn.functional.pad(scaled, (0, 0, 0, 0, 0, 3 - scaled.shape[1]))
    if whole:
        return ids(raw.long())
    return torch.where(raw < SKY, viridis(_scaled(raw)), 0.0)


def _directions(raw: Tensor) -> bool:
    """Whether most vectors that are not zero have length 1."""
    length = raw.norm(dim=1)
    unit = (length - 1).abs() < UNIT
    return 2 * int(unit.sum()) > int((length > UNIT).sum()) > 0


def _scaled(plane: Tensor) -> Tensor:
    """From 0 to 1 between its `_ends`; one value everywhere is itself, so that 1 is not shown as 0 is."""
    low, high = _ends(plane)
    return (plane - low) / (high - low) if high > low else plane


def _ends(values: Tensor) -> Tensor:
    below = values[values < SKY]
    if not len(below):
        return values.new_tensor([0.0, 1.0])
    return torch.quantile(below[:: max(1, len(below) // SAMPLES)], values.new_tensor(ENDS))
