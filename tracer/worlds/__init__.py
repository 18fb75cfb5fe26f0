"""Built-in worlds, and worlds from files, by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from os import PathLike, fspath
from pathlib import Path
from types import MappingProxyType

from gbufrt.names import no_world
from tracer.formats.vox.scene_graph import load_vox_scene
from tracer.scene.scene import Scene
from tracer.worlds.terrain import terrain
from tracer.worlds.valley import valley

__all__ = ["WORLDS", "builtin", "load", "terrain"]

builtin = valley

WORLDS: Mapping[str, Callable[..., Scene]] = MappingProxyType({"valley": valley, "terrain": terrain})
"""Built-in worlds by name; each takes ``seed``. The first is the default."""

FORMATS: Mapping[str, Callable[[Path], Scene]] = MappingProxyType({".vox": load_vox_scene})
"""Readers of files by their ending, in lower case."""


def load(name_or_path: str | PathLike[str]) -> Scene:
    """A built-in world by its name, or a file's by its path.

    Args:
        name_or_path: a name in `WORLDS`, ``builtin``, or the path of a file whose ending is in `FORMATS`.

    Raises:
        ValueError: neither a name nor a path to a file of a kind that is read, or the file is broken.
        FileNotFoundError: there is no such file.
    """
    name = fspath(name_or_path)
    if name == "builtin":
        return builtin()
    if name in WORLDS:
        return WORLDS[name]()
    path = Path(name)
    if path.suffix.lower() not in FORMATS:
        raise ValueError(no_world(name, ["builtin", *WORLDS], FORMATS))
    if not path.is_file():
        known = ", ".join(["builtin", *WORLDS])
        raise FileNotFoundError(f"{path} does not exist; check the path, or name a world: {known}")
    return FORMATS[path.suffix.lower()](path)
