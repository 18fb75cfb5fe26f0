"""What a body depends on: its own code, and all code and constants that it reaches, in any file.

Machine code is cached under a hash of that.
"""

from __future__ import annotations

import dis
import hashlib
from collections.abc import Iterator
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

from gbufrt.compute.bodies import MARKS, is_scalar

NUMBERS = (bool, int, float, complex, str, bytes, np.generic, type(None), type(Ellipsis))
FOREIGN = ("numpy", "numba", "numba_cuda")  # whose functions a compiler knows by name


def references(function: FunctionType) -> dict[str, Any]:
    """The globals that a function names, without builtins.

    Raises:
        TypeError: it closes over variables, so that its compiled code could not be cached.
    """
    if function.__closure__:
        raise TypeError(
            f"{name_of(function)} must not close over variables to be compiled, but does over "
            f"{', '.join(function.__code__.co_freevars)}: pass them, or make them constants of the module"
        )
    names = {
        step.argval
        for code in _codes(function.__code__)
        for step in dis.get_instructions(code)
        if step.opname in ("LOAD_GLOBAL", "LOAD_NAME")
    }
    return {name: function.__globals__[name] for name in sorted(names) if name in function.__globals__}


def fingerprint(function: FunctionType, options: str = "", item: FunctionType | None = None) -> str:
    """A hash of what a function does: it changes with any code or constant, here or in what it calls.

    Line numbers, comments, docstrings and annotations do not count.

    Args:
        function: a body or driver.
        options: what else machine code depends on.
        item: the function called as ``item``, if it is not the module's own.

    Raises:
        TypeError: it names something that is neither a number, tuple, array, type or module, nor a marked function.
    """
    digest = hashlib.sha256(options.encode())
    pending = [function] if item is None else [function, item]
    done = set(pending)
    while pending:
        one = pending.pop()
        placeholders = {"item"} if item is not None and one.__module__ == function.__module__ else set()
        named = {name: x for name, x in references(one).items() if name not in placeholders}
        for text in _describe_code(one.__code__, one):
            digest.update(text.encode() + b"\0")
        for name, value in named.items():
            for text in (name, *_describe(value, one)):
                digest.update(text.encode() + b"\0")
            for helper in called(value, one):
                if helper not in done:
                    done.add(helper)
                    pending.append(helper)
    return digest.hexdigest()[:16]


def called(value: Any, user: FunctionType) -> list[FunctionType]:
    """The marked functions behind a global of a function: itself, or those of a module, in all their forms."""
    values = [x for _, x in attributes(value, user)] if isinstance(value, ModuleType) else [value]
    forms = [(x, getattr(x, "__alone__", None)) for x in values if is_scalar(x)]
    return [form for pair in forms for form in pair if form is not None]


def _describe(value: Any, user: FunctionType) -> Iterator[str]:
    """A global as text that is the same in every process."""
    if isinstance(value, ModuleType):
        yield value.__name__
        if value.__name__.split(".")[0] not in FOREIGN:
            for name, inner in attributes(value, user):
                yield from (name, *_describe(inner, user))
    elif isinstance(value, NUMBERS):
        yield f"{type(value).__name__} {value!r}"
    elif isinstance(value, (tuple, frozenset)):
        yield f"{type(value).__name__} {len(value)}"
        parts = [" ".join(_describe(inner, user)) for inner in value]
        yield from sorted(parts) if isinstance(value, frozenset) else parts
    elif isinstance(value, np.ndarray):
        yield f"array {value.dtype} {value.shape} {hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()}"
    elif isinstance(value, type):
        yield f"type {name_of(value)} {getattr(value, '_fields', '')}"
    elif is_scalar(value) or isinstance(value, (BuiltinFunctionType, np.ufunc)) or _is_foreign(value):
        yield f"function {name_of(value)}{''.join(f' {mark[2:-2]}' for mark in MARKS if hasattr(value, mark))}"
    else:
        raise TypeError(
            f"{name_of(user)} names {getattr(value, '__name__', repr(value))} of type {type(value).__name__}: compiled "
            "code may name numbers, tuples, arrays, types, modules, and functions marked with @scalar"
        )


def _describe_code(code: CodeType, user: FunctionType) -> Iterator[str]:
    yield f"{code.co_name} {code.co_argcount} {code.co_flags} {code.co_names} {code.co_varnames} {code.co_code.hex()}"
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _describe_code(constant, user)
        elif constant is None or constant is not user.__doc__:
            yield " ".join(_describe(constant, user))


def _codes(code: CodeType) -> Iterator[CodeType]:
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant)


def attributes(module: ModuleType, user: FunctionType) -> list[tuple[str, Any]]:
    """The attributes of a module that a function may use: those that its code names."""
    names = {name for code in _codes(user.__code__) for name in code.co_names}
    return [(name, getattr(module, name)) for name in sorted(names) if hasattr(module, name)]


def _is_foreign(value: Any) -> bool:
    return str(getattr(value, "__module__", "")).split(".")[0] in FOREIGN


def name_of(value: Any) -> str:
    return f"{getattr(value, '__module__', '')}.{getattr(value, '__qualname__', getattr(value, '__name__', value))}"
