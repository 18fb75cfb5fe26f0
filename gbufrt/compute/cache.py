"""The cache of compiled kernels on disk, and notification while they are compiled.

numba keeps machine code in ``__pycache__`` beside the source or, where that is read-only, in the user's cache;
``NUMBA_CACHE_DIR`` overrides both. Two things differ here. Where numba finds no place (a read-only installation and an
unwritable HOME, as in containers), a folder of this user under the system's temporary one is used. And every compiled
form has a file named by what it depends on, written in one step. There is no index: two processes could write it at
once, and one would then load the machine code of the other.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import stat
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple
from weakref import WeakSet

import numba
from numba.core import event
from numba.core.caching import CompileResultCacheImpl, FunctionCache, IndexDataCacheFile

from gbufrt.compute.notice import Notice

DAMAGED = (OSError, EOFError, pickle.UnpicklingError)
COMPILING = "compiling kernels (once on this machine)"


class Compilation(NamedTuple):
    """What those who `watch` are told: the compilation of a kernel begins or, with its seconds, has ended."""

    kernel: str
    seconds: float | None = None


Watcher = Callable[[Compilation], None]

_drivers: WeakSet[Any] = WeakSet()
_watchers: list[Watcher] = []
notice = Notice(quiet=lambda: bool(_watchers))


def kept(dispatcher: Any) -> Any:
    """The dispatcher of a driver, with its compiled forms cached on disk and reported to those who `watch`."""
    _listen()
    _drivers.add(dispatcher)
    function = dispatcher.py_func
    try:
        dispatcher._cache = _Cache(function)
    except RuntimeError as error:
        if "no locator" not in str(error):
            raise
        folder = _temporary()
        if folder is not None:
            before, numba.config.CACHE_DIR = numba.config.CACHE_DIR, folder  # pyright: ignore
            try:
                dispatcher._cache = _Cache(function)
            finally:
                numba.config.CACHE_DIR = before  # pyright: ignore
    return dispatcher


@contextmanager
def watch(watcher: Watcher) -> Iterator[None]:
    """Call the watcher when a driver begins to be compiled, and when it is done."""
    _watchers.append(watcher)
    try:
        yield
    finally:
        _watchers.remove(watcher)


@contextmanager
def reported() -> Iterator[dict[str, float]]:
    """Say on stderr which drivers are compiled; the dictionary that it yields fills with the seconds of each."""
    seconds: dict[str, float] = {}
    told = False

    def watcher(compilation: Compilation) -> None:
        nonlocal told
        if not told:
            told = True
            _say(COMPILING)
        if compilation.seconds is not None:
            seconds[compilation.kernel] = seconds.get(compilation.kernel, 0.0) + compilation.seconds

    with watch(watcher):
        yield seconds
    if seconds:
        each = ", ".join(f"{kernel} {t:.1f} s" for kernel, t in sorted(seconds.items(), key=lambda row: -row[1]))
        _say(f"{len(seconds)} compiled in {sum(seconds.values()):.0f} s: {each}")


def missing(dispatcher: Any) -> bool:
    """Whether the cache holds no compiled form of a driver's present source."""
    files = getattr(getattr(dispatcher, "_cache", None), "_cache_file", None)
    return isinstance(files, _Files) and files.empty()


def tell(compilation: Compilation) -> None:
    """Tell those who `watch`."""
    for watcher in tuple(_watchers):
        watcher(compilation)


class _Files(IndexDataCacheFile):
    """One file for each compiled form, named by what it depends on."""

    def save(self, key: Any, data: Any) -> None:
        path = self._path(key)
        try:
            self._save_data(path.name, data)
            for other in path.parent.glob(f"{self._base()}.*.nbc"):
                if not other.name.startswith(self._stem()):  # of an older source
                    other.unlink(missing_ok=True)
        except OSError:  # a full disk: a kernel that cannot be cached still runs
            return

    def load(self, key: Any) -> Any:
        try:
            return self._load_data(self._path(key).name)
        except DAMAGED:
            return None

    def empty(self) -> bool:
        return not any(Path(self._cache_path).glob(f"{self._stem()}*.nbc"))

    def _path(self, key: Any) -> Path:
        return Path(self._cache_path, f"{self._stem()}{hashlib.sha256(repr(key).encode()).hexdigest()[:24]}.nbc")

    def _stem(self) -> str:
        source = hashlib.sha256(repr((self._version, self._source_stamp)).encode()).hexdigest()
        return f"{self._base()}.{source[:12]}."

    def _base(self) -> str:
        return str(self._index_name).removesuffix(".nbi")


class _Loaded(CompileResultCacheImpl):
    """Reads compiled forms, but keeps no intermediate code, which is there to be linked into compiled callers.

    No driver has any, and of `me1` it is some 30 MB. numba needs that code while it loads, so it stays in the files.
    """

    def rebuild(self, target_context: Any, payload: Any) -> Any:
        result = super().rebuild(target_context, payload)
        result.library._shared_module = None
        return result


class _Cache(FunctionCache):
    """numba's cache of a function, over `_Files`."""

    _impl_class = _Loaded

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        numbas = self._cache_file
        self._cache_file = _Files(self._cache_path, self._impl.filename_base, numbas._source_stamp)


@cache
def _temporary() -> str | None:
    """A temporary folder for the cache, reported on stderr; None where none is writable."""
    folder = Path(tempfile.gettempdir(), f"gbufrt-kernels-{os.getuid() if hasattr(os, 'getuid') else 'user'}")
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        if not _private(folder):
            folder = Path(tempfile.mkdtemp(prefix="gbufrt-kernels-"))
    except OSError:
        _tell("no folder is writable to keep compiled kernels in: each process compiles them anew, for a minute")
        return None
    _tell(f"compiled kernels are kept in {folder}, and compiled anew, for a minute, when that is gone")
    os.environ["NUMBA_CACHE_DIR"] = str(folder)  # for processes that this one starts
    return str(folder)


def _private(folder: Path) -> bool:
    """Whether nobody else can put code into a folder whose name they can guess."""
    found = folder.lstat()
    mine = not hasattr(os, "getuid") or found.st_uid == os.getuid()
    return stat.S_ISDIR(found.st_mode) and mine and (os.name == "nt" or not found.st_mode & 0o077)


def _tell(what: str) -> None:
    _say(f"{what}; to keep them, set NUMBA_CACHE_DIR to a writable folder that stays")


def _say(what: str) -> None:
    sys.stderr.write(f"gbufrt: {what}\n")


class _Listener(event.Listener):
    """Tells the watchers when drivers are compiled, but not the functions that drivers call."""

    def __init__(self) -> None:
        self.begun: dict[Any, tuple[float, Callable[[], None]]] = {}

    def on_start(self, event: Any) -> None:
        dispatcher = event.data["dispatcher"]
        if dispatcher in _drivers:
            self.begun[dispatcher] = time.perf_counter(), notice.begin()
            tell(Compilation(_name(dispatcher)))

    def on_end(self, event: Any) -> None:
        dispatcher = event.data["dispatcher"]
        if dispatcher in _drivers:
            begun, end = self.begun.pop(dispatcher)
            end()
            tell(Compilation(_name(dispatcher), time.perf_counter() - begun))


def _name(dispatcher: Any) -> str:
    """The name of a driver, without the hash that `gbufrt.compute.target.Target` puts behind it."""
    return str(dispatcher.py_func.__qualname__).partition("-")[0]


@cache
def _listen() -> None:
    event.register("numba:compile", _Listener())
