"""Scalar bodies: plain Python functions of one item, bound to a target and identified by their code.

A body is written once, in Python arithmetic over scalars, tuples and flat arrays. A compiler types it only if every
helper that it calls is compiled for the same target. `Target` makes copies of functions whose globals are those
compiled helpers. `fingerprint` hashes a function's own code and all code and constants that it reaches, in any file:
machine code is cached under that key.
"""

from __future__ import annotations

import builtins
import dis
import hashlib
from collections.abc import Callable, Iterator, Mapping
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any, TypeVar

import numpy as np

F = TypeVar("F", bound=Callable[..., Any])

NUMBERS = (bool, int, float, complex, str, bytes, np.generic, type(None), type(Ellipsis))
MARKS = ("__inlined__", "__allocating__", "__contracted__")
FOREIGN = ("numpy", "numba", "numba_cuda")  # whose functions a compiler knows by name


def scalar(function: F) -> F:
    """Mark a body or helper that works on one item, so that kernels may call it; it stays a plain function."""
    function.__scalar__ = True  # type: ignore[attr-defined]
    return function


def inlined(function: F) -> F:
    """Mark a `scalar` helper that is to be part of its callers.

    Compilers turn no loop into vector instructions that calls a function, and arrays pass to one through memory.
    """
    function.__inlined__ = True  # type: ignore[attr-defined]
    return scalar(function)


def allocating(function: F) -> F:
    """Mark a `scalar` helper that makes arrays, or hands out parts of them to one that does or to a driver.

    Others borrow the arrays that they are given, so that their machine code counts no references: threads would wait
    for each other at the counter of every array that they share. `Target.check` finds a mark that is missing.
    """
    function.__allocating__ = True  # type: ignore[attr-defined]
    return scalar(function)


def contracted(function: F) -> F:
    """Mark a `scalar` helper whose products and sums may become single instructions that round once.

    CUDA's compiler does so everywhere. On the CPU it takes a third of the arithmetic off polynomials.
    """
    function.__contracted__ = True  # type: ignore[attr-defined]
    return scalar(function)


def is_scalar(value: Any) -> bool:
    """Whether a value is a function marked `scalar`."""
    return isinstance(value, FunctionType) and hasattr(value, "__scalar__")


class Lanes(int):
    """A constant of a body that counts lanes, a multiple of `WIDTH`: items that its loops work on side by side.

    The CPU has `WIDTH` lanes, which its compiler turns into vectors. A target of one lane sees each such constant
    divided by that width: loops over lanes then run once, and rows of lanes become single numbers.
    """


WIDTH = Lanes(256)  # enough to spread the cost of a call and of reading what was just stored; rows stay in the cache


class Target:
    """A device that bodies are compiled for, and how.

    Args:
        jit: numba's compiler for the device.
        helper: its options for functions that bodies call.
        owner: its options for those that make arrays, see `allocating`.
        within: its options for functions that are part of their callers, see `inlined`.
        contract: its further options for helpers that are `contracted`.
        entry: its options for a body that a driver calls as ``item``.
        driver: its options for drivers.
        instead: what stands in for numpy's functions that the compiler does not know.
        lanes: that bodies work on side by side, see `Lanes`.
    """

    def __init__(
        self,
        jit: Callable[..., Any],
        *,
        helper: dict[str, Any],
        owner: dict[str, Any],
        within: dict[str, Any],
        entry: dict[str, Any],
        driver: dict[str, Any],
        contract: Mapping[str, Any] | None = None,
        instead: Mapping[Any, Any] | None = None,
        lanes: int = WIDTH,
    ) -> None:
        options = helper, owner, within, entry, driver
        contract = dict(contract or {})
        self._helper, self._owner, self._within, self._entry, self._driver = (jit(**o) for o in options)
        self._fused_helper, self._fused_within = jit(**helper, **contract), jit(**within, **contract)
        self._options = " ".join(map(str, (*options, contract)))
        self._instead, self._lanes = dict(instead or {}), int(lanes)
        self._compiled: dict[FunctionType, Any] = {}

    def compile(self, driver: FunctionType, item: FunctionType | None, name: str) -> Any:
        """numba's dispatcher for a driver, and for the body that it calls as ``item`` if it serves every body.

        numba looks up machine code by a function's name, so the name includes a hash of all that the code depends on.
        """
        replaced = {} if item is None else {"item": self._entry(self.bind(item))}
        callers = {n: f for n, f in references(driver).items() if item is not None and _calls_item(f)}
        bound = self.bind(driver, **replaced, **{n: self._entry(self.bind(f, **replaced)) for n, f in callers.items()})
        key = fingerprint(driver, self._options, item)
        bound.__qualname__ = f"{name}-{key}"
        return self._driver(bound)

    def bind(self, function: FunctionType, **replaced: Any) -> FunctionType:
        """A copy of a function whose globals hold the compiled forms of marked functions, and ``replaced``."""
        space = {name: self._resolve(value, function) for name, value in references(function).items()}
        space |= {"__builtins__": builtins, "__name__": function.__module__, **replaced}
        copy = FunctionType(function.__code__, space, function.__name__, function.__defaults__)
        copy.__qualname__ = function.__qualname__
        return copy

    def helper(self, function: FunctionType) -> Any:
        """The compiled form of a marked function, shared by all callers."""
        if function not in self._compiled:
            self._compiled[function] = self._compiler(function)(self.bind(function))
        return self._compiled[function]

    def check(self, driver: FunctionType) -> None:
        """Raise TypeError where code that counts references takes arrays from a helper that does not.

        Args:
            driver: has been compiled in this process; one that was read from a cache was checked before.
        """
        owners = [f for f in self._compiled if hasattr(f, "__allocating__")]
        for user in (driver, *owners):
            for value in references(user).values():
                for helper in _called(value, user):
                    if not hasattr(helper, "__allocating__") and self._hands_out(helper):
                        raise TypeError(f"{_name(helper)} hands out arrays to {_name(user)}: mark it @allocating")

    def _hands_out(self, function: FunctionType) -> bool:
        """Whether the compiled form of a helper returns arrays, alone or in tuples."""
        overloads = getattr(self._compiled.get(function), "overloads", {})
        return any("array(" in str(form.signature.return_type) for form in overloads.values())

    def _compiler(self, function: FunctionType) -> Callable[..., Any]:
        if hasattr(function, "__allocating__"):
            return self._owner
        if hasattr(function, "__contracted__"):
            return self._fused_within if hasattr(function, "__inlined__") else self._fused_helper
        return self._within if hasattr(function, "__inlined__") else self._helper

    def _resolve(self, value: Any, user: FunctionType) -> Any:
        if isinstance(value, ModuleType):
            used = ((name, x, self._replace(x)) for name, x in _attributes(value, user))
            changed = {name: new for name, old, new in used if new is not old}
            if changed:
                module = ModuleType(value.__name__)
                module.__dict__.update(vars(value) | changed)
                return module
        return self._replace(value)

    def _replace(self, value: Any) -> Any:
        """What stands for a global or an attribute of a module on this target."""
        if is_scalar(value):
            return self.helper(value)
        if isinstance(value, Lanes):
            return value // int(WIDTH) * self._lanes
        return self._instead.get(value, value) if isinstance(value, np.ufunc) else value


def references(function: FunctionType) -> dict[str, Any]:
    """The globals that a function names, without builtins.

    Raises:
        TypeError: it closes over variables, so that its compiled code could not be cached.
    """
    if function.__closure__:
        raise TypeError(
            f"{_name(function)} must not close over variables to be compiled, but does over "
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
            for called in _called(value, one):
                if called not in done:
                    done.add(called)
                    pending.append(called)
    return digest.hexdigest()[:16]


def _calls_item(value: Any) -> bool:
    return is_scalar(value) and "item" in references(value)


def _called(value: Any, user: FunctionType) -> list[FunctionType]:
    values = [x for _, x in _attributes(value, user)] if isinstance(value, ModuleType) else [value]
    return [x for x in values if is_scalar(x)]


def _describe(value: Any, user: FunctionType) -> Iterator[str]:
    """A global as text that is the same in every process."""
    if isinstance(value, ModuleType):
        yield value.__name__
        if value.__name__.split(".")[0] not in FOREIGN:
            for name, inner in _attributes(value, user):
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
        yield f"type {_name(value)} {getattr(value, '_fields', '')}"
    elif is_scalar(value) or isinstance(value, (BuiltinFunctionType, np.ufunc)) or _is_foreign(value):
        yield f"function {_name(value)}{''.join(f' {mark[2:-2]}' for mark in MARKS if hasattr(value, mark))}"
    else:
        raise TypeError(
            f"{_name(user)} names {getattr(value, '__name__', repr(value))}, a {type(value).__name__}: compiled code "
            "may name numbers, tuples, arrays, types, modules, and functions marked with @scalar"
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


def _attributes(module: ModuleType, user: FunctionType) -> list[tuple[str, Any]]:
    """The attributes of a module that a function may use: those that its code names."""
    names = {name for code in _codes(user.__code__) for name in code.co_names}
    return [(name, getattr(module, name)) for name in sorted(names) if hasattr(module, name)]


def _is_foreign(value: Any) -> bool:
    return str(getattr(value, "__module__", "")).split(".")[0] in FOREIGN


def _name(value: Any) -> str:
    return f"{getattr(value, '__module__', '')}.{getattr(value, '__qualname__', getattr(value, '__name__', value))}"
