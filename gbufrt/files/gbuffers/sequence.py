"""Files of a sequence: which make one frame, what its number is, and names with a pattern in place of numbers."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from gbufrt.files.guard import Part, read_parts

PATTERN = re.compile(r"#+|%0?\d*d")
HASHES = re.compile(r"#+")
MASKS = frozenset(("R", "G", "B", "A", "RGB", "RGBA"))  # Falcor's ends of names, after the number
NUMBER = re.compile(r"(?:(?<=[._ ])-)?\d+")  # a hyphen is a sign where it does not stand for a separator

WHOLE = re.compile(r"(?:(?<=[._ ])-|(?<![^\W_]))\d+")  # a number that no letter precedes


@dataclass(frozen=True)
class Shot:
    """The files of one frame: one, or one for each pass, as Falcor and Unreal write them.

    Args:
        files: in the order given.
        number: that of their names (see `_numbers`), or the frame's place among the others where one has none.
        name: what results are called.
    """

    files: tuple[Path, ...]
    number: int
    name: str

    def __str__(self) -> str:
        return str(self.files[0]) if len(self.files) == 1 else f"{self.files[0]} and {len(self.files) - 1} more"


def shots_of(paths: Sequence[Path]) -> list[Shot]:
    """Frames in order of the files given; files of one number make one frame, each a pass of it."""
    numbers = _numbers(paths)
    found: dict[int, list[Path]] = {}
    for path, number in zip(paths, numbers, strict=True):
        if number is None:
            return [Shot((path,), place, path.stem) for place, path in enumerate(paths)]
        found.setdefault(int(number[0]), []).append(path)
    return [Shot(tuple(files), number, _name(files)) for number, files in found.items()]


def numbered(path: Path) -> bool:
    """Whether a file's name has a frame number."""
    return bool(NUMBER.search(path.stem))


def one_shot(paths: Sequence[Path]) -> Shot:
    """Files without a number as the passes of one frame, number 0."""
    return Shot(tuple(paths), 0, _name(paths))


def shot_parts(files: Path | Sequence[Path], *, header_only: bool = False) -> list[Part]:
    """The parts of all files of a frame; those of several files are ``of_pass`` what their names tell.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: see `gbufrt.files.guard.read_parts`; or two files are of one pass.
    """
    files = [files] if isinstance(files, Path) else list(files)
    if len(files) == 1:
        return read_parts(files[0], header_only=header_only)
    names = _passes(files)
    for name, file in zip(names, files, strict=True):
        if names.count(name) > 1:
            name = name or _words([file])[0][-1]
            raise ValueError(f"{file}: two files of one frame number are both of the pass {name!r}; run them apart")
    return [
        replace(part, of_pass=name)
        for name, file in zip(names, files, strict=True)
        for part in read_parts(file, header_only=header_only)
    ]


def expanded(path: Path) -> list[Path]:
    """The files that a name with ``####`` or ``%04d`` in place of the number stands for, by number; else itself.

    Raises:
        ValueError: there are none.
    """
    if path.exists() or not PATTERN.search(path.name):
        return [path]
    there = list(path.parent.iterdir()) if path.parent.is_dir() else []
    for pattern in (PATTERN, HASHES):  # where there are both, a name may hold %d itself
        form = re.compile(r"(-?\d+)".join(re.escape(text) for text in pattern.split(path.name)))
        fits = [(match, file) for file in there if (match := form.fullmatch(file.name))]
        if fits:
            return [file for _, file in sorted((tuple(map(int, match.groups())), file) for match, file in fits)]
    raise ValueError(f"no file fits {path}; check the path")


def by_number(paths: Iterable[Path]) -> list[Path]:
    """Files by the numbers of their names, then by name, then by folder."""
    paths = list(paths)
    keys = [
        ([int(number[0])] if number else [], path.name, path)
        for path, number in zip(paths, _numbers(paths), strict=True)
    ]
    return [path for *_, path in sorted(keys)]


def exr_files(folder: Path) -> list[Path]:
    """The EXR files of a folder by number, or else of the folders in it, as those that are called by passes."""
    inside = [path for path in folder.iterdir() if path.is_dir()]
    for folders in ([folder], inside):
        found = [path for some in folders for path in some.iterdir() if path.suffix.lower() == ".exr"]
        if found:
            return by_number(found)
    return []


def _passes(files: Sequence[Path]) -> list[str]:
    """What each file of a frame is called by: of its name what they do not share, and where names are alike the folder.

    Empty where a name has nothing else, as that of the picture without a pass.
    """
    told, spans = _words(files), []
    shared = set.intersection(*map(set, told))
    for file, words in zip(files, told, strict=True):
        after = file.stem[file.stem.rfind(words[-1]) :]
        masked = len(words) > 1 and words[-1] in MASKS and words[-2] not in shared and not NUMBER.search(after)
        spans.append(words[: len(words) - masked])
    lead = _alike(spans)
    tail = _alike([words[lead:][::-1] for words in spans])
    names = ["_".join(words[lead : len(words) - tail]) for words in spans]
    folders = [file.parent.name for file in files]
    if len({*names}) < len(names) and len({*folders}) > 1:
        names = ["_".join(filter(None, pair)) for pair in zip(folders, names, strict=True)]
    return names


def _alike(words: Sequence[Sequence[str]]) -> int:
    """How many words all of these begin with."""
    places = enumerate(zip(*words, strict=False))
    return next((i for i, some in places if len({*some}) > 1), min(map(len, words)))


def _words(files: Sequence[Path]) -> list[list[str]]:
    """The words of each file's name without its number."""
    told = []
    for file, number in zip(files, _numbers(files), strict=True):
        text = f"{file.stem[: number.start()]}{file.stem[number.end() :]}" if number else file.stem
        told.append(re.findall(r"[^._ ]+", text) or [file.stem])
    return told


def _numbers(files: Sequence[Path]) -> list[re.Match[str] | None]:
    """Where the frame's number stands in each name: the last digits.

    Where some names end with a number of its own, as ``shot.0101.N``, and all have one, digits after letters are of the
    pass, as in ``shot.0101.Mask00``.
    """
    last, whole = ([[None, *form.finditer(file.stem)][-1] for file in files] for form in (NUMBER, WHOLE))
    own = all(whole) and any(a and b and a.span() == b.span() for a, b in zip(last, whole, strict=True))
    return whole if own else last


def _name(files: Sequence[Path]) -> str:
    stems, number = [file.stem for file in files], _numbers(files)[0]
    if len(stems) == 1:
        return stems[0]
    digits = [number[0]] if number else []
    shared = [a for a, *others in zip(*(re.split(r"[._]", stem) for stem in stems), strict=False) if {a} == {*others}]
    return "_".join(dict.fromkeys((*shared, *digits))) or "frame"
