"""Which renderer wrote a file, and what speaks for it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from gbufrt.files.gbuffers.layers import Layers
from gbufrt.files.gbuffers.named import Named, depth_of
from gbufrt.files.gbuffers.profile import CHANNELS, SHIPPED, Profile, load_profile
from gbufrt.files.gbuffers.sequence import shot_parts
from gbufrt.files.header import ATTRIBUTE

BY_HEADER = 0.6  # certainty from an attribute that only this renderer writes
BY_NAMES = 0.4  # certainty when every channel that the profile names is there
UNCOUNTED = ("emission", "position", "motion_next")  # channels that speak for no profile; the last as motion does
DARK = 0.5  # of the certainty of others, where a profile knows none of the file's light
SOME = 12  # layers that a message names
PLAIN = 0.5  # of the certainty of others, that of plain names, which any program may write


@dataclass(frozen=True)
class Detection:
    """A profile's name, how certain it is (0 to 1), and why."""

    name: str
    certainty: float
    reasons: tuple[str, ...]
    marked: bool = field(default=False, compare=False)
    """Whether the header tells it."""
    found: frozenset[str] = field(default=frozenset(), compare=False)
    """Channels that it finds, ``direct`` light, a ``picture``, and ``own depth`` where that follows from no others."""


def detect(path: str | Path | Sequence[Path]) -> Detection:
    """The shipped profile that fits a file, or those of a frame's passes, best; reads headers only.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is damaged, gbufrt's own, or no profile finds depth in it.
    """
    files = [Path(path)] if isinstance(path, str | Path) else list(path)
    path = files[0]
    parts = shot_parts(files, header_only=True)
    if any(ATTRIBUTE in part.header for part in parts):
        raise ValueError(
            f"{path} was written by gbufrt: `gbufrt post` takes it without --from, --camera, --fov and --passes "
            "(--without leaves passes out), and gbufrt.files.exr.read_exr reads it"
        )
    layers = Layers(path, parts)
    best = _fitting(layers)
    if best.certainty == 0:
        there = [base or "".join(names) for base, names in layers.groups().items()]
        some = ", ".join(there[:SOME]) + (", ..." if len(there) > SOME else "")
        raise ValueError(
            f"{path} fits no profile ({', '.join(SHIPPED)}): none finds its depth among {some}; render depth or "
            "positions too, or write a profile that names them and pass its path with --from"
        )
    return best


def named_by(layers: Layers, profile: Profile) -> Named:
    """The channels of a file under the names of a profile.

    Raises:
        ValueError: it has no depth by that profile; says which other one fits.
    """
    try:
        return Named(layers, profile)
    except ValueError as error:
        best = _fitting(layers)
        if profile.layer or best.certainty == 0:
            raise
        raise ValueError(f"{error}: {best.name} fits ({best.reasons[0]})") from error


def better(layers: Layers, name: str) -> Detection | None:
    """A shipped profile whose mark the file's header has, where another one was named."""
    best = _fitting(layers)
    return best if name in SHIPPED and best.name != name and best.marked else None


def is_frame(path: Path, profile: str) -> bool:
    """Whether a file has depth and more: it is no pass among others."""
    try:
        name = detect(path).name if profile == "auto" else profile
        named = named_by(Layers(path, shot_parts(path, header_only=True)), load_profile(name))
    except ValueError:
        return False
    return any(named.keys(channel) for channel in CHANNELS if channel not in ("depth", "position"))


def _fitting(layers: Layers) -> Detection:
    """The shipped profile that fits best; of certainty 0 where none does.

    Plain names are taken where they find more than those of a renderer that the header does not tell: other programs
    use its names too.
    """
    weighed = {name: _weigh(name, load_profile(name), layers, layers.header) for name in SHIPPED}
    best, plain = max(weighed.values(), key=lambda detection: detection.certainty), weighed["generic"]
    return plain if plain.found > best.found and not best.marked else best


def _weigh(name: str, profile: Profile, layers: Layers, headers: Mapping[str, Any]) -> Detection:
    if not depth_of(layers, profile):
        return Detection(name, 0.0, ())
    marks = [key for key, text in profile.header.items() if key in headers and text in str(headers[key])]
    if profile.marked and not marks:
        return Detection(name, 0.0, ())
    named = Named(layers, profile)
    depth, light = named.depth, named.light()
    reasons = [f"the header has {key} = {headers[key]!r}" for key in marks] + [
        f"depth is {depth[0]}" if len(depth) == 1 else f"depth follows from {', '.join(depth)}"
    ]
    found = {"depth"}
    names_of = {name: names for name, names in profile.channels.items() if name not in UNCOUNTED}
    for channel, names in names_of.items():
        names += profile.channels.get("motion_next", ()) if channel == "motion" else ()
        keys = named.find(names, CHANNELS[channel])
        if channel != "depth" and keys:
            found.add(channel)
            reasons.append(f"{channel} is {', '.join(keys)}")
    share = min(1.0, len(found) / len(names_of.keys() - {*profile.seldom}))
    more = {"direct": light.products, "picture": light.products or light.finished, "own depth": len(depth) == 1}
    found |= {kind for kind, there in more.items() if there}
    if marks:
        return Detection(
            name, round(BY_HEADER + BY_NAMES * share, 2), tuple(reasons), marked=True, found=frozenset(found)
        )
    sure = (PLAIN if name == "generic" else 0.9) * (1 if light.products or light.finished else DARK)
    return Detection(name, round((BY_HEADER + BY_NAMES) * share * sure, 2), tuple(reasons), found=frozenset(found))
