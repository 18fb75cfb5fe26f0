"""Built-in worlds, and worlds from files, by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from os import PathLike, fspath
from pathlib import Path
from types import MappingProxyType
from typing import Any

from gbufrt.names import no_world
from gbufrt.numeric import check_path
from tracer.formats.minecraft.save import Selection, read_minecraft
from tracer.formats.minecraft.schematic import load_schematic
from tracer.formats.vox.scene_graph import load_vox_scene
from tracer.scene.scene import Scene
from tracer.worlds.regions.landscape import landscape
from tracer.worlds.terrain import terrain
from tracer.worlds.valley import valley

__all__ = ["WORLDS", "builtin", "load", "terrain"]

builtin = valley

WORLDS: Mapping[str, Callable[..., Scene]] = MappingProxyType({"valley": valley, "terrain": terrain})
"""Built-in worlds by name; each takes ``seed``. The first is the default."""


def _blocks(path: Path, *, pack: str | PathLike[str] | None = None, bare: bool | None = None, **part: Any) -> Scene:
    chosen = Selection(**part)  # land that is cut within chunks has no border of bricks to be mirrored at
    blocks = read_minecraft(path, chosen if bare else chosen.in_whole_chunks(), pack)
    return landscape(blocks.world, blocks.instances, bare=bool(bare))


FORMATS: Mapping[str, Callable[..., Scene]] = MappingProxyType(
    {
        ".vox": load_vox_scene,
        **dict.fromkeys((".schem", ".schematic", ".litematic", ".nbt"), load_schematic),
        ".mca": _blocks,
    }
)
"""Readers of files by their ending, in lower case."""


def load(
    name_or_path: str | PathLike[str],
    *,
    box: tuple[int, int, int, int, int, int] | None = None,
    around: tuple[int, int] | None = None,
    chunks: int | None = None,
    pack: str | PathLike[str] | None = None,
    bare: bool = False,
) -> Scene:
    """A built-in world by its name, or a file's by its path: MagicaVoxel, Minecraft Java, or a schematic.

    Args:
        name_or_path: a name in `WORLDS`, ``builtin``, the path of a file whose ending is in `FORMATS`, or that of a
            Minecraft save folder.
        box: of a Minecraft world, the blocks from x0, y0, z0 up to x1, y1, z1, these not included; unless ``bare``,
            all of the chunks that it touches between y0 and y1, because land goes on from whole ones.
        around: of a Minecraft world, the place x, z round which chunks are taken.
        chunks: how many along each side; by default all of a region file, and 24 of a save, round its player.
        pack: of a Minecraft world or a schematic, the jar, zip or folder of a resource pack with textures.
        bare: the blocks of a Minecraft world are all there is; otherwise it goes on where the file ends, as the sea
            with waves, or as land mirrored into haze.

    Returns:
        The scene, with its sky, and views to look from.

    Raises:
        TypeError: neither a text nor a path, here or for ``pack``.
        ValueError: neither a name nor a path of such a file, a file is broken, or a part was asked of another world.
        FileNotFoundError: there is no such file.
    """
    if not isinstance(name_or_path, (str, PathLike)):
        raise TypeError(f"name_or_path must be a name or a path, got {type(name_or_path).__name__}")
    if pack is not None:
        check_path("pack", pack)
    name = fspath(name_or_path)
    part: dict[str, Any] = {"box": box, "around": around, "chunks": chunks, "bare": bare or None}
    path, builtins = Path(name), {"builtin": builtin, **WORLDS}
    read = _blocks if path.is_dir() else FORMATS.get(path.suffix.lower())
    if read is None and name not in builtins:
        raise ValueError(no_world(name, builtins, FORMATS))
    if read is not _blocks or name in builtins:
        if any(choice is not None for choice in part.values()):
            those = "box, around, chunks and bare"
            raise ValueError(f"{those} are for Minecraft regions and saves; leave them out for {name}")
        part = {}
    textured = read is not None and read is not load_vox_scene and name not in builtins
    if pack is not None and not textured:
        raise ValueError(f"pack is for Minecraft worlds and schematics; leave it out for {name}")
    if read is None or name in builtins:
        return builtins[name]()
    if not path.exists():
        raise FileNotFoundError(f"{path} does not exist; check the path, or name a world: {', '.join(builtins)}")
    return read(path, **part, pack=pack) if textured else read(path)
