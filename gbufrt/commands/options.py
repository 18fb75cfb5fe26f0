"""What the commands have in common on the command line. Imports no torch, so that help is quick."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

Without = Annotated[tuple[str, ...], Parameter(negative="")]
Flag = Annotated[bool, Parameter(negative="")]


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class PassOptions:
    """Which passes run, and how."""

    preset: str | None = None
    """low, medium, high or ultra. [default: high]"""

    composite: str | None = None
    """physical, or me1 for the formula of the original. [default: physical]"""

    without: Without = ()
    """Stage to leave out, such as gi or gi.accumulate; may be repeated, or name several with commas."""

    set: Without = ()
    """Tunable to change, as NAME=VALUE (gtao.radius=2.0); may be repeated. `gbufrt passes` lists the names."""

    warmup: int | None = None
    """Times that the passes run over the first frame, taken as standing still, to fill their history. [default: 3]"""

    debug: Flag = False
    """Also write a picture of every channel and signal, and one sheet of them all, under OUT/debug."""

    device: str = "cpu"
    """cpu, or cuda where there is a CUDA device."""

    config: Path | None = None
    """TOML file with options by their names here; [set] may be a table. The command line wins."""


def parse_size(text: str) -> tuple[int, int]:
    """``WxH`` as ``(H, W)``.

    Raises:
        ValueError: not two whole numbers of at least 1, or a picture larger than an EXR file may be read back.
    """
    from gbufrt.files.guard import MAX_PIXELS

    width, _, height = text.lower().partition("x")
    sides = [int(n) for n in (width, height) if n.isascii() and n.isdecimal() and len(n) < 9]
    if len(sides) != 2 or min(sides) < 1:
        raise ValueError(f"--size must be WIDTHxHEIGHT, both at least 1, such as 960x540; got {text!r}")
    if sides[0] * sides[1] > MAX_PIXELS:
        raise ValueError(f"--size {text} has more than {MAX_PIXELS} pixels; choose a smaller one")
    return sides[1], sides[0]


def at_least(option: str, value: float, low: float) -> None:
    """Raise ValueError where a number is too small, or not a number."""
    if not low <= value < float("inf"):
        raise ValueError(f"{option} must be {low:g} or more, got {value:g}")


def parse_names(values: Iterable[str]) -> tuple[str, ...]:
    """Names that may have been joined by commas."""
    return tuple(name.strip() for value in values for name in value.split(",") if name.strip())


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
        fits, wanted = isinstance(value, (int, float)), "a number"
        value = float(value) if fits else value
    elif isinstance(present, int):
        fits, wanted = isinstance(value, int), "a whole number"
    elif isinstance(present, str):
        fits, wanted = isinstance(value, str), "text"
    elif isinstance(present, (tuple, list)):
        fits, wanted = isinstance(value, (tuple, list)), f"a list of {len(present)}"
        value = tuple(value) if fits else value
    else:
        return value
    if not fits:
        raise ValueError(f"--set {name} must be {wanted} (it is {present!r} now), got {value!r}")
    return value


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
