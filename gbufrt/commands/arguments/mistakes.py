"""Command lines that do not parse, told with the remedy. Does not import torch, so that they are told quickly."""

from __future__ import annotations

from collections.abc import Sequence

from cyclopts import CycloptsError, MissingArgumentError, UnusedCliTokensError

from gbufrt.commands.arguments.checks import PIPELINES, PRESETS
from gbufrt.names import meant


def told(error: CycloptsError, tokens: Sequence[str]) -> str:
    """What to say of an error of the parser over the ``tokens`` of a command line."""
    command = f"gbufrt {' '.join(error.command_chain or ())}".strip()
    if isinstance(error, UnusedCliTokensError) and error.unused_tokens:
        return _unasked(command, error.unused_tokens[0])
    if isinstance(error, MissingArgumentError) and error.keyword is None and error.argument is not None:
        return f"`{command}` needs {error.argument.name}; `{command} --help` tells what it is"
    if isinstance(error, MissingArgumentError) and error.keyword in tokens:
        following = tokens[tokens.index(str(error.keyword)) + 1 :][:1]
        if following and following[0][1:2].isdigit():
            given = f"{error.keyword}={following[0]}"
            return f"{error.keyword} needs a value; one that begins with a minus is joined to it, as in {given}"
        return f"{error.keyword} needs a value; `{command} --help` tells which"
    return str(error)


def _unasked(command: str, word: str) -> str:
    """Of a word that a command has no place for."""
    if not command.endswith(" passes"):
        return f"`{command}` has no place for {word!r}; options begin with --, see `{command} --help`"
    for option, known in (("--pipeline", PIPELINES), ("--preset", PRESETS)):
        if word in known:
            return f"`{command}` takes {word} as an option: {command} {option} {word}"
    there = f"--pipeline is one of {', '.join(PIPELINES)}, --preset one of {', '.join(PRESETS)}"
    return f"no pipeline {word!r}{meant(word, (*PIPELINES, *PRESETS))}; {there}"
