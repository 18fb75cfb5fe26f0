"""Values as they are typed. Does not import torch, so that help is quick."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from typing import Annotated, Any

from cyclopts import Parameter, Token

MOST_FRAMES = 1_000_000
MOST_WARMUP = 4096  # runs: after so many the noise repeats
MOST_COUNT = 1 << 20  # of samples, steps and whatever else a tunable counts
MOST = (1 << 63) - 1  # of any whole number: what 64 bits hold


def whole(kind: Any, tokens: Sequence[Token]) -> int:
    """A whole number as it was typed: 1.5 is refused rather than rounded."""
    text = tokens[0].value.strip()
    digits = text[1:] if text[:1] in ("-", "+") else text
    if not (digits.isascii() and digits.isdecimal()):
        raise ValueError(f"must be a whole number, got {text!r}")
    if len(digits) > len(str(MOST)) or abs(int(text)) > MOST:
        raise ValueError(f"must be at most {MOST}, got a number of {len(digits)} digits")
    return int(text)


Whole = Annotated[int, Parameter(converter=whole)]
Without = Annotated[tuple[str, ...], Parameter(negative="")]
Flag = Annotated[bool, Parameter(negative="")]
Numbers = Annotated[str | None, Parameter(allow_leading_hyphen=True)]  # joined by commas; the first may be negative


def finite(text: str, count: int) -> tuple[float, ...]:
    """So many finite numbers joined by commas; none where it is anything else."""
    try:
        numbers = tuple(map(float, text.split(",")))
    except ValueError:
        return ()
    return numbers if len(numbers) == count and all(map(math.isfinite, numbers)) else ()


def whole_numbers(option: str, text: str | None, form: str) -> tuple[int, ...] | None:
    """Whole numbers joined by commas, as many as ``form`` names."""
    if text is None:
        return None
    words = [word.strip() for word in text.split(",")]
    if len(words) != len(form.split(",")) or not all(re.fullmatch(r"-?\d{1,8}", word) for word in words):
        raise ValueError(f"{option} must be {form} in whole blocks, got {text!r}")
    return tuple(int(word) for word in words)


def parse_size(text: str) -> tuple[int, int]:
    """``WxH`` as ``(H, W)``.

    Raises:
        ValueError: not two whole numbers of at least 1, or a larger picture than gbufrt makes.
    """
    from gbufrt.files.output import MAX_PIXELS

    width, _, height = text.lower().partition("x")
    sides = [int(n) for n in (width, height) if n.isascii() and n.isdecimal() and len(n) < 9]
    if len(sides) != 2 or min(sides) < 1:
        raise ValueError(f"--size must be WIDTHxHEIGHT, both at least 1, such as 960x540; got {text!r}")
    if sides[0] * sides[1] > MAX_PIXELS:
        raise ValueError(f"--size {text} has more than {MAX_PIXELS} pixels; choose a smaller one")
    return sides[1], sides[0]


def parse_point(option: str, text: str | None) -> tuple[float, float, float] | None:
    """``X,Y,Z`` as three finite numbers; None stays None.

    Raises:
        ValueError: anything else.
    """
    if text is None:
        return None
    if not (point := finite(text, 3)):
        raise ValueError(f"{option} must be X,Y,Z, three numbers in world units such as 12,30,-8.5; got {text!r}")
    return point[0], point[1], point[2]


def at_least(option: str, value: float, low: float, high: float = float("inf")) -> None:
    """Raise ValueError where a number is too small, larger than ``high``, infinite, or not a number."""
    if not low <= value < float("inf"):
        raise ValueError(f"{option} must be {low:g} or more, got {value:g}")
    if value > high:
        raise ValueError(f"{option} must be at most {high}, got {value}")


def check_device(name: str) -> None:
    """Raise ValueError unless ``name`` is ``cpu``, ``cuda`` or ``cuda:N``; whether it is there only torch can tell."""
    kind, colon, number = name.partition(":")
    if kind not in ("cpu", "cuda") or (colon and (kind == "cpu" or not number.isdecimal() or len(number) > 4)):
        raise ValueError(f"--device must be cpu or cuda, got {name!r}")


def parse_names(values: Iterable[str]) -> tuple[str, ...]:
    """Names that may have been joined by commas."""
    return tuple(name.strip() for value in values for name in value.split(",") if name.strip())
