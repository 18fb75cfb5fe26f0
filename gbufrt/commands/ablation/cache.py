"""A cache on disk for what is slow to trace, under names made from all that it depends on."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from zipfile import BadZipFile

import numpy as np
import torch
from torch import Tensor

from gbufrt.frame import Frame

SKIPPED = frozenset({"views", "pose", "name"})  # fields of a scene that do not change what is traced at a given time


def default_folder() -> Path:
    """Where truth is kept for this user."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "gbufrt"


def digest(*values: Any) -> str:
    """A name for the contents of ``values``: dataclasses, mappings, sequences, tensors, numbers and text.

    Functions are ignored, and so are a scene's views, names and paths of movement: pass the poses at the time.
    """
    state = hashlib.sha256()
    _feed(state, values)
    return state.hexdigest()[:24]


@cache
def sources(*names: str) -> str:
    """A name for the program text of modules and of packages such as ``tracer``.

    A package counts without its built-in worlds (they are contents) and its commands (they have names of their own).
    """
    import importlib

    state = hashlib.sha256()
    for name in names:
        file = Path(str(importlib.import_module(name).__file__))
        files = sorted(file.parent.rglob("*.py")) if file.name == "__init__.py" else [file]
        for path in files:
            inner = path.relative_to(file.parent)
            if not {"worlds", "commands"} & set(inner.parts):
                state.update(inner.as_posix().encode() + path.read_bytes())
    return state.hexdigest()[:24]


class Cache:
    """Tensors and frames on disk. A damaged file is made again."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.made = 0
        """Number of files that had to be made."""

    def tensors(self, stem: str, make: Callable[[], Mapping[str, Tensor]]) -> dict[str, Tensor]:
        """Named tensors, read from disk, or made by ``make`` and stored."""
        path = self.folder / f"{stem}.npz"
        if path.exists():
            try:
                with np.load(path, allow_pickle=False) as found:
                    return {name: torch.from_numpy(found[name]) for name in found.files}
            except (OSError, ValueError, EOFError, KeyError, BadZipFile):
                path.unlink(missing_ok=True)
        made = {name: tensor.detach().cpu() for name, tensor in make().items()}
        with _apart(path) as part, part.open("wb") as file:
            np.savez(file, **{name: tensor.numpy() for name, tensor in made.items()})  # pyright: ignore[reportArgumentType]
        self.made += 1
        return made

    def frame(self, stem: str, make: Callable[[], Frame]) -> Frame:
        """A frame, read from disk, or made by ``make`` and stored."""
        from gbufrt.files.exr import read_exr, write_exr

        path = self.folder / f"{stem}.exr"
        if path.exists():
            try:
                return read_exr(path)
            except ValueError:
                path.unlink(missing_ok=True)
        frame = make()
        with _apart(path) as part:
            write_exr(part, frame)
        self.made += 1
        return read_exr(path)


@contextmanager
def _apart(path: Path) -> Iterator[Path]:
    """Where to write the file ``path``, in a folder of its own: two workers may make it at once, and the last stays."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(dir=path.parent, prefix=".") as folder:
        part = Path(folder, path.name)
        yield part
        os.replace(part, path)


def _feed(state: Any, value: Any) -> None:
    if isinstance(value, Tensor):
        array = value.detach().cpu().contiguous().numpy()
        state.update(f"tensor {array.dtype} {array.shape}".encode())
        state.update(array.tobytes())
    elif dataclasses.is_dataclass(value) and not isinstance(value, type):
        for field in dataclasses.fields(value):
            if field.name not in SKIPPED:
                state.update(field.name.encode())
                _feed(state, getattr(value, field.name))
    elif isinstance(value, Mapping):
        for key in sorted(value):
            state.update(str(key).encode())
            _feed(state, value[key])
    elif isinstance(value, (tuple, list)):
        state.update(f"list {len(value)}".encode())
        for item in value:
            _feed(state, item)
    elif not callable(value):
        state.update(json.dumps(value, default=repr).encode())
