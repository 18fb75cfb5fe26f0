"""The layers of an EXR file, whatever its parts."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fnmatch import fnmatchcase
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from gbufrt.files.guard import Part

ENDS = ("XYZ", "RGB", "xyz", "rgb", "uv", "UV")
ORDER = "RGBAXYZWUVTIrgbaxyzwuv"  # in which letters of channels are said


class Layers:
    """Channels of all parts under full names; a part's name goes before channels that do not carry it.

    Raises:
        ValueError: two parts hold a channel of one name, or a part is cropped.
    """

    def __init__(self, path: str | Path, parts: Sequence[Part]) -> None:
        self.path = path
        self._parts: dict[str, tuple[Part, str]] = {}
        for part in parts:
            for name in part.names:
                known = not part.name or name.startswith(f"{part.name}.") or len(parts) == 1
                full = name if known else f"{part.name}.{name}"
                if full in self._parts:
                    raise ValueError(f"{path} holds the channel {full!r} in two parts; rename one of them")
                self._parts[full] = part, name
        self.names = tuple(self._parts)

    def find(self, names: Iterable[str], count: int, layer: str = "") -> list[str]:
        """Channels of the first name that is there with ``count`` numbers, those of ``layer`` first; or none."""
        for name in names:
            ends = [""] if count == 1 else ["." + "".join(letters) for letters in ENDS if len(letters) >= count]
            for end in ends:
                letters = end[1 : count + 1]
                for base in self._bases(name, end, layer):
                    keys = [base] if not end else [f"{base}.{c}" if base else c for c in letters]
                    if all(key in self._parts for key in keys):
                        return keys
        return []

    def groups(self) -> dict[str, list[str]]:
        """Channels by what comes before their last dot, R before G before B, X before Y before Z."""
        found: dict[str, list[str]] = {}
        for name in self.names:
            found.setdefault(name.rpartition(".")[0], []).append(name)
        rank = {letter: place for place, letter in enumerate(ORDER)}
        for names in found.values():
            names.sort(key=lambda name: rank.get(name.rpartition(".")[2], len(rank)))
        return found

    def pixels(self, key: str) -> np.ndarray:
        """``(H, W)`` of a channel, in the type of the file."""
        part, name = self._parts[key]
        return part.channels[name]

    def part(self, key: str) -> Part:
        """The part that holds a channel."""
        return self._parts[key][0]

    def layers_of(self, names: Iterable[str]) -> tuple[str, ...]:
        """What stands before each of the channels of one number that ``names`` fit."""
        found = [base for name in names for base in self._bases(name, "", "")]
        return tuple(dict.fromkeys(self.layer_of(key) for key in found))

    @staticmethod
    def layer_of(key: str) -> str:
        """What stands before the layer's own name in a channel's name, such as a view layer."""
        return key.rsplit(".", 2)[0] if key.count(".") >= 2 else ""

    def stack(self, keys: Sequence[str], size: tuple[int, int] | None = None) -> Tensor:
        """``(1, C, H, W)`` float32 of those channels.

        Raises:
            ValueError: they are not of ``size``, or their part is cropped.
        """
        planes = []
        for key in keys:
            part, name = self._parts[key]
            (x0, y0), (x1, y1) = part.header.get("displayWindow", part.header["dataWindow"])
            if list(part.header["dataWindow"][0]) != [x0, y0] or part.size != (y1 - y0 + 1, x1 - x0 + 1):
                raise ValueError(f"{self.path} is cropped: {key} does not fill the display window; save it whole")
            if size is not None and part.size != size:
                raise ValueError(
                    f"{self.path} must have layers of one size, but {key} is {part.size[1]}x{part.size[0]} and depth "
                    f"{size[1]}x{size[0]}; save them at one size"
                )
            planes.append(part.channels[name].astype(np.float32))
        return torch.from_numpy(np.stack(planes))[None]

    def _bases(self, name: str, end: str, layer: str) -> list[str]:
        """What ``name`` stands for: full names, or what comes before the last dot where ``end`` follows."""
        bases = self.names if not end else tuple(dict.fromkeys(n.rpartition(".")[0] for n in self.names))
        found = [b for b in bases if fnmatchcase(b, name) or (name and fnmatchcase(b, f"*.{name}"))]
        inside = [b for b in found if layer and b.startswith(f"{layer}.")]
        return inside if layer else found
