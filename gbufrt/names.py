"""Names that people type: what a short one stands for, and what a wrong one may have meant. Does not import torch."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from difflib import SequenceMatcher, get_close_matches

MOST = 4  # names that a message proposes


def meant(name: str, known: Iterable[str]) -> str:
    """``" (did you mean x?)"`` where a known name is like this one, else nothing."""
    near = get_close_matches(name, list(known), n=MOST)
    return f" (did you mean {' or '.join(near)}?)" if near else ""


def unknown(what: str, name: str, where: str, known: Iterable[str]) -> str:
    """The message about a name that is not there: what it may have meant, and all that there are."""
    known = list(known)
    return f"no {what} {name!r} in {where}{meant(name, known)}; it has {', '.join(known)}"


def resolve(name: str, kinds: Mapping[str, str]) -> str:
    """The full dotted name of a tunable.

    Args:
        name: in full, or an unambiguous tail of it; a pass may go by its class's name in lower case.
        kinds: class of the pass that has the tunable, by the tunable's full name.

    Raises:
        ValueError: no such tunable, or a tail that fits several.
    """
    if name in kinds:
        return name
    found = []
    for full, kind in kinds.items():
        path, _, key = full.rpartition(".")
        alias = f"{kind.lower()}.{key}"
        if full.endswith("." + name) or name == alias or f"{path.rpartition('.')[0]}.{alias}" == name:
            found.append(full)
    if len(found) == 1:
        return found[0]
    if found:
        raise ValueError(f"tunable {name!r} is ambiguous: {', '.join(found)}")
    near = get_close_matches(_key(name), {_key(full) for full in kinds})
    likely = [full for full in kinds if _key(full) in near]
    likely.sort(key=lambda full: -SequenceMatcher(None, name, full).ratio())
    raise ValueError(f"no tunable {name!r}" + (f"; did you mean {', '.join(likely[:MOST])}?" if likely else ""))


def _key(full: str) -> str:
    return full.rpartition(".")[2]
