"""A line in the log where kernels compile for long and nobody else tells.

The logger is ``gbufrt``. The line is a warning, as Python shows nothing less where no logging is set up; what follows
is information. ``logging.getLogger("gbufrt").setLevel("ERROR")`` silences both.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

LOG = logging.getLogger("gbufrt")
PATIENCE = 4.0  # seconds of compiling, in all of a process, that need no word
AGAIN = 30.0  # seconds of compiling between further words
LOADED = 0.3  # seconds: in less, a kernel has been read from a cache


class Notice:
    """Counts what is compiled in a process, and says so after a while, also while a single kernel takes long.

    Args:
        patience: seconds of compiling before the first line.
        quiet: asked before a line is logged: whether others tell already.
    """

    def __init__(self, patience: float = PATIENCE, *, quiet: Callable[[], bool] = lambda: False) -> None:
        self.due, self.quiet = patience, quiet
        self.kernels, self.seconds, self.said = 0, 0.0, False

    @contextmanager
    def compiling(self) -> Iterator[None]:
        """Around the compilation of a kernel."""
        end = self.begin()
        try:
            yield
        finally:
            end()

    def begin(self) -> Callable[[], None]:
        """A kernel begins to be compiled; call what is returned when it is done."""
        begun = time.monotonic()
        timer = threading.Timer(max(self.due - self.seconds, 0.0), self._say, [begun])
        timer.daemon = True
        timer.start()

        def end() -> None:
            timer.cancel()
            taken = time.monotonic() - begun
            if taken > LOADED:
                self.seconds += taken
                self.kernels += 1

        return end

    def _say(self, begun: float) -> None:
        if self.quiet():
            return
        seconds = self.seconds + time.monotonic() - begun
        self.due = seconds + AGAIN
        if self.said:
            LOG.info("still compiling: %d kernels done, %.0f s so far", self.kernels, seconds)
            return
        self.said = True
        LOG.warning(
            "gbufrt compiles kernels, once on this machine: the first frame waits a minute or more "
            "(pipeline.compile() does so ahead)"
        )
