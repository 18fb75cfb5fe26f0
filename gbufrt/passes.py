"""Pass and TemporalPass: what a pipeline is made of.

A pass is a function from frame to frame with its tunables. A temporal pass also takes and returns its state, a plain
value that is None on the first frame.
"""

from __future__ import annotations

import inspect
from abc import ABC, abstractmethod
from typing import Any

from torch import nn

from gbufrt.frame import SIGNALS, Frame
from gbufrt.gbuffer import CHANNELS
from gbufrt.mending import contained


class Stage(nn.Module):
    """What a pass and a temporal pass have in common: what they read and write, and their tunables.

    ``reads`` must be present, ``optional`` is used where present, ``writes`` is the result. Every keyword of the
    constructor is a tunable and is kept in an attribute of the same name.
    """

    reads: frozenset[str] = frozenset()
    optional: frozenset[str] = frozenset()
    writes: frozenset[str] = frozenset()

    def tunables(self) -> dict[str, Any]:
        """The constructor's keywords with their present values."""
        return {name: getattr(self, name) for name in _keywords(type(self))}

    def tuned(self, **changes: Any) -> Stage:
        """A copy with some tunables changed.

        Raises:
            ValueError: there is no such tunable.
        """
        known = self.tunables()
        for name in changes:
            if name not in known:
                raise ValueError(f"{type(self).__name__} has no tunable {name!r}; it has {', '.join(known) or 'none'}")
        return type(self)(**{**known, **changes})

    def check(self, frame: Frame) -> None:
        """Raise ValueError if the frame lacks something that this pass reads."""
        for name in sorted(self.reads):
            if frame.get(name) is None:
                raise ValueError(f"{type(self).__name__} reads {name!r}, which the frame lacks: {_remedy(name)}")

    def extra_repr(self) -> str:
        return ", ".join(f"{name}={value!r}" for name, value in self.tunables().items())


class Pass(Stage, ABC):
    """A pass whose result depends on one frame alone."""

    def __call__(self, frame: Frame) -> Frame:
        """`forward` over a frame in which no pixel can spread NaN or infinity, see `gbufrt.mending.contained`."""
        return super().__call__(contained(frame, self.reads | self.optional))

    @abstractmethod
    def forward(self, frame: Frame) -> Frame:
        """The frame with what ``writes`` names filled in."""


class TemporalPass(Stage, ABC):
    """A pass with history: its state is a value that the caller keeps between frames."""

    def __call__(self, frame: Frame, state: Any = None) -> tuple[Frame, Any]:
        """`forward` over a frame in which no pixel can spread NaN or infinity, see `gbufrt.mending.contained`."""
        return super().__call__(contained(frame, self.reads | self.optional), state)

    @abstractmethod
    def forward(self, frame: Frame, state: Any = None) -> tuple[Frame, Any]:
        """The frame with what ``writes`` names filled in, and the state for the next frame."""


def _keywords(cls: type) -> list[str]:
    if cls.__init__ is Stage.__init__:
        return []
    return [p.name for p in inspect.signature(cls.__init__).parameters.values() if p.kind is p.KEYWORD_ONLY]


def _remedy(name: str) -> str:
    if name in CHANNELS:
        return f"give the GBuffer a {name} channel ({CHANNELS[name].meaning})"
    if name in SIGNALS:
        return f"give the Frame {name} ({SIGNALS[name].meaning}) or run a pass that writes it"
    return "run a pass that writes it"
