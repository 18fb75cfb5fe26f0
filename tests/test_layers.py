"""The architecture as tests: who may import whom, no cycles, sizes, and siblings that are really ours."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import gbufrt
import post
import tracer

ROOT = Path(gbufrt.__file__).parents[1]
PACKAGES = ("gbufrt", "tracer", "post")
FRONT_DOOR = ("gbufrt/commands/",)
SOURCES = sorted(p for package in PACKAGES for p in (ROOT / package).rglob("*.py"))


def name_of(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def is_type_checking(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and ast.unparse(node.test).endswith("TYPE_CHECKING")


def imports(path: Path, *, lazy: bool = True) -> set[str]:
    """Modules of ours that a file imports; type-checking imports never run and do not count."""
    found: set[str] = set()
    known = {name_of(p) for p in SOURCES}

    def visit(node: ast.AST) -> None:
        if is_type_checking(node) or (not lazy and isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef))):
            return
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            assert node.level == 0, f"{path}: import by full name"
            for alias in node.names:
                full = f"{node.module}.{alias.name}"
                found.add(full if full in known else node.module)
        for child in ast.iter_child_nodes(node):
            visit(child)

    visit(ast.parse(path.read_text()))
    return {name for name in found if name.split(".")[0] in PACKAGES}


def test_siblings_are_ours():
    folders = {Path(str(p.__file__)).parents[1] for p in (gbufrt, tracer, post)}
    assert len(folders) == 1, (
        f"gbufrt, tracer and post must be siblings, but come from {sorted(map(str, folders))}: "
        "another distribution called tracer or post is installed; uninstall it"
    )


@pytest.mark.parametrize("path", SOURCES, ids=name_of)
def test_layers(path: Path):
    package = name_of(path).split(".")[0]
    relative = path.relative_to(ROOT).as_posix()
    if relative.startswith(FRONT_DOOR):
        return
    above = {name for name in imports(path) if name.split(".")[0] not in ("gbufrt", package)}
    assert not above, f"{relative} may import gbufrt and its own package only, not {sorted(above)}"
    front = {name for name in imports(path) if name.startswith(("gbufrt.commands.cli", "gbufrt.commands"))}
    assert not front, f"{relative} must not import the command line: {sorted(front)}"


def test_samples_use_public_names_only():
    for path in sorted((ROOT / "samples").glob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] in PACKAGES:
                private = [alias.name for alias in node.names if alias.name.startswith("_")]
                assert not private, f"{path.name} imports {private}"
        assert len(path.read_text().splitlines()) <= 60, f"{path.name} is longer than 60 lines"


def test_no_import_cycles():
    graph = {name_of(p): imports(p, lazy=False) - {name_of(p)} for p in SOURCES}
    done: set[str] = set()

    def walk(name: str, trail: tuple[str, ...]) -> None:
        assert name not in trail, "import cycle: " + " -> ".join([*trail[trail.index(name) :], name])
        if name in done:
            return
        for target in sorted(graph.get(name, ())):
            walk(target, (*trail, name))
        done.add(name)

    for name in graph:
        walk(name, ())


def test_importing_is_light():
    code = (
        "import sys, time, warnings; warnings.simplefilter('error'); import torch; start = time.perf_counter();"
        "import gbufrt, tracer, post; print(time.perf_counter() - start, 'numba' in sys.modules)"
    )
    best = 1e9
    for _ in range(3):  # a busy machine can stall one start
        out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd="/").stdout
        seconds, numba = out.split()
        best = min(best, float(seconds))
        assert numba == "False", "importing must not load numba: import kernels where they are called"
        if best < 2:
            break
    assert best < 2, f"importing takes {best:.1f} s beyond torch; two are allowed"
