"""A profile: what a renderer calls its channels, and what it means by them."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from gbufrt.names import meant

FOLDER = Path(__file__).parent / "profiles"
SHIPPED = ("blender", "mitsuba", "pbrt", "falcor", "unreal", "nuke", "houdini", "arnold", "renderman", "generic")
AUTO = "auto"  # a setting that is left to the pixels
CHANNELS = {
    "depth": 1,
    "position": 3,
    "normal": 3,
    "motion": 2,
    "motion_next": 2,
    "albedo": 3,
    "roughness": 1,
    "metallic": 1,
    "emission": 3,
}
"""What a profile may name, and how many numbers a pixel has. Positions, in the world or in the camera's space, tell
depth where it is missing. Motion to the next frame serves where that to the one before is missing. Emission is a part
of the direct light."""
CHOICES = {
    "up": ("y", "z", "auto"),
    "handed": ("right", "left"),
    "depth_kind": ("planar", "ray", "device", "reciprocal", "normalised", "auto"),
    "normal_space": ("world", "opengl", "opencv", "pbrt", "auto"),
    "motion_unit": ("pixels", "uv"),
    "motion_target": ("previous", "next"),
    "albedo_space": ("linear", "srgb"),
}


@dataclass(frozen=True, kw_only=True)
class Profile:
    """Names are of layers or of channels (``Depth.Z``), from the start or after a dot; with a dot before them (``.Z``)
    from the start alone. ``*`` stands for anything."""

    channels: Mapping[str, tuple[str, ...]]
    """Names to try for each of `CHANNELS`; depth or position must be there."""
    positions_first: bool = False
    """Positions tell depth better than the channel of depth, where the camera is known."""
    header: Mapping[str, str] = field(default_factory=dict)
    """Header attributes that only this renderer writes, and the text that each must contain."""
    marked: bool = False
    """Files without them are not guessed to be this renderer's, as other programs use its names too."""
    layer: str = ""
    """What stands before the names, such as a view layer; by default that of the first depth."""
    any_case: bool = False
    """Capitals and small letters of names are the same."""
    up: str = "y"
    """Which world axis points up: y, z, or auto: the one with which normals agree with depth best."""
    handed: str = "right"
    """right, or left: then the world is mirrored in its y axis (z up) or its z axis (y up)."""
    depth_scale: float = 1.0
    """Factor on depth as the file has it: -1 where it counts down, 0.01 for centimetres, which then holds for the
    camera in the file too."""
    either_sign: bool = False
    """Depth may count down too: its sign is that of most pixels."""
    depth_kind: str = "planar"
    """planar z, the length of the ray, device depth between near and far, planar z as a share of the way from near to
    far (normalised), 1 / z (reciprocal), or auto: the one of planar, ray and reciprocal by which what is flat is
    flattest."""
    near: float = 0.1
    """Planar depth of the near plane, for device and normalised depth."""
    far: float = 1000.0
    """Planar depth of the far plane, for device depth, where inf is allowed, and normalised depth."""
    reversed: bool = False
    """Device or normalised depth is 1 at the near plane and 0 at the far plane."""
    sky: float = float("inf")
    """What depth holds where nothing was hit; what is larger is sky too. 65504, the largest half, gives way where
    float depths of surfaces are larger, and any to a larger depth far beyond all else that many pixels share."""
    normal_space: str = "world"
    """world, opengl (x right, y up, z to the viewer), opencv (x right, y down, z forward), pbrt (x right, y up, z
    forward, as RenderMan's and Mantra's cameras), or auto: the one by which normals agree with depth best."""
    normal_scale: tuple[float, ...] = (1.0, 1.0, 1.0)
    """Factors on x, y and z of normals, before their axes are converted."""
    normal_encoded: bool | str = False
    """Normals are stored in [0, 1], as (n + 1) / 2: true, false, or auto by their lengths."""
    motion_offset: tuple[float, ...] = (0.0, 0.0)
    """What X and Y of motion hold where nothing moves; it is taken off first."""
    motion_scale: tuple[float, ...] = (1.0, 1.0)
    """Factors on X and Y of motion that make y point down, and its difference the target's place minus this one."""
    motion_unit: str = "pixels"
    """pixels, or uv: parts of the picture's width and height."""
    motion_target: str = "previous"
    """The frame that motion leads to. Motion to the next frame is negated, as if it were even over three frames."""
    motion_fitted: bool | str = False
    """How the file counts motion is not known: it is read with the factors by which most of it fits the cameras, and
    left out where there are none; auto: read as it is said here unless others fit, and where nothing tells."""
    shaded: tuple[str, ...] | None = None
    """Colours that shaders write together with roughness. Where these, as far as there are any, and roughness are 0,
    the shader has written neither, and the surface counts as rough. By default roughness 0 is a mirror."""
    seldom: tuple[str, ...] = ()
    """Channels that few of the files have: a file without them fits no less."""
    albedo_space: str = "linear"
    """linear, or srgb: encoded for display."""
    direct: tuple[tuple[str, ...], ...] = ()
    """Products of layers whose sum is the direct light with emission and sky."""
    emitted: tuple[str, ...] = ()
    """Layers of ``direct`` that no surface reflects: emission and sky. They alone do not count as direct light."""
    mirrors: tuple[str, ...] = ()
    """Layers of ``direct`` that hold sky and lamps as mirrors show them: with them reflections add surfaces alone."""
    transmitted: tuple[tuple[str, ...], ...] = ()
    """Pairs of layers: colour of what surfaces let through, and of what they scatter, which alone is their albedo."""
    environment_turn: float = 0.0
    """Degrees by which lat-long skies of this renderer are to be turned, to the right, for those of `gbufrt`."""
    finished: tuple[str, ...] = ()
    """Layers with all light in them, bounces included; the empty name is the picture without a layer."""

    @property
    def normals_turn(self) -> bool:
        """Whether normals turn with the camera, so that they serve where nobody knows its pose."""
        return self.normal_space not in ("world", AUTO)

    @property
    def is_open(self) -> bool:
        """Whether it leaves the kind of depth or the space of normals to the pixels; see `settle.settled`."""
        return AUTO in (self.depth_kind, self.normal_space, self.up)


def load_profile(name: str | Path) -> Profile:
    """A shipped profile by name, or a user's own by its path.

    In a file of one's own ``base = "nuke"`` takes what it leaves out, channels one by one, from that shipped profile.

    Raises:
        ValueError: there is no such profile, it is not TOML, or a key or value is unknown or of a wrong type.
    """
    path = FOLDER / f"{name}.toml" if name in SHIPPED else Path(name)
    if not path.is_file():
        known = f"{AUTO}, {', '.join(SHIPPED)} or a TOML file"
        raise ValueError(f"profile must be one of {known}, got {str(name)!r}{meant(str(name), SHIPPED)}")
    table = _on_its_base(path, read_toml(path))
    known = [f.name for f in fields(Profile)]
    for key in table:
        if key not in known:
            raise ValueError(f"{path}: unknown key {key!r}; known are base, {', '.join(known)}")
    values = {key: _value(path, key, value) for key, value in table.items()}
    if not any(values.get("channels", {}).get(name) for name in ("depth", "position")):
        raise ValueError(f"{path} must name its depth: write a table [channels] with depth or position = [NAMES]")
    profile = Profile(**values)
    if not 0 < profile.near < profile.far:
        raise ValueError(f"{path}: near and far must satisfy 0 < near < far, got {profile.near:g} and {profile.far:g}")
    return profile


def _on_its_base(path: Path, table: dict[str, Any]) -> dict[str, Any]:
    """The table with what it lacks taken from the shipped profile that it names."""
    base = table.pop("base", None)
    if base is None:
        return table
    if base not in SHIPPED:
        raise ValueError(f"{path}: base must be one of {', '.join(SHIPPED)}, got {base!r}")
    below = read_toml(FOLDER / f"{base}.toml")
    channels = table.get("channels", {})
    merged = below["channels"] | channels if isinstance(channels, dict) else channels
    return below | table | {"channels": merged}


def read_toml(path: Path) -> dict[str, Any]:
    """A TOML file.

    Raises:
        ValueError: it cannot be read as TOML.
    """
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"{path} is not a TOML file: {error}") from error


def is_number(value: Any) -> bool:
    """Whether a TOML value is a number, nan apart."""
    return isinstance(value, int | float) and not isinstance(value, bool) and value == value


def _is_names(value: Any) -> bool:
    return isinstance(value, list) and all(isinstance(v, str) for v in value)


def _are_names(value: Any) -> bool:
    return isinstance(value, list) and all(map(_is_names, value))


def _tuples(value: list[list[str]]) -> tuple[tuple[str, ...], ...]:
    return tuple(map(tuple, value))


def _value(path: Path, key: str, value: Any) -> Any:
    """The value as `Profile` holds it."""
    if key in CHOICES:
        if value not in CHOICES[key]:
            raise ValueError(f"{path}: {key} must be {' or '.join(map(repr, CHOICES[key]))}, got {value!r}")
        return value
    if key == "channels" and isinstance(value, dict):
        for name in value:
            if name not in CHANNELS:
                raise ValueError(f"{path}: unknown channel {name!r}; known are {', '.join(CHANNELS)}")
    what, fits, make = _SHAPES[key]
    if not fits(value):
        raise ValueError(f"{path}: {key} must be {what}, got {value!r}")
    return make(value)


def _numbers(count: int) -> Callable[[Any], bool]:
    return lambda v: isinstance(v, list) and len(v) == count and all(map(is_number, v))


_SHAPES: dict[str, tuple[str, Callable[[Any], bool], Callable[[Any], Any]]] = {
    "channels": (
        "a table of lists of names",
        lambda v: isinstance(v, dict) and all(map(_is_names, v.values())),
        lambda v: {name: tuple(names) for name, names in v.items()},
    ),
    "header": ("a table of texts", lambda v: isinstance(v, dict) and all(isinstance(t, str) for t in v.values()), dict),
    "layer": ("a text", lambda v: isinstance(v, str), str),
    "direct": ("a list of lists of names", lambda v: _are_names(v) and all(v), _tuples),
    "transmitted": ("a list of pairs of names", lambda v: _are_names(v) and all(len(w) == 2 for w in v), _tuples),
    **dict.fromkeys(("finished", "shaded", "seldom", "emitted", "mirrors"), ("a list of names", _is_names, tuple)),
    **dict.fromkeys(("near", "far", "sky", "environment_turn"), ("a number", is_number, float)),
    "depth_scale": ("a number other than 0", lambda v: is_number(v) and v != 0, float),
    **dict.fromkeys(
        ("reversed", "any_case", "either_sign", "positions_first", "marked"),
        ("true or false", lambda v: isinstance(v, bool), bool),
    ),
    **dict.fromkeys(
        ("normal_encoded", "motion_fitted"),
        ("true, false or 'auto'", lambda v: isinstance(v, bool) or v == AUTO, lambda v: v),
    ),
    "normal_scale": ("three numbers", _numbers(3), tuple),
    **dict.fromkeys(("motion_offset", "motion_scale"), ("two numbers", _numbers(2), tuple)),
}
