"""A profile: what a renderer calls its channels, and what it means by them."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, fields
from pathlib import Path

SHIPPED = ("blender", "mitsuba")
CHOICES = {"up": ("y", "z"), "depth_kind": ("planar", "ray")}


@dataclass(frozen=True, kw_only=True)
class Profile:
    """Names are the ends of channel names, before ``.X`` or ``.R`` where they hold several numbers."""

    channels: dict[str, list[str]]
    """Names to try for each of depth, normal, motion, albedo and roughness."""
    up: str = "y"
    """Which world axis points up: y or z, right-handed."""
    depth_kind: str = "planar"
    """planar z, or the distance along the ray."""
    sky: float = float("inf")
    """The depth where nothing was hit."""
    motion_scale: tuple[float, float] = (1.0, 1.0)
    """Factors that turn X and Y of motion to previous minus current, in pixels, y down."""
    direct: tuple[tuple[str, ...], ...] = ()
    """Products of layers whose sum is the direct light with emission and sky."""
    finished: tuple[str, ...] = ()
    """Layers with all light in them, bounces included."""


def load_profile(name: str | Path) -> Profile:
    """A shipped profile by name, or a user's own by its path.

    Raises:
        ValueError: there is no such profile, it is not TOML, or a key or value is unknown.
    """
    path = Path(__file__).parent / f"{name}.toml" if name in SHIPPED else Path(name)
    if not path.is_file():
        raise ValueError(f"profile must be one of {', '.join(SHIPPED)} or a TOML file, got {str(name)!r}")
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"{path} is not a TOML file: {error}") from error
    unknown = table.keys() - {field.name for field in fields(Profile)}
    if unknown or "depth" not in table.get("channels", {}):
        raise ValueError(
            f"{path} must have channels.depth and no unknown keys, got {', '.join(sorted(unknown or table))}"
        )
    for key, choices in CHOICES.items():
        if table.get(key, choices[0]) not in choices:
            raise ValueError(f"{path}: {key} must be {' or '.join(choices)}, got {table[key]!r}")
    return Profile(**table)
