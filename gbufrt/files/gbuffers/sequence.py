"""Files of a sequence: which make one frame, what its number is, and names with a pattern in place of numbers."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from gbufrt.files.guard import Part, read_parts

PATTERN = re.compile(r"#+|%0?\d*d")
MASKS = frozenset(("R", "G", "B", "A", "RGB", "RGBA"))  # Falcor's ends of names, after the number
NUMBER = re.compile(r"(?:(?<=[._ ])-)?\d+")  # a hyphen is a sign where it does not stand for a separator


@dataclass(frozen=True)
class Shot:
    """The files of one frame: one, or one for each pass, as Falcor and Unreal write them.

    Args:
        files: in the order given.
        number: the last number in their names, or the frame's place among the others where one has none.
        name: what results are called.
    """

    files: tuple[Path, ...]
    number: int
    name: str

    def __str__(self) -> str:
        return str(self.files[0]) if len(self.files) == 1 else f"{self.files[0]} and {len(self.files) - 1} more"


def shots_of(paths: Sequence[Path]) -> list[Shot]:
    """Frames in order of the files given; files of one number make one frame, each a pass of it."""
    numbers = [NUMBER.findall(path.stem) for path in paths]
    if not all(numbers):
        return [Shot((path,), place, path.stem) for place, path in enumerate(paths)]
    found: dict[int, list[Path]] = {}
    for path, digits in zip(paths, numbers, strict=True):
        found.setdefault(int(digits[-1]), []).append(path)
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
            name = name or _words(file)[-1]
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
    form = re.compile(r"(-?\d+)".join(re.escape(text) for text in PATTERN.split(path.name)))
    there = path.parent.iterdir() if path.parent.is_dir() else ()
    found = sorted((tuple(map(int, match.groups())), file) for file in there if (match := form.fullmatch(file.name)))
    if not found:
        raise ValueError(f"no file fits {path}; check the path")
    return [file for _, file in found]


def by_number(paths: Iterable[Path]) -> list[Path]:
    """Files by the last number of their names, then by name, then by folder."""
    return sorted(paths, key=lambda path: ([int(n) for n in NUMBER.findall(path.stem)[-1:]], path.name, path))


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
    told, spans = [_words(file) for file in files], []
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


def _words(file: Path) -> list[str]:
    """The words of a file's name without its number."""
    stem, places = file.stem, [*NUMBER.finditer(file.stem)]
    text = f"{stem[: places[-1].start()]}{stem[places[-1].end() :]}" if places else stem
    return re.findall(r"[^._ ]+", text) or [stem]


def _name(files: Sequence[Path]) -> str:
    stems = [file.stem for file in files]
    if len(stems) == 1:
        return stems[0]
    digits = NUMBER.findall(stems[0])[-1:]
    shared = [a for a, *others in zip(*(re.split(r"[._]", stem) for stem in stems), strict=False) if {a} == {*others}]
    return "_".join(dict.fromkeys((*shared, *digits))) or "frame"
