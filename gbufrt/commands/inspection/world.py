"""What a file of voxels or blocks holds, from its tables alone."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console

    from tracer.formats.minecraft.nbt import Tags


def show_world(console: Console, path: Path) -> None:
    """Print kind, size, version and contents.

    Raises:
        ValueError: the file is damaged, or a folder is no save.
    """
    from rich.markup import escape

    ending = "" if path.is_dir() else path.suffix.lower()
    facts = _vox(path) if ending == ".vox" else _blocks(path) if ending in ("", ".mca") else _schematic(path)
    console.print(f"[bold]{escape(str(path))}[/bold]: {escape(facts)}", soft_wrap=True)


def _vox(path: Path) -> str:
    from tracer.formats.vox.chunks import read_chunks

    data = path.read_bytes()
    chunks = read_chunks(data, str(path))
    sizes = sorted((model.size for model in chunks.models), key=math.prod)
    largest = f"{'the largest ' if len(sizes) > 1 else ''}{' x '.join(map(str, sizes[-1]))}" if sizes else "empty"
    filled = sum(len(model.voxels) for model in chunks.models)
    return (
        f"MagicaVoxel {int.from_bytes(data[4:8], 'little')}, {_count(len(sizes), 'model')}, {largest}, the last number "
        f"upwards; {filled} voxels, {_count(len(chunks.materials), 'material')}"
    )


def _schematic(path: Path) -> str:
    from tracer.formats.minecraft.nbt import part
    from tracer.formats.minecraft.schematic import root_of, structure_sides

    tags = root_of(path)
    try:
        if (found := structure_sides(tags)) is not None:
            return _structure(tags, found)
        sides = " x ".join(str(int(part(tags, side, int)) & 0xFFFF) for side in ("Width", "Height", "Length"))
        kind = f"Sponge schematic {int(part(tags, 'Version', int))}" if "Version" in tags else "MCEdit schematic"
        told = int(part(tags, "DataVersion", int)) if "DataVersion" in tags else None
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    data = "" if told is None else f", Minecraft's data version {told}"
    return f"{kind}, {sides} blocks, the middle number upwards{data}"


def _structure(tags: Tags, shape: list[int]) -> str:
    """A Litematica schematic or a structure of the game, of sides along y, z and x."""
    height, length, width = shape
    told = tags.get("MinecraftDataVersion", tags.get("DataVersion"))
    kind = "Litematica schematic" if "Regions" in tags else "Minecraft structure"
    data = f", Minecraft's data version {int(told)}" if isinstance(told, int) else ""
    return f"{kind}, {width} x {height} x {length} blocks, the middle number upwards{data}"


def _blocks(path: Path) -> str:
    from tracer.formats.minecraft.region import Region, region_files
    from tracer.formats.minecraft.save import WIDTH
    from tracer.formats.minecraft.sections import level_of, version_of

    regions = [Region.of(file) for file in region_files(path)]
    places = [place for region in regions for place in region.sectors]
    kind = "Minecraft save" if path.is_dir() else "Minecraft region"
    if not places:
        return f"{kind}, empty: no chunk was ever saved in {_count(len(regions), 'file')}; there is nothing to render"
    (x0, z0), (x1, z1) = (tuple(end(axis) for axis in zip(*places, strict=True)) for end in (min, max))
    first = next(region for region in regions if region.sectors)
    place = next(iter(first.sectors))
    try:
        chunk = first.chunk(place)
        version = version_of(chunk) or "from before 1.9"
    except ValueError as error:
        version = f"not known, because chunk {place[0]},{place[1]} cannot be read ({error})"
    else:
        try:
            level_of(chunk)
        except ValueError as error:
            raise ValueError(f"{first.path}: {error}") from None
    return (
        f"{kind}, data version {version}, {_count(len(places), 'chunk')} in {_count(len(regions), 'file')}, in x "
        f"{x0 * WIDTH}..{(x1 + 1) * WIDTH} and z {z0 * WIDTH}..{(z1 + 1) * WIDTH}"
    )


def _count(count: int, what: str) -> str:
    return f"{count} {what}{'' if count == 1 else 's'}"
