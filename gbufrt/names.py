"""Names that people type: what they mean, and what a short or a wrong one may stand for. Does not import torch."""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Iterable, Mapping
from difflib import SequenceMatcher, get_close_matches
from pathlib import Path, PurePath
from typing import Any

MOST = 4  # names that a message proposes
BEDROCK = "a world of Minecraft Bedrock; convert it to a Java save (Chunker and Amulet do)"
LINEAR = "in Linear's regions; convert them to .mca (their makers' tools do)"
OLD = "of Minecraft before 1.2; open the world in a newer one, which writes .mca"
VOXELS = "of another voxel program; export a .vox from there"
MESH = "a mesh, and the tracer takes voxels; render it elsewhere and give the EXRs to `gbufrt post`"
REMEDIES: Mapping[str, str] = {
    **dict.fromkeys((".mcworld", ".mctemplate", ".mcstructure"), BEDROCK),
    ".linear": LINEAR,
    ".mcr": OLD,
    **dict.fromkeys((".gox", ".qb", ".qbt", ".qbcl", ".qmo", ".binvox", ".vxl", ".kv6", ".vxm", ".cub"), VOXELS),
    **dict.fromkeys((".obj", ".ply", ".stl", ".fbx", ".gltf", ".glb", ".usd", ".usda", ".usdc", ".blend"), MESH),
    ".dat": "a part of a save; give the save's folder",
    ".mcc": "a chunk that belongs to a region; give the .mca beside it",
    ".zip": "packed; unpack it and give the save's folder",
}
"""What files are that are not read, by their ending, and what to do."""


def meant(name: str, known: Iterable[str]) -> str:
    """``" (did you mean x?)"`` where a known name is like this one, else nothing."""
    near = get_close_matches(str(name), list(known), n=MOST)
    return f" (did you mean {' or '.join(near)}?)" if near else ""


def with_article(name: str) -> str:
    """A name after ``a`` or ``an``."""
    return f"{'an' if name[:1].lower() in 'aeiou' else 'a'} {name}"


def unknown(what: str, name: str, where: str, known: Iterable[str]) -> str:
    """The message about a name that is not there: what it may have meant, and all that there are."""
    known = list(known)
    return f"no {what} {name!r} in {where}{meant(name, known)}; it has {', '.join(known)}"


def no_world(world: str, names: Iterable[str], endings: Iterable[str]) -> str:
    """The message about a world that is neither a known name nor a file of a kind that is read."""
    names, kind = list(names), PurePath(world).suffix.lower()
    there = f"there are {', '.join(names)}, or give a path to a {' or '.join(endings)} file or a save folder"
    if remedy := REMEDIES.get(kind):
        return f"{world} is {remedy}"
    if kind == ".exr":
        return f"{world} is no world: `gbufrt post {world}` reads G-buffers; {there}"
    if kind or PurePath(world).name != world:
        return f"{world} cannot be read as a world; {there}"
    return f"no world {world!r}{meant(world, names)}; {there}"


def other_save(folder: Path) -> str:
    """What a folder is that holds no Minecraft world of the kind that is read, and what to do; empty where unknown."""
    if (folder / "db").is_dir() or (folder / "CURRENT").is_file():
        return BEDROCK
    for place in (folder, folder / "region"):
        for kind in (".linear", ".mcr"):
            if any(place.glob(f"*{kind}")):
                return f"a world {REMEDIES[kind]}"
    if (folder / "region2d").is_dir() or (folder / "region3d").is_dir():
        return "a world of cubic chunks; convert it to a save of common chunks"
    if found := _dimensions(folder):
        return f"no save with an overworld; give a folder within it: {', '.join(found[:MOST])}"
    return ""


def _dimensions(folder: Path) -> list[str]:
    """The folders within this one that hold regions: saves, or dimensions of the game and of mods."""
    found = (region for at in ("*", "*/*", "dimensions/*/*") for region in folder.glob(f"{at}/region"))
    return sorted({str(region.parent) for region in found if any(region.glob("r.*.mca"))})


def resolve(name: str, kinds: Mapping[str, str]) -> str:
    """The full dotted name of a tunable.

    Args:
        name: in full, or an unambiguous tail of it; a pass may go by its class's name in lower case.
        kinds: class of the pass that has the tunable, by the tunable's full name.

    Raises:
        TypeError: the name is no text.
        ValueError: no such tunable, or a tail that fits several.
    """
    if not isinstance(name, str):
        raise TypeError(f"a tunable is named by text such as 'gtao.radius', got {name!r}")
    if name in kinds:
        return name
    found = []
    for full, kind in kinds.items():
        path, _, key = full.rpartition(".")
        alias = f"{kind.lower()}.{key}"
        if full.endswith("." + name) or name == alias or f"{path.rpartition('.')[0]}.{alias}" == name:
            found.append(full)
    if len(found) == 1:
        return found[0]
    if found:
        raise ValueError(f"tunable {name!r} is ambiguous: {', '.join(found)}")
    near = get_close_matches(_key(name), {_key(full) for full in kinds})
    likely = [full for full in kinds if _key(full) in near]
    likely.sort(key=lambda full: -SequenceMatcher(None, name, full).ratio())
    hint = f"did you mean {', '.join(likely[:MOST])}?" if likely else "all_tunables() and `gbufrt passes` list them"
    raise ValueError(f"no tunable {name!r}; {hint}")


def meanings(cls: type, names: Iterable[str]) -> dict[str, str]:
    """What the keywords of a class mean, in a line each, as the ``Args`` of docstrings tell.

    Its own docstring comes first, then those of the functions that it refers to in backquotes, and that these refer
    to, where its module knows them.
    """
    docs, texts, module = [inspect.getdoc(cls) or ""], dict[str, str](), vars(sys.modules[cls.__module__])
    for doc in docs:  # grows on the way
        texts = {**{name: text for name, text in arguments(doc).items() if not text.startswith("see ")}, **texts}
        near = (module.get(name) for name in re.findall(r"(?<!`)`(\w+)`", doc))
        docs += [told for f in near if inspect.isfunction(f) and (told := inspect.getdoc(f) or "") not in docs]
    return {name: re.split(r"\.(?= [A-Z]|$)", texts.get(name, ""))[0] for name in names}


def arguments(doc: str) -> dict[str, str]:
    """The ``Args`` of a docstring that `inspect.getdoc` has cleaned, by name, each in one line."""
    section = re.search(r"^Args:\n((?:    .*\n|\n)+)", doc + "\n", re.M)
    parts = re.split(r"^    (\w+): ", section[1] if section else "", flags=re.M)
    return {name: " ".join(text.split()) for name, text in zip(parts[1::2], parts[2::2], strict=True)}


def _key(full: str) -> str:
    return full.rpartition(".")[2]


def several(argument: str, names: str | Iterable[str], example: tuple[str, ...]) -> tuple[str, ...]:
    """One name or several as a tuple.

    Raises:
        ValueError: there is no name: names the argument, and shows the example.
    """
    found = (names,) if isinstance(names, str) else tuple(names) if isinstance(names, Iterable) else ()
    if not found or not all(isinstance(name, str) and name for name in found):
        raise ValueError(f"{argument} must be a name or several such as {example}, got {names!r}")
    return found


def single(argument: str, name: Any, example: str) -> str:
    """One name.

    Raises:
        TypeError: it is no text, or an empty one: names the argument, and shows the example.
    """
    if not isinstance(name, str) or not name:
        raise TypeError(f"{argument} must be one name such as {example!r}, got {name!r}; a stage takes one signal")
    return name
