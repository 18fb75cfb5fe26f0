"""The layers of an EXR file, whatever its parts, views and data windows."""

from __future__ import annotations

from collections import Counter
from collections.abc import Container, Iterable, Sequence
from fnmatch import fnmatchcase
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from gbufrt.files.guard import Part

ENDS = (*map(tuple, ("XYZ", "RGB", "xyz", "rgb", "uv", "UV")), ("red", "green", "blue"))
DCT = ("R", "G", "B", "Y")  # last names of channels that DWAA and DWAB pack with losses
ORDER = "RGBAXYZWUVTIrgbaxyzwuv"  # in which letters of channels are said


class Layers:
    """Channels of all parts under full names; a part's name goes before channels that do not carry it.

    So does the name of a pass that has a file of its own, before channels without a layer, or of several such files.

    Of several views, as stereo files have them, the first is taken, and its name left out of those of channels. Three
    channels whose names differ in a last letter x, y, z are a vector: ``Px``, of old pbrt, becomes ``P.x``.

    Raises:
        ValueError: two parts hold a channel of one name.
    """

    def __init__(self, path: str | Path, parts: Sequence[Part]) -> None:
        self.path = path
        self.views = _views(parts)
        """All views, where there are several."""
        self.size = parts[0].whole
        """``(H, W)`` of the picture: its display window."""
        self.pixel_aspect = parts[0].pixel_aspect
        self.header = {key: value for part in reversed(parts) for key, value in part.header.items()}
        """Attributes of all parts, those of the first before others."""
        self._joints = "._" if any(part.of_pass for part in parts) else "."
        self._parts: dict[str, tuple[Part, str]] = {}
        told = [(self._seen(_full(part, name, parts), part), part, name) for part in parts for name in part.names]
        holders = Counter(full for full, _ in {(full, part.of_pass) for full, part, _ in told})
        for full, part, name in told:
            if not full:
                continue
            if part.of_pass and ("." not in full or holders[full] > 1):
                full = f"{part.of_pass}.{full}"
            if full in self._parts:
                raise ValueError(f"{path} holds the channel {full!r} in two parts; rename one of them")
            self._parts[full] = part, name
        self._parts = {_dotted(name, self._parts): at for name, at in self._parts.items()}
        self.names = tuple(self._parts)

    def find(self, names: Iterable[str], count: int, layer: str = "", *, any_case: bool = False) -> list[str]:
        """Channels of the first name that is there with ``count`` numbers, those of ``layer`` first; or none.

        ``any_case``: capitals and small letters of names are the same. Files of a pass each may be called by a name
        after an underscore too, where none has the whole of it.
        """
        names = tuple(names)
        for joint, name in [(joint, name) for joint in self._joints for name in names]:
            for end in [()] if count == 1 else [letters[:count] for letters in ENDS if len(letters) >= count]:
                for base in self._bases(name, layer, whole=not end, any_case=any_case, joint=joint):
                    keys = [f"{base}.{c}" if base else c for c in end] or [base]
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

    def apart(self, key: str) -> str:
        """What to say of a channel whose data window lies outside the display window; empty where it does not."""
        part = self.part(key)
        (x0, y0), (x1, y1) = (tuple(map(int, corner)) for corner in part.header["dataWindow"])
        left, top, height, width = part.display
        if x0 < left + width and x1 >= left and y0 < top + height and y1 >= top:
            return ""
        shown = f"{left}, {top} to {left + width - 1}, {top + height - 1}"
        return f"the data window of {key} ({x0}, {y0} to {x1}, {y1}) lies outside the display window ({shown})"

    def lossy(self, keys: Iterable[str]) -> list[str]:
        """Those of the channels that are packed with losses that blur edges: halves by B44, and colours by DWAA."""
        found = []
        for key in keys:
            packing = getattr(self.part(key).header.get("compression"), "name", "")
            dct = packing.startswith("DWA") and key.rpartition(".")[2] in DCT
            found += [key] if dct or (packing.startswith("B44") and self.is_half([key])) else []
        return found

    def is_half(self, keys: Iterable[str]) -> bool:
        """Whether all of the channels hold halves."""
        return all(self.pixels(key).dtype == np.float16 for key in keys)

    def layers_of(self, names: Iterable[str], *, any_case: bool = False) -> tuple[str, ...]:
        """What stands before each of the channels of one number that ``names`` fit; see `find`."""
        found = [base for name in names for base in self._bases(name, "", whole=True, any_case=any_case)]
        return tuple(dict.fromkeys(self.layer_of(key) for key in found))

    def layer_of(self, key: str) -> str:
        """What stands before the layer's own name in a channel's name, such as a view layer.

        Empty where it has nothing else, and no other layer has that name: then it is a part of that name, as in
        Mitsuba's ``dd.y.T``.
        """
        layer, _, own = key.rpartition(".")[0].rpartition(".")
        beside = (name.startswith(f"{layer}.") and not name.startswith(f"{layer}.{own}.") for name in self.names)
        alike = (name != key and name.endswith(key.removeprefix(layer)) for name in self.names)
        return layer if layer and (any(beside) or any(alike)) else ""

    def passes_in(self, layer: str) -> int:
        """How many layers have names that begin with ``layer`` and a dot, such as passes of a view layer."""
        return sum(base.startswith(f"{layer}.") for base in self.groups())

    def stack(self, keys: Sequence[str], size: tuple[int, int] | None = None) -> Tensor:
        """``(1, C, H, W)`` float32 of those channels over the whole picture.

        What overscan has beyond it is left out; where a crop ends before it there are zeros, as in files that are not
        cropped.

        Raises:
            ValueError: they are not of ``size``.
        """
        planes = []
        for key in keys:
            part, name = self._parts[key]
            if size is not None and part.whole != size:
                raise ValueError(
                    f"{self.path} must have layers of one size, but {key} is {part.whole[1]}x{part.whole[0]} and depth "
                    f"{size[1]}x{size[0]}; save them at one size"
                )
            planes.append(_placed(part, part.channels[name]))
        return torch.from_numpy(np.stack(planes))[None]

    def _seen(self, name: str, part: Part) -> str:
        """A channel's full name without the first view's; empty for those of other views."""
        if not self.views:
            return name
        words = name.split(".")
        view = part.header.get("view", next((word for word in words[:-1] if word in self.views), self.views[0]))
        return ".".join(word for word in words if word != view) if view == self.views[0] else ""

    def _bases(self, name: str, layer: str, *, whole: bool, any_case: bool, joint: str = ".") -> list[str]:
        """What ``name`` stands for: ``whole`` names, or what comes before the last dot."""
        bases = self.names if whole else tuple(dict.fromkeys(n.rpartition(".")[0] for n in self.names))
        spelled = str.casefold if any_case else str
        fits = lambda base, wanted: fnmatchcase(spelled(base), spelled(wanted))
        if name.startswith("."):
            return [base for base in bases if fits(base, name[1:])]
        found = [b for b in bases if fits(b, name) or (name and fits(b, f"*{joint}{name}"))]
        if whole and "*" in name:  # any letter: the first of a layer, whatever the order in the file
            found.sort(key=lambda b: ORDER.find(b.rpartition(".")[2]) % len(ORDER))
        inside = [b for b in found if layer and b.startswith(f"{layer}.")]
        return inside if layer else found


def _full(part: Part, name: str, parts: Sequence[Part]) -> str:
    """A channel's name with that of its part, where it does not carry it; the only part of a file needs none.

    The name of a part's view is left out: Nuke calls the part with the left eye's depth ``depth_left`` or, as later
    versions do with a single view too, ``depth.left``.
    """
    alone = sum(other.of_pass == part.of_pass for other in parts) == 1
    view = part.header.get("view", "")
    own = part.name.removesuffix(f"_{view}").removesuffix(f".{view}")
    return name if alone or not own or name.startswith(f"{own}.") else f"{own}.{name}"


def _dotted(name: str, names: Container[str]) -> str:
    """A channel's name with a dot before the letter of its axis, where it is one of three that lack it."""
    base, axis = name[:-1], name[-1:]
    axes = next((some for some in ("xyz", "XYZ") if axis and axis in some), "")
    vector = base and not base.endswith(".") and axes and all(base + letter in names for letter in axes)
    return f"{base}.{axis}" if vector and f"{base}.{axis}" not in names else name


def _views(parts: Sequence[Part]) -> tuple[str, ...]:
    """The views of a file, as its parts or its first header name them; none where there is but one."""
    named = [str(view) for part in parts for view in (part.header.get("multiView") or ())]
    named += [str(part.header["view"]) for part in parts if part.header.get("view")]
    found = tuple(dict.fromkeys(named))
    return found if len(found) > 1 else ()


def _placed(part: Part, pixels: np.ndarray) -> np.ndarray:
    """A channel as float32 over the whole picture."""
    left, top, height, width = part.display
    x, y = (int(v) for v in part.header["dataWindow"][0])
    if (x, y, *part.size) == (left, top, height, width):
        return pixels.astype(np.float32)
    whole = np.zeros((height, width), np.float32)
    (x0, x1), (y0, y1) = (
        (max(low, start), min(low + size, start + count))
        for low, size, start, count in ((left, width, x, part.size[1]), (top, height, y, part.size[0]))
    )
    if x0 < x1 and y0 < y1:
        whole[y0 - top : y1 - top, x0 - left : x1 - left] = pixels[y0 - y : y1 - y, x0 - x : x1 - x]
    return whole
