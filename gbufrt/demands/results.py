"""Whether what stages return is what they say."""

from __future__ import annotations

from typing import Any, Protocol

from gbufrt.frame import SIGNALS, Frame


class Writer(Protocol):
    """The part of `gbufrt.Stage` that matters here."""

    writes: frozenset[str]


def returned(name: str, stage: object, result: Any, *, temporal: bool) -> tuple[Frame, Any]:
    """The frame that a stage returned and its state, None unless it is ``temporal``.

    Raises:
        TypeError: it returned something else.
    """
    found = result if temporal else (result, None)
    if isinstance(found, tuple) and len(found) == 2 and isinstance(found[0], Frame):
        return found
    wanted = "a Frame and its state" if temporal else "a Frame, such as frame.write(name, tensor)"
    raise TypeError(f"{name} ({type(stage).__name__}) must return {wanted}, got {type(result).__name__}")


def check_written(stage: Writer, given: Frame, frame: Any) -> None:
    """Raise unless a pass wrote what its ``writes`` names: nothing else, and at least one of them.

    What it does not name would be lost between stages at another size; and that the new frame was not returned is the
    commonest slip.

    Args:
        stage: the pass.
        given: the frame that it saw.
        frame: what it returned; what is no frame is left to `returned`.

    Raises:
        ValueError: it wrote another signal, or none.
    """
    if not isinstance(frame, Frame):
        return
    who, writes = type(stage).__name__, sorted(stage.writes)
    same = frame.gbuffer.depth is given.gbuffer.depth  # else the whole frame may have been to another device
    for name in (*SIGNALS, *frame.extra):
        before, after = given.get(name), frame.get(name)
        if after is not before and after is not None and name not in writes and (same or before is None):
            raise ValueError(f"{who} wrote {name!r}, which its `writes` does not name: add it there")
    if writes and all(frame.get(name) is None for name in writes):
        raise ValueError(
            f"{who} did not write {' or '.join(map(repr, writes))}, which its `writes` names: return what "
            f"frame.write({writes[0]!r}, tensor) gives, as frames do not change"
        )
