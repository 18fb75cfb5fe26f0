"""Options that the commands share. Does not import torch, so that help is quick."""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter, Token

MOST_FRAMES = 1_000_000
MOST_WARMUP = 4096  # runs: after so many the noise repeats
MOST_COUNT = 1 << 20  # of samples, steps and whatever else a tunable counts
FOG_UNITS = 100  # world units over which --fog takes its share
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


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class PassOptions:
    """Which passes run, and how."""

    pipeline: str | None = None
    """me1, which adds screen-space light to direct light; or minecraft-rtx, which cleans and upscales light of one path
    a pixel. [default: me1]"""

    preset: str | None = None
    """low, medium, high or ultra. [default: high]"""

    composite: str | None = None
    """physical, or me1 for the formula of the original. [default: physical]"""

    without: Without = ()
    """Stage to leave out, such as gi or gi.accumulate; may be repeated, or name several with commas."""

    set: Without = ()
    """Tunable to change, as NAME=VALUE (gtao.radius=2.0); may be repeated. `gbufrt passes` lists the names."""

    status: str | None = None
    """blindness or darkness: sight ends after 5 or 15 world units, and exposure pulses in darkness. [default: none]"""

    ui: Path | None = None
    """Picture with alpha (PNG), as large as the frames, to lay over them last: --set ui.picture=FILE."""

    warmup: Whole | None = None
    """Times that the passes run over the first frame, taken as standing still, to fill their history.
    [default: 3; minecraft-rtx: 15, each with paths of its own]"""

    debug: Flag = False
    """Also write a picture of every channel and signal, and one sheet of them all, under OUT/debug."""

    device: str = "cpu"
    """cpu, or cuda where there is a CUDA device."""

    config: Path | None = None
    """TOML file with options by their names here; [set] may be a table. The command line wins."""


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class ClusterOptions:
    """Whether the work is spread over processes and machines."""

    cluster: str | None = None
    """Spread the work: local for processes here, or HOST:PORT of a Ray cluster that this machine is part of."""

    workers: Whole | None = None
    """Most worker processes of --cluster; they share its cores. [default: one a core, or per OMP_NUM_THREADS]"""


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class PartOptions:
    """Which part of a Minecraft world is taken, and its textures."""

    box: Numbers = None
    """Blocks of a Minecraft world to take, as X0,Y0,Z0,X1,Y1,Z1, the last three not included."""

    around: Numbers = None
    """Place X,Z in a Minecraft world round which chunks are taken. [default: the player's, else the middle]"""

    chunks: Whole | None = None
    """How many chunks along each side are taken. [default: all of a .mca file, 24 of a save folder]"""

    window: Whole | None = None
    """Chunks along each side that are in memory at once: they follow the camera over a region or a save of any size,
    and haze hides their border. Such a world has the view flight. [default: the whole part is loaded]"""

    pack: str | None = None
    """Resource pack (jar, zip or folder) with textures for the blocks of a Minecraft world or a schematic."""

    def parsed(self) -> dict[str, Any]:
        """The part as arguments of `tracer.load`, or of `tracer.stream` with a window; those that are given.

        Raises:
            ValueError: not as many whole numbers as wanted.
        """
        part = {
            "box": _numbers("--box", self.box, "X0,Y0,Z0,X1,Y1,Z1"),
            "around": _numbers("--around", self.around, "X,Z"),
            "chunks": self.chunks,
            "window": self.window,
            "pack": self.pack,
        }
        return {name: value for name, value in part.items() if value is not None}


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class FogOptions:
    """Fog."""

    fog: float | None = None
    """Share of light that fog takes over 100 world units, below 1: 0.3 is thin, 0.9 makes rooms glow.
    [default: none]"""

    fog_height: float | None = None
    """With --fog: world units over which it thins to 0.37 of itself, from the first camera up. [default: even]"""

    def parsed(self) -> dict[str, float] | None:
        """``extinction`` and ``falloff`` of `tracer.Fog`; None without fog.

        Raises:
            ValueError: a share or height that makes no sense, or a height without fog.
        """
        if self.fog is None:
            if self.fog_height is not None:
                raise ValueError("--fog-height needs --fog")
            return None
        if not 0.0 <= self.fog < 1.0:
            raise ValueError(f"--fog must be at least 0 and below 1, got {self.fog:g}")
        if self.fog_height is not None:
            at_least("--fog-height", self.fog_height, 0.1)
        falloff = 0.0 if self.fog_height is None else 1 / self.fog_height
        return {"extinction": -math.log(1 - self.fog) / FOG_UNITS, "falloff": falloff}


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class DayOptions:
    """The time of day, and the weather."""

    hour: float | None = None
    """Hour of the day, 0 to 24, whose sun or moon and sky the world gets; lamps light the night. [default: its own]"""

    day: float | None = None
    """With --hour: days since a full moon; 14.8 is a night without moon. [default: 0]"""

    sun_path: str | None = None
    """With --hour: ZENITH,AZIMUTH, degrees that noon's sun stands off the zenith, and off -z. [default: 30,12]"""

    rain: float | None = None
    """How hard it rains, 0 to 1: grey sky, haze, and what is under the open sky wet. [default: not at all]"""

    waves: float | None = None
    """Height of waves on water over its mean, world units, 0 to 0.45, such as 0.1. [default: still water]"""

    def parsed(self) -> dict[str, Any] | None:
        """Arguments of `tracer.at_hour`, ``path`` as two numbers; None where the world keeps its own sun.

        Raises:
            ValueError: an hour that no day has, other numbers than two, what goes with an hour without one, or
                rain or waves that cannot be.
        """
        if self.rain is not None and not 0.0 <= self.rain <= 1.0:
            raise ValueError(f"--rain must lie in 0..1, got {self.rain:g}")
        if self.waves is not None and not 0.0 <= self.waves <= 0.45:
            raise ValueError(f"--waves must lie in 0..0.45, got {self.waves:g}")
        if self.hour is None:
            for option, value in (("--day", self.day), ("--sun-path", self.sun_path)):
                if value is not None:
                    raise ValueError(f"{option} needs --hour")
            return None
        if not 0.0 <= self.hour <= 24.0:
            raise ValueError(f"--hour must lie in 0..24, got {self.hour:g}")
        if self.day is not None:
            at_least("--day", self.day, 0, 1_000_000)
        path = self.sun_path and _finite(self.sun_path, 2)
        if path == () or (path and not (abs(path[0]) <= 90 and abs(path[1]) <= 360)):
            raise ValueError(f"--sun-path must be ZENITH,AZIMUTH, degrees up to 90 and 360, got {self.sun_path!r}")
        given = {"hour": self.hour, "day": self.day, "path": path}
        return {name: value for name, value in given.items() if value is not None}


def _finite(text: str, count: int) -> tuple[float, ...]:
    """So many finite numbers joined by commas; none where it is anything else."""
    try:
        numbers = tuple(map(float, text.split(",")))
    except ValueError:
        return ()
    return numbers if len(numbers) == count and all(map(math.isfinite, numbers)) else ()


def _numbers(option: str, text: str | None, form: str) -> tuple[int, ...] | None:
    """Whole numbers joined by commas, as many as ``form`` names."""
    if text is None:
        return None
    words = [word.strip() for word in text.split(",")]
    if len(words) != len(form.split(",")) or not all(re.fullmatch(r"-?\d{1,8}", word) for word in words):
        raise ValueError(f"{option} must be {form} in whole blocks, got {text!r}")
    return tuple(int(word) for word in words)


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class FileOptions:
    """What is written, and how."""

    precision: str | None = None
    """half rounds colours in the EXR, before the passes see them; float keeps all. [default: half; post: the files']"""

    compression: str = "zip"
    """zip, or dwaa, which loses what is hard to see of the coloured results, and nothing else."""

    only: Without = ()
    """Channel or signal to keep in the EXR, such as image,ao,depth; by default all. See `gbufrt passes` for names."""

    bits: Whole = 8
    """8 or 16: of the PNG."""

    video: Path | None = None
    """Also encode all frames as this video: .mp4 (H.264) or .mov (ProRes), tagged BT.709."""


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


def parse_point(option: str, text: str | None) -> tuple[float, float, float] | None:
    """``X,Y,Z`` as three finite numbers; None stays None.

    Raises:
        ValueError: anything else.
    """
    if text is None:
        return None
    if not (point := _finite(text, 3)):
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
