"""What compiles bodies, and how: copies of functions whose globals are the compiled forms of the helpers they name."""

from __future__ import annotations

import builtins
import inspect
from collections.abc import Callable, Mapping
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

import numpy as np

from gbufrt.compute.bodies import WIDTH, Lanes, is_scalar
from gbufrt.compute.fingerprint import attributes, called, fingerprint, name_of, references


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
        self._options = " ".join(map(_written, (*options, contract)))
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
                for helper in called(value, user):
                    if not hasattr(helper, "__allocating__") and self._hands_out(helper):
                        raise TypeError(f"{name_of(helper)} hands out arrays to {name_of(user)}: mark it @allocating")

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
            used = ((name, x, self._replace(x)) for name, x in attributes(value, user))
            changed = {name: new for name, old, new in used if new is not old}
            if changed:
                module = ModuleType(value.__name__)
                module.__dict__.update(vars(value) | changed)
                return module
        return self._replace(value)

    def _replace(self, value: Any) -> Any:
        """What stands for a global or an attribute of a module on this target."""
        if is_scalar(value):
            return self.helper(getattr(value, "__alone__", value) if self._lanes == 1 else value)
        if isinstance(value, Lanes):
            return value // int(WIDTH) * self._lanes
        return self._instead.get(value, value) if isinstance(value, np.ufunc) else value


def _calls_item(value: Any) -> bool:
    return is_scalar(value) and "item" in references(value)


def _written(options: Mapping[str, Any]) -> str:
    """Options as text, with the source of a compiler that is not numba's own."""
    compiler = options.get("pipeline_class")
    return str(options) if compiler is None else f"{options} {Path(inspect.getfile(compiler)).read_text()}"
