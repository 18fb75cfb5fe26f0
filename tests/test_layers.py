"""The architecture as tests: the floors that CONTRIBUTING draws, no circles, no crowded room, names that hold."""

from __future__ import annotations

import ast
import importlib
import re
import subprocess
import sys
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path

import pytest

import gbufrt
import post
import tracer

ROOT = Path(gbufrt.__file__).parents[1]
PACKAGES = ("gbufrt", "tracer", "post")
FRONT_DOOR = "gbufrt.commands"  # the only room that imports tracer and post
MOST_FILES = 20
HOUSE = ROOT / ".github" / "CONTRIBUTING.md"
PUBLIC = {
    "gbufrt": """CHANNELS SIGNALS Camera Frame GBuffer History Pass Pipeline PipelineState Stage TemporalPass
        __version__""",
    "tracer": """MASK_ALL MASK_PRIMARY MASK_SECONDARY MASK_SHADOW WORLDS HitGroup Hits Instance Launch Material
        MaterialTable Place Rain RayType Scene Sky Sun SunPath Truth View Waves World ambient_occlusion dispatch
        focus_distance gbuffer indirect_diffuse load load_vox_scene path_trace
        raining read_vox reflection render trace transmission""",
    "post": """FXAA GTAO SSGI SSR TAA Atrous Bilateral Composite Denoise DepthOfField DisplayEncode EstimateMissing
        Exposure MarchGI MotionBlur Overlay Pulse Reduced Temporal ToneMap Vignette atrous autofocus bilateral
        bitmask_ao circle_of_confusion composite denoise depth_of_field display_encode exposure fxaa gtao march_gi me1
        metallic_from_color motion_blur motion_from_depth normals_from_depth overlay pulse roughness_from_color ssgi
        ssr taa temporal tone_map vignette""",
}


def sources(root: Path = ROOT) -> dict[str, Path]:
    """The files of our packages by module name."""
    found = {}
    for path in sorted(path for package in PACKAGES for path in (root / package).rglob("*.py")):
        parts = path.relative_to(root).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


@cache
def imports_of(source: str) -> list[ast.Import | ast.ImportFrom]:
    """Every import in a file's text, wherever it stands; planted copies of the sources are read but once."""
    return [node for node in ast.walk(ast.parse(source)) if isinstance(node, (ast.Import, ast.ImportFrom))]


def public_homes(modules: Mapping[str, Path]) -> dict[str, str]:
    """Where the names that packages export come from: ``from gbufrt import Camera`` imports ``gbufrt.camera``."""
    found = {}
    for package in PACKAGES:
        for node in imports_of(modules[package].read_text()):
            if isinstance(node, ast.ImportFrom) and node.module:
                found.update({f"{package}.{alias.name}": node.module for alias in node.names})
    return found


def graph(root: Path = ROOT) -> dict[str, set[str]]:
    """Which of our modules each of them imports: at its top, inside functions, and for the type checker alone."""
    modules = sources(root)
    homes, found = public_homes(modules), {}
    for name, path in modules.items():
        targets: set[str] = set()
        for node in imports_of(path.read_text()):
            if isinstance(node, ast.Import):
                targets.update(alias.name for alias in node.names)
            else:
                assert not node.level, f"{path}: import by full name"
                for alias in node.names:
                    full = f"{node.module}.{alias.name}"
                    targets.add(full if full in modules else homes.get(full, str(node.module)))
        found[name] = {target for target in targets - {name} if target.split(".")[0] in PACKAGES}
    return found


def floors(drawing: str) -> dict[str, int]:
    """The floor of every room that CONTRIBUTING draws, counted down: a line each, its rooms before two spaces."""
    found, package = {}, ""
    for floor, line in enumerate(drawing.splitlines()):
        if line[:1].strip():
            package = line.split()[0]
        elif line.strip():
            rooms = re.split(r"\s{2,}", line.strip())[0].split(",")
            found.update({f"{package}.{room.strip()}": -floor for room in rooms})
    return found


def drawn() -> dict[str, int]:
    return floors(re.findall(r"```text\n(.*?)```", HOUSE.read_text(), re.S)[0])


def room_of(module: str, rooms: Iterable[str]) -> str | None:
    return next((room for room in rooms if module == room or module.startswith(room + ".")), None)


def upward(imports: Mapping[str, set[str]], rooms: Mapping[str, int]) -> list[str]:
    """Imports that do not go to a floor below, within a package; and those between packages that may not be."""
    wrong = []
    for name, targets in imports.items():
        package, own = name.split(".")[0], room_of(name, rooms)
        for target in sorted(targets):
            there, theirs = target.split(".")[0], room_of(target, rooms)
            if there != package:
                allowed = there == "gbufrt" and theirs != FRONT_DOOR
            else:
                allowed = own is None or own == theirs or (theirs is not None and rooms[theirs] < rooms[own])
            if not allowed and own != FRONT_DOOR:
                wrong.append(f"{name} -> {target}")
    return wrong


def circle(imports: Mapping[str, set[str]]) -> list[str]:
    """A circle of imports, or nothing."""
    done: set[str] = set()

    def follow(name: str, trail: tuple[str, ...]) -> list[str]:
        if name in trail:
            return [*trail[trail.index(name) :], name]
        if name not in done:
            for target in sorted(imports.get(name, ())):
                found = follow(target, (*trail, name))
                if found:
                    return found
            done.add(name)
        return []

    return next((found for name in imports if (found := follow(name, ()))), [])


def test_every_room_is_drawn_and_every_drawn_room_is_there():
    rooms, modules = drawn(), sources()
    assert set(rooms) <= set(modules), f"CONTRIBUTING draws what is not there: {sorted(set(rooms) - set(modules))}"
    missing = [name for name in modules if name not in PACKAGES and room_of(name, rooms) is None]
    assert not missing, f"CONTRIBUTING does not draw {missing}"


def test_imports_go_down():
    assert not upward(graph(), drawn())


def test_no_circles():
    found = circle(graph())
    assert not found, " -> ".join(found)


@pytest.mark.parametrize(
    ("file", "line", "finds"),
    [
        (
            "post/sweep/slices.py",
            "from post.passes.light.gtao import gtao",
            "post.sweep.slices -> post.passes.light.gtao",
        ),
        ("post/sweep/slices.py", "def f():\n    from post.presets import me1", "post.sweep.slices -> post.presets"),
        ("post/march/rays.py", "import tracer", "post.march.rays -> tracer"),
        ("gbufrt/camera/camera.py", "def f():\n    import post.presets", "gbufrt.camera.camera -> post.presets"),
        ("tracer/scene/grids.py", "if TYPE_CHECKING:\n    from tracer import Hits", "tracer.scene.grids -> "),
        (
            "post/passes/light/ssr.py",
            "from gbufrt.commands.session import Runner",
            "post.passes.light.ssr -> gbufrt.commands.s",
        ),
        ("post/filters/edges.py", "from post.march.rays import Hits", "post.filters.edges -> post.march.rays"),
    ],
)
def test_an_import_upward_is_found(tmp_path: Path, file: str, line: str, finds: str):
    assert any(wrong.startswith(finds) for wrong in upward(graph(planted(tmp_path, file, line)), drawn()))


@pytest.mark.parametrize("line", ["import {}", "def f():\n    from {} import x", "if TYPE_CHECKING:\n    import {}"])
def test_a_circle_is_found(tmp_path: Path, line: str):
    """Also one within a room, which the floors allow."""
    imports = graph()
    room = {name: {t for t in targets if t.startswith("post.sweep.")} for name, targets in imports.items()}
    above, below = next((name, min(t)) for name, t in room.items() if name.startswith("post.sweep.") and t)
    root = planted(tmp_path, below.replace(".", "/") + ".py", line.format(above))
    assert above in circle(graph(root))


def planted(root: Path, file: str, line: str) -> Path:
    """A copy of the sources with a line more."""
    for path in sources().values():
        copy = root / path.relative_to(ROOT)
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_text(path.read_text())
    with (root / file).open("a") as out:
        out.write("\n" + line + "\n")
    return root


def test_no_room_is_crowded():
    folders = {path.parent for top in (*PACKAGES, "tests", "samples") for path in (ROOT / top).rglob("*.py")}
    crowded = {str(f.relative_to(ROOT)): len([p for p in f.iterdir() if p.is_file()]) for f in folders}
    assert not {name: count for name, count in crowded.items() if count > MOST_FILES}


@pytest.mark.parametrize("package", PACKAGES)
def test_public_names(package: str):
    """What users import stays; none of it hides a module of the same name."""
    module = importlib.import_module(package)
    assert set(PUBLIC[package].split()) <= set(module.__all__)
    for name in module.__all__:
        assert getattr(module, name) is not None
        assert f"{package}.{name}" not in sources(), f"{package}.{name} is a module too: importing it would be a riddle"


def test_siblings_are_ours():
    folders = {Path(str(p.__file__)).parents[1] for p in (gbufrt, tracer, post)}
    assert len(folders) == 1, (
        f"gbufrt, tracer and post must be siblings, but come from {sorted(map(str, folders))}: "
        "another distribution called tracer or post is installed; uninstall it"
    )


def test_samples_use_public_names_only():
    for path in sorted((ROOT / "samples").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] in PACKAGES:
                private = [alias.name for alias in node.names if alias.name.startswith("_")]
                assert not private, f"{path.name} imports {private}"
        assert len(path.read_text().splitlines()) <= 60, f"{path.name} is longer than 60 lines"


def test_importing_is_light():
    code = (
        "import sys, time, warnings; warnings.simplefilter('error'); import torch; start = time.process_time();"
        "import gbufrt, tracer, post; print(time.process_time() - start, *{'numba', 'kornia'} & {*sys.modules})"
    )
    best = 1e9
    for _ in range(3):  # processor time, as a busy machine stalls starts; caches may still be cold
        out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd="/").stdout
        seconds, *heavy = out.split()
        best = min(best, float(seconds))
        assert not heavy, f"importing must not load {heavy}: import them where they are called"
        if best < 1:
            break
    assert best < 1, f"importing takes {best:.1f} s of processor time beyond torch; one is allowed"
