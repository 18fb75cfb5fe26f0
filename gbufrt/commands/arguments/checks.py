"""Checks of arguments before torch is loaded, which takes seconds. Does not import torch.

The names of worlds, views, presets and composites, and the endings of files, repeat those that heavier modules define;
a test keeps them equal.
"""

from __future__ import annotations

import socket
from collections.abc import Iterable, Mapping
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from gbufrt.commands.arguments.options import ClusterOptions, FileOptions, PassOptions
from gbufrt.commands.arguments.settings import parse_settings
from gbufrt.commands.arguments.values import MOST_WARMUP, at_least, check_device, parse_names
from gbufrt.names import meant, no_world, unknown

PIPELINES = ("me1", "minecraft-rtx")
DENOISERS = ("asvgf", "denoise")
PRESETS = ("low", "medium", "high", "ultra")
COMPOSITES = ("physical", "me1")
STATUSES = ("blindness", "darkness")
PRECISIONS = ("half", "float")
COMPRESSIONS = ("zip", "dwaa")
VIDEOS = (".mp4", ".mov")
VALLEY = ("village", "lake", "cave", "plaza", "hall", "horizon", "closeup", "mill", "flythrough", "orbit")
WORLDS: Mapping[str, tuple[str, ...]] = {"builtin": VALLEY, "valley": VALLEY, "terrain": ("horizon",)}
"""Built-in worlds, and the names of their views."""
SCHEMATICS = (".schem", ".schematic", ".litematic", ".nbt")
ENDINGS = (".vox", *SCHEMATICS, ".mca")
"""Endings of the files that hold worlds."""
WINDOW = (4, 64)
"""Least and most chunks along a window."""
WORLD = ("asvgf", "irradiance_cache", "fog", "upscale", "sky", "caustics", "dispatch")
"""Subjects of Minecraft RTX's frame and BetterRTX's world, which the built-in world has."""
SLOW = ("irradiance_cache", "fog", "sky")
"""Subjects that are measured only where they are asked for."""
PASSES = ("ao", "gi", "reflection", "frame", "path", "taa", "motion_blur", "depth_of_field", "denoise", "front")
SUBJECTS = (*PASSES, *WORLD)
MOST_WORKERS = 65536
SECONDS_TO_ANSWER = 5.0
START = "start Ray with `ray start --head` and give the address that it prints"


def check_options(options: PassOptions) -> None:
    """Raise ValueError where a pipeline, preset, composite, setting, warm-up or device is invalid."""
    if options.pipeline is not None:
        check_name("--pipeline", options.pipeline, PIPELINES)
    if options.denoiser is not None:
        check_name("--denoiser", options.denoiser, DENOISERS)
    if options.preset is not None:
        check_name("--preset", options.preset, PRESETS)
    if options.composite is not None:
        check_name("--composite", options.composite, COMPOSITES)
    if options.warmup is not None:
        at_least("--warmup", options.warmup, 0, MOST_WARMUP)
    if options.status is not None:
        check_name("--status", options.status, STATUSES)
    if options.ui is not None and not options.ui.exists():
        raise FileNotFoundError(f"--ui {options.ui} does not exist; check the path")
    if options.ui is not None and not options.ui.is_file():
        raise ValueError(f"--ui {options.ui} is no file; give a picture with alpha, such as overlay.png")
    parse_settings(options.set)
    check_device(options.device)


def check_files(options: FileOptions, *, resume: bool = False) -> None:
    """Raise ValueError where what is to be written is invalid, or could not be gone on with."""
    if options.precision is not None:
        check_name("--precision", options.precision, PRECISIONS)
    check_name("--compression", options.compression, COMPRESSIONS)
    if options.bits not in (8, 16):
        raise ValueError(f"--bits must be 8 or 16, got {options.bits}")
    if options.video is not None:
        check_file("--video", options.video)
        if options.video.suffix.lower() not in VIDEOS:
            raise ValueError(f"--video must be .mp4 (H.264) or .mov (ProRes), got {str(options.video)!r}")
        if find_spec("av") is None:
            raise ValueError("--video needs PyAV: pip install 'gbufrt[video]'")
    if resume and parse_names(options.only):
        raise ValueError("--resume reads the G-buffer and light of finished frames again; leave out --only")


def check_name(option: str, name: str, known: Iterable[str]) -> None:
    """Raise ValueError if a name is not a known one."""
    names = list(known)
    if name not in names:
        raise ValueError(f"{option} must be {', '.join(names[:-1])} or {names[-1]}, got {name!r}{meant(name, names)}")


def check_world(world: str, views: Iterable[str] = (), *, seed: int | None = None) -> None:
    """Check that a world exists, and the views of a built-in one.

    Raises:
        ValueError: there is no such world or view, or a seed for a file.
        FileNotFoundError: there is no such file.
    """
    builtin = ", ".join(WORLDS)
    if world in WORLDS:
        for view in views:
            if view not in WORLDS[world]:
                raise ValueError(unknown("view", view, f"world {world!r}", WORLDS[world]))
    elif seed is not None:
        raise ValueError(f"--seed is for built-in worlds ({builtin}); leave it out for {world}")
    elif world in VALLEY and not Path(world).exists():
        raise ValueError(f"{world} is a view, not a world; leave the world out and give --view {world}")
    elif Path(world).suffix.lower() not in ENDINGS and not Path(world).is_dir():
        raise ValueError(no_world(world, WORLDS, ENDINGS))
    elif not Path(world).exists():
        raise FileNotFoundError(f"{world} does not exist; check the path, or name a world: {builtin}")


def check_part(world: str, part: Mapping[str, Any]) -> None:
    """Check that a part, and textures, are asked of a world that has them, and that the pack is there.

    Raises:
        ValueError: it is asked of another world.
        FileNotFoundError: there is no such pack.
    """
    ending = Path(world).suffix.lower()
    whole = world not in WORLDS and (ending == ".mca" or Path(world).is_dir())
    textured = whole or (world not in WORLDS and ending in SCHEMATICS)
    if "pack" in part and not textured:
        raise ValueError(f"--pack is for Minecraft worlds and schematics; leave it out for {world}")
    if "pack" in part and not Path(part["pack"]).exists():
        raise FileNotFoundError(f"--pack {part['pack']} does not exist; check the path")
    if chosen := [name for name in part if name != "pack" and not whole]:
        raise ValueError(f"--{chosen[0]} is for Minecraft regions and saves; leave it out for {world}")


def check_folder(path: Path, option: str = "--out") -> Path:
    """A path that is, or can become, a folder to write to; what is made to find out is gone again.

    Raises:
        ValueError: a file is in the way, or nothing can be written there.
    """
    if (found := _in_the_way(path)) is not None:
        raise ValueError(f"{option} {path} must be a folder, but {found} is a file; choose another name")
    _check_writable(option, path, path / ".gbufrt.part")
    return path


def check_file(option: str, path: Path) -> None:
    """Raise ValueError unless a file can be written to a path; what is made to find out is gone again."""
    if path.is_dir():
        raise ValueError(f"{option} must be a file, but {path} is a folder; choose another name")
    if (found := _in_the_way(path.parent)) is not None:
        raise ValueError(f"{option} {path} needs a folder, but {found} is a file; choose another name")
    _check_writable(option, path, path.with_name(f".{path.name}.part"))


def _check_writable(option: str, path: Path, trial: Path) -> None:
    """Write the file ``trial`` with the folders that it lacks, and take them away; only this tells for certain."""
    missing = [folder for folder in trial.parents if not folder.exists()]
    try:
        trial.parent.mkdir(parents=True, exist_ok=True)
        trial.touch()
        trial.unlink()
    except OSError as error:
        raise ValueError(f"{option} {path} cannot be written ({error.strerror}); choose another place") from error
    finally:
        for folder in missing:
            with suppress(OSError):  # not made, or another process writes there already
                folder.rmdir()


def _in_the_way(path: Path) -> Path | None:
    """The file where a folder is wanted."""
    there = next((folder for folder in (path, *path.parents) if folder.exists()), None)
    return None if there is None or there.is_dir() else there


def check_cluster(options: ClusterOptions, *, device: str = "cpu", lead_in: int | None = None) -> None:
    """Check the options and what fits them, and whether anything answers at the address; imports neither torch nor Ray.

    Raises:
        ValueError: they make no sense together, Ray is not installed, or nothing answers.
    """
    address = options.cluster
    if address is None:
        for name, value in (("--workers", options.workers), ("--lead-in", lead_in)):
            if value is not None:
                raise ValueError(f"{name} is for --cluster; give --cluster local, or leave {name} out")
        return
    if options.workers is not None:
        at_least("--workers", options.workers, 1, MOST_WORKERS)
    host, _, port = address.rpartition(":")
    if address != "local" and not (host and "/" not in host and port.isdecimal() and 0 < int(port[:6]) < 65536):
        raise ValueError(f"--cluster must be local or HOST:PORT, such as 192.168.1.5:6379, got {address!r}")
    if device != "cpu":
        raise ValueError(f"--cluster computes on CPUs: leave out --device {device}")
    if find_spec("ray") is None:
        raise ValueError("--cluster needs Ray: pip install 'gbufrt[cluster]'")
    if address != "local":
        try:
            socket.create_connection((host.strip("[]"), int(port)), SECONDS_TO_ANSWER).close()
        except (OSError, UnicodeError) as error:  # UnicodeError: a name that can be no host's, such as a..b
            reason = getattr(error, "strerror", None) or str(error)
            raise ValueError(f"nothing answers at --cluster {address} ({reason}); {START}") from error
