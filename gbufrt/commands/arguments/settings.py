"""Settings of passes: `--set NAME=VALUE`, and the same in a TOML file. Does not import torch."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from gbufrt.commands.arguments.values import MOST, MOST_COUNT


def parse_settings(values: Iterable[str]) -> dict[str, Any]:
    """``NAME=VALUE`` pairs; values are Python or TOML literals, anything else is text.

    Raises:
        ValueError: a pair lacks its name or its ``=``.
    """
    result = {}
    for pair in values:
        name, equals, value = pair.partition("=")
        if not equals or not name.strip():
            raise ValueError(f"--set must be NAME=VALUE, such as gtao.radius=2.0; got {pair!r}")
        result[name.strip()] = _literal(value.strip())
    return result


def fitted(name: str, value: Any, present: Any) -> Any:
    """``value`` in the type of the tunable's ``present`` value.

    Raises:
        ValueError: it does not fit.
    """
    if isinstance(present, bool) or isinstance(value, bool):
        fits, wanted = isinstance(value, bool) and isinstance(present, bool | None), "true or false"
    elif isinstance(present, float):
        fits, wanted = isinstance(value, (int, float)) and abs(value) < MOST, "a number"
        value = float(value) if fits else value
    elif isinstance(present, int):
        most = MOST if name.rpartition(".")[2] == "seed" else MOST_COUNT
        fits, wanted = isinstance(value, int) and abs(value) <= most, f"a whole number of at most {most}"
    elif isinstance(present, str):
        fits, wanted = isinstance(value, str), "text"
    elif isinstance(present, (tuple, list)):
        fits, wanted = isinstance(value, (tuple, list)), f"a list of {len(present)}"
        value = tuple(value) if fits else value
    elif isinstance(value, (int, float)):
        fits, wanted = abs(value) < MOST, "a number"
    else:
        return value
    if not fits:
        shown = repr(value) if not isinstance(value, int) or abs(value) <= MOST else "a larger one than 64 bits hold"
        raise ValueError(f"--set {name} must be {wanted} (it is {present!r} now), got {shown}")
    return value


def blamed(settings: Mapping[str, Any], error: Exception) -> str:
    """The message of an error of one pass with the settings that it comes from: those it names, or else all of them."""
    named = [name for name in settings if re.search(rf"\b{name.rpartition('.')[2]}\b", str(error))]
    return f"{' '.join(f'--set {name}={settings[name]}' for name in named or settings)}: {error}"


def load_config(path: Path) -> dict[str, Any]:
    """The options in a TOML file, with the ``set`` table turned into ``NAME=VALUE`` pairs.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is not TOML.
    """
    import tomllib

    if not path.is_file():
        raise FileNotFoundError(f"--config {path} does not exist; check the path")
    try:
        options = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"--config {path} is not TOML: {error}") from error
    if isinstance(options.get("set"), dict):
        options["set"] = [f"{name}={value!r}" for name, value in _flat(options["set"])]
    return options


def _flat(table: Mapping[str, Any], prefix: str = "") -> Iterable[tuple[str, Any]]:
    for key, value in table.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def _literal(text: str) -> Any:
    words = {"true": True, "false": False, "none": None}
    if text.lower() in words:
        return words[text.lower()]
    try:
        return ast.literal_eval(text)
    except (ValueError, SyntaxError):
        return text
