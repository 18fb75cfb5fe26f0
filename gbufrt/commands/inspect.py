"""`gbufrt inspect`: what files hold, and what they are taken for."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from gbufrt.commands.arguments.checks import ENDINGS, check_folder
from gbufrt.names import REMEDIES, other_save


def inspect(
    *files: Path,
    source: Annotated[str, Parameter(name="--from")] = "auto",
    camera: Path | None = None,
    fov: float | None = None,
    layer: str = "",
    out: Path | None = None,
) -> None:
    """Print what files hold, what they are taken for, and why.

    Of an EXR file: layers with type, range of values and pixels that are not finite; who wrote it; which of gbufrt's
    channels it gives, and from what; what is missing, and what is done about it. With a camera, of the file or given,
    also whether the channels agree with each other, and the setting of the profile that would make them. Of a Minecraft
    region, save or schematic and of a .vox file: size, version, blocks.

    Args:
        files: EXR files of any program, also as patterns or folders, and worlds. Frames that count on test each other's
            motion; EXR files that share a frame number are passes of one frame.
        source: What wrote the EXR files: auto, blender, mitsuba, pbrt, falcor, unreal, nuke, houdini, arnold,
            renderman, generic, or a profile of your own in TOML.
        camera: The cameras, in TOML. [default: those that the files carry]
        fov: In place of --camera: vertical field of view in degrees of a camera that stands still.
        layer: The layer to take, such as Blender's view layers. [default: the one with most passes]
        out: Folder for a contact sheet of each EXR file: every layer as the file has it, then as gbufrt reads it.
    """
    if not files:
        raise ValueError("no files given; give EXR files or worlds")
    if camera is not None and fov is not None:
        raise ValueError("--camera and --fov exclude each other; leave one out")
    shown = _there(files)
    for file in shown:
        if not file.exists():
            raise FileNotFoundError(f"{file} does not exist; check the path")
    if out is not None:
        check_folder(out)

    known = (*ENDINGS, ".exr")
    for file in shown:
        if not file.is_dir() and file.suffix.lower() not in known:
            unread = f"of a kind that is not read; give {', '.join(known)} or a save folder"
            kind = REMEDIES.get(file.suffix.lower(), unread)
            raise ValueError(f"{file} is {kind}")

    from rich.console import Console

    from gbufrt.commands.foreign import Source
    from gbufrt.commands.inspection.exr import Inspector
    from gbufrt.commands.inspection.world import show_world

    pictures = [file for file in shown if file.suffix.lower() == ".exr"]
    inspector = Inspector(Source.named(pictures, source, camera, fov, layer))
    console = Console(highlight=False)
    first = {shot.files[0]: shot for shot in inspector.source.shots}
    for place, file in enumerate(file for file in shown if file in first or file not in pictures):
        console.print("\n" * (place > 0), end="")
        if file in first:
            inspector.show(console, first[file], out)
        else:
            show_world(console, file)


def _there(files: Iterable[Path]) -> list[Path]:
    """The files with patterns, and folders of EXR files, replaced by what is in them."""
    from gbufrt.commands.post import within
    from gbufrt.files.gbuffers.sequence import expanded, exr_files

    shown: list[Path] = []
    for file in files:
        # as `tracer.formats.minecraft.region.files_within`, which would load torch first
        world = any((file / folder).is_dir() for folder in ("region", "dimensions")) or any(file.glob("*.mca"))
        pictures = file.is_dir() and not world and exr_files(file)
        if file.is_dir() and not pictures and (kind := other_save(file)) and not world:
            raise ValueError(f"{file} is {kind}")
        if file.is_dir() and not (pictures or world):
            raise ValueError(f"{file} holds neither EXR files nor a Minecraft world; give files, or another folder")
        shown += within(file) if pictures else expanded(file)
    return shown
