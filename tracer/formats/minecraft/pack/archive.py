"""The files of a pack, read one by one into memory, and no more of them than the limit allows."""

from __future__ import annotations

import json
import os
import re
import zipfile
import zlib
from os import PathLike
from pathlib import Path, PurePosixPath
from typing import Any, final

from tracer.formats.minecraft.pack.older import older_names

MAX_FILE = 1 << 24  # bytes of one file, unpacked
MAX_FILES = 1 << 18
JAVA, BEDROCK = "assets/minecraft/textures/block/", "textures/blocks/"
ENDS = (".png", ".tga")
COMMENTS = re.compile(rb"^\s*//.*$", re.MULTILINE)  # Bedrock allows them in JSON
# what zipfile raises of a damaged file, of a compression that it does not know, and of one with a password
ZIP_ERRORS = (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, OSError)


class PackError(ValueError):
    """What is wrong with a pack, whatever it is read for."""


@final
class Archive:
    """A jar, a zip or a folder.

    Args:
        path: of it.

    Raises:
        FileNotFoundError: there is nothing.
        ValueError: no archive, damaged, with paths that lead out of it, or without any texture of a block.
    """

    def __init__(self, path: str | PathLike[str]) -> None:
        self.path = Path(path)
        if not self.path.exists():
            raise FileNotFoundError(f"pack {self.path} does not exist; check the path")
        self._zip = None if self.path.is_dir() else _opened(self.path)
        names = _below(self.path) if self._zip is None else self._zip.namelist()
        self.names = frozenset(names)
        if len(self.names) > MAX_FILES:
            raise PackError(f"pack {self.path} has more than the {MAX_FILES} files allowed")
        if out := next((n for n in names if ".." in PurePosixPath(n).parts or n.startswith(("/", "\\"))), None):
            raise PackError(f"pack {self.path} holds {out!r}, a path that leads out of it; get it from elsewhere")
        self.java = any(JAVA in name for name in names)
        inner = JAVA if self.java else BEDROCK
        roots = {name[: name.index(inner)] for name in names if inner in name and name.endswith(ENDS)}
        if not roots:
            raise PackError(
                f"pack {self.path} has no textures of blocks ({JAVA}*.png or {BEDROCK}*.png); give a resource pack"
            )
        self._root = min(roots, key=len)
        below = [name.removeprefix(self._root) for name in names if name.startswith(f"{self._root}{inner}")]
        stems = [name.rpartition(".")[0] for name in below if name.endswith(ENDS)]
        self._stems = {} if self.java else {stem.rpartition("/")[2]: stem for stem in stems}
        self.most = self._left = _most_bytes()

    def read(self, name: str) -> bytes | None:
        """A file's bytes, or None where there is none.

        Raises:
            ValueError: damaged, or larger than is allowed.
        """
        full = self._root + name
        if full not in self.names:
            return None
        most = min(MAX_FILE, self._left)
        try:
            with (self.path / full).open("rb") if self._zip is None else self._zip.open(full) as file:
                data = file.read(most + 1)
        except ZIP_ERRORS as error:
            raise PackError(f"pack {self.path}: {name} is damaged: {error}") from None
        if len(data) > most:
            raise PackError(
                f"pack {self.path}: {name} unpacks to more than the {most} bytes left of the limit; if true, set "
                "GBUFRT_MAX_GB, or leave the file out"
            )
        self._left -= len(data)
        return data

    def stem(self, texture: str) -> str | None:
        """The path of a texture's picture without its ending, from a name such as ``minecraft:block/stone``.

        Where files have older names, it is that of the one that is there; None where none is.
        """
        space, _, path = texture.rpartition(":")
        if self.java:
            return f"assets/{space or 'minecraft'}/textures/{path}"
        name = path.removeprefix("block/")
        return next((self._stems[own] for own in older_names(name) if own in self._stems), None)

    def picture(self, stem: str) -> str | None:
        """The name of the picture whose path without its ending is ``stem``, or None where there is none."""
        return next((stem + end for end in ENDS if f"{self._root}{stem}{end}" in self.names), None)

    def has_picture(self, texture: str) -> bool:
        """Whether there is a picture of a texture."""
        stem = self.stem(texture)
        return stem is not None and self.picture(stem) is not None

    def json(self, name: str) -> dict[str, Any] | None:
        """The object in a JSON file, or None where there is no file.

        Raises:
            ValueError: it is no JSON object.
        """
        data = self.read(name)
        if data is None:
            return None
        try:
            value = json.loads(COMMENTS.sub(b"", data))
        except (ValueError, RecursionError):
            value = None
        if not isinstance(value, dict):
            raise PackError(f"pack {self.path}: {name} is not a JSON object")
        return value


def _opened(path: Path) -> zipfile.ZipFile:
    try:
        return zipfile.ZipFile(path)
    except ZIP_ERRORS as error:
        raise PackError(
            f"pack {path} is no zip archive, or truncated: {error}; give a jar, a zip or a folder"
        ) from None


def _below(folder: Path) -> list[str]:
    """Files of a folder, by their paths in it; links that lead out of it are left out."""
    found, home = list[str](), folder.resolve()
    for where, _, files in os.walk(folder):
        for file in files:
            path = Path(where, file)
            if not path.is_symlink() or path.resolve().is_relative_to(home):
                found.append(path.relative_to(folder).as_posix())
        if len(found) > MAX_FILES:
            break
    return found


def _most_bytes() -> int:
    from gbufrt.files.guard import most_bytes

    return int(most_bytes())
