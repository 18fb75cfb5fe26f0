"""Compilers for helpers and drivers that optimize code, and turn it into machine code, once: as part of a driver.

numba does so with every function and all that it calls, and with each of the wrappers through which threads run the
body of a loop. Code five calls below a driver then goes through it nine times. Nobody but drivers calls any of these,
so here they are translated for LLVM and linked into their driver, and no more. Compilation takes half the time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

from llvmlite.binding import Target, get_process_triple
from numba.core import config
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler


class _Part(JITCodeLibrary):
    """Code to be linked into that of its callers.

    Where a version of numba names these methods otherwise, parts become machine code like all else.
    """

    @property
    def codegen(self) -> Any:
        """What keeps the environments of functions that Python calls: a part has none."""
        return SimpleNamespace(set_env=lambda name, environment: None)

    def get_pointer_to_function(self, name: str) -> int:
        return 0

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True


class _Whole(JITCodeLibrary):
    """The code of a driver, optimized twice: with one round the bilateral filter takes 8 % longer."""

    def _optimize_final_module(self) -> None:
        with _widest_vectors(self._codegen):
            super()._optimize_final_module()
            super()._optimize_final_module()


class HelperCompiler(Compiler):
    """numba's compiler, for functions that drivers and other helpers call."""

    def define_pipelines(self) -> list[Any]:
        self.state.library = _Part(self.state.targetctx.codegen(), self.state.func_id.func_qualname)
        return super().define_pipelines()


class DriverCompiler(Compiler):
    """numba's compiler, for drivers: what it makes on the way, such as the body of a parallel loop, are parts."""

    def compile_extra(self, func: Callable[..., Any]) -> Any:
        codegen = self.state.targetctx.codegen()
        self.state.library = _Whole(codegen, func.__qualname__)
        self.state.library.enable_object_caching()
        with _parts(codegen):
            return super().compile_extra(func)


@contextmanager
def _widest_vectors(codegen: Any) -> Iterator[None]:
    """Have loops become vectors of 512 bits where the CPU has them.

    LLVM takes half of that for Intel's, since the first of them lowered their clock for it. Those that know VBMI2 do
    not: filters take a tenth less time there, a whole frame 6 %.
    """
    usual, options = codegen._tm, {"opt": config.OPT}  # pyright: ignore[reportAttributeAccessIssue]
    codegen._customize_tm_options(options)
    if "+avx512vbmi2" in options["features"].split(","):
        options["features"] += ",-prefer-256-bit"
        codegen._tm = Target.from_triple(get_process_triple()).create_target_machine(**options)
    try:
        yield
    finally:
        codegen._tm = usual


@contextmanager
def _parts(codegen: Any) -> Iterator[None]:
    """Have new code put into parts."""
    codegen.create_library = lambda name, **options: _Part(codegen, name, **options)
    try:
        yield
    finally:
        del codegen.create_library
