"""The `gbufrt` command: one line on stderr and exit code 2 for what the user can fix, 130 when interrupted."""

from __future__ import annotations

import signal
import sys
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

from cyclopts import App, CycloptsError
from cyclopts.config import Dict

from gbufrt import __version__
from gbufrt.commands.ablate import ablate
from gbufrt.commands.arguments.mistakes import told
from gbufrt.commands.arguments.settings import load_config
from gbufrt.commands.bench import bench
from gbufrt.commands.inspect import inspect
from gbufrt.commands.passes import passes
from gbufrt.commands.post import post
from gbufrt.commands.render import render
from gbufrt.commands.video import video

INTERRUPTED = "interrupted; every file that is there is whole (render and ablate go on with --resume)"
ONCE = " (told once a pipeline)"
HELP = """From a voxel world to a finished frame: traced G-buffers, and screen-space passes over them.

Start with `gbufrt render`, which writes out/frame_0000.png and an EXR with everything in it.
"""


def build() -> App:
    """The command with its subcommands."""
    app = App(name="gbufrt", help=HELP, version=__version__, suppress_keyboard_interrupt=False)
    for command in (render, post, inspect, video, passes, bench, ablate):
        app.command(command)
    return app


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Entry point; ``arguments`` default to those of the process."""
    tokens = list(sys.argv[1:] if arguments is None else arguments)
    warnings.showwarning = _say
    interrupts, before = list[int](), signal.getsignal(signal.SIGINT)

    def interrupt(number: int, _: object) -> NoReturn:
        interrupts.append(number)
        raise KeyboardInterrupt

    if before is signal.default_int_handler:  # jobs in the background may ignore it
        signal.signal(signal.SIGINT, interrupt)
    try:
        app = build()
        config = _config(tokens)
        if config is not None:
            app.config = (Dict(load_config(config), source=str(config), use_commands_as_keys=False),)
        app(tokens, exit_on_error=False, print_error=False, result_action="return_value")
    except KeyboardInterrupt:
        _fail(INTERRUPTED, 130)
    except BrokenPipeError:  # the reader, such as `head`, has closed the pipe
        sys.stderr.close()
        sys.exit(0)
    except Exception as error:
        if interrupts:  # modules that were being imported may hide an interrupt, and lack names then
            _fail(INTERRUPTED, 130)
        if isinstance(error, CycloptsError):
            _fail(" ".join(told(error, tokens).split()), 2)
        if isinstance(error, (ValueError, TypeError, OSError, MemoryError, OverflowError)):
            _fail(" ".join(str(error).split()) or type(error).__name__, 2)
        if not isinstance(error, RuntimeError) or "memory" not in str(error):  # torch has no type of its own for this
            raise
        _fail("out of memory; try a smaller --size or preset", 2)
    finally:
        if before is signal.default_int_handler:
            signal.signal(signal.SIGINT, before)
    sys.exit(0)


def _config(tokens: list[str]) -> Path | None:
    """The value of --config, which must be known before the rest is parsed."""
    for place, token in enumerate(tokens):
        if token.startswith("--config="):
            return Path(token.partition("=")[2])
        if token == "--config" and place + 1 < len(tokens):
            return Path(tokens[place + 1])
    return None


def _say(message: Warning | str, *place: object, **more: object) -> None:
    """Warnings as one line, without the place in the code, and without what only tells programmers when."""
    print(f"gbufrt: {' '.join(str(message).removesuffix(ONCE).split())}", file=sys.stderr)


def _fail(message: str, code: int) -> NoReturn:
    print(f"gbufrt: {message}", file=sys.stderr)
    sys.exit(code)
