"""Wrong arguments are answered before torch is loaded, and by names that are those of the code."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import get_args

import pytest

from gbufrt.commands.arguments import checks

WRONG = (
    ("render --size 0x0 --out out", "--size must be"),
    ("render --frames 0", "--frames must be 1 or more"),
    ("render --fps 0 --out out", "--fps must be"),
    ("render nowhere --out out", "no world 'nowhere'; there are builtin, valley, terrain"),
    ("render vally --out out", "no world 'vally' (did you mean valley?); there are"),
    ("render vally --bare --out out", "no world 'vally' (did you mean valley?); there are"),
    ("render vally --box 0,0,0,1,1,1 --pack x.zip --out out", "no world 'vally' (did you mean valley?); there are"),
    ("render save.zip --out out", "save.zip is packed; unpack it and give the save's folder"),
    ("render some/save --out out", "some/save cannot be read as a world; there are"),
    ("render file.exr --out out", "file.exr is no world: `gbufrt post file.exr` reads G-buffers"),
    ("render missing.vox --out out", "missing.vox does not exist"),
    ("render missing.vox --seed 1 --out out", "--seed is for built-in worlds"),
    ("render --box 1,2,3 --out out", "--box must be X0,Y0,Z0,X1,Y1,Z1 in whole blocks"),
    ("render r.0.0.mca --around 1 --out out", "--around must be X,Z in whole blocks"),
    ("render --chunks 3 --out out", "--chunks is for Minecraft regions and saves; leave it out for builtin"),
    ("render --window 8 --out out", "--window is for Minecraft regions and saves; leave it out for builtin"),
    ("render missing.mca --window 3 --out out", "--window must be 4 or more, got 3"),
    ("render missing.mca --window 65 --out out", "--window must be at most 64, got 65"),
    ("render missing.mca --out out", "missing.mca does not exist"),
    ("render --hour 25 --out out", "--hour must lie in 0..24, got 25"),
    ("render --hour 3 --day=-1 --out out", "--day must be 0 or more, got -1"),
    ("render --day 3 --out out", "--day needs --hour"),
    ("render --rain 2 --out out", "--rain must lie in 0..1, got 2"),
    ("render --rain=-0.5 --out out", "--rain must lie in 0..1, got -0.5"),
    ("render --waves 0.5 --out out", "--waves must lie in 0..0.45, got 0.5"),
    ("render --rain nan --out out", "--rain must lie in 0..1, got nan"),
    (
        "render --hour 3 --sun-path 30 --out out",
        "--sun-path must be ZENITH,AZIMUTH, degrees up to 90 and 360, got",
    ),
    ("render --hour 3 --sun-path 91,0 --out out", "--sun-path must be ZENITH,AZIMUTH"),
    ("render --view below --out out", "no view 'below' in world 'builtin'; it has village, lake,"),
    ("render --view vilage --out out", "no view 'vilage' in world 'builtin' (did you mean village or lake?); it has"),
    ("render --eye 1,2 --target 0,0,0 --out out", "--eye must be X,Y,Z, three numbers in world units such as"),
    ("render --eye 1,2,nan --target 0,0,0 --out out", "--eye must be X,Y,Z"),
    ("render --eye 1,2,3 --out out", "--eye and --target go together, in place of --view"),
    ("render --eye 1,2,3 --target 0,0,0 --view lake --out out", "--eye and --target go together, in place of --view"),
    ("render --eye 1,2,3 --target 1,2,3 --out out", "--target must not be where --eye is"),
    ("render --fov 180 --out out", "--fov must be 0.1 to 170 degrees, got 180"),
    ("render --preset hihg --out out", "got 'hihg' (did you mean high?)"),
    ("render --preset huge --out out", "--preset must be low, medium, high or ultra, got 'huge'"),
    ("render --composite both --out out", "--composite must be physical or me1, got 'both'"),
    ("render --set radius --out out", "--set must be NAME=VALUE"),
    ("render --warmup -1 --out out", "--warmup must be 0 or more"),
    ("render --device tpu --out out", "--device must be cpu or cuda"),
    ("render --workers 2 --out out", "--workers is for --cluster"),
    ("render --cluster local --workers 0 --out out", "--workers must be 1 or more"),
    ("render --cluster somewhere --out out", "--cluster must be local or HOST:PORT"),
    ("render --cluster ray://host:10001 --out out", "--cluster must be local or HOST:PORT"),
    ("render --cluster host:99999 --out out", "--cluster must be local or HOST:PORT"),
    ("render --cluster local --device cuda --out out", "--cluster computes on CPUs: leave out --device cuda"),
    ("render --lead-in 8 --out out", "--lead-in is for --cluster; give --cluster local, or leave --lead-in out"),
    ("render --cluster local --lead-in -1 --out out", "--lead-in must be 0 or more"),
    ("render --out file", "--out file must be a folder"),
    ("post --out out", "no files given"),
    ("post missing.exr --out out", "missing.exr does not exist"),
    ("post file.exr --out file", "--out file must be a folder"),
    ("post file.exr --out out --preset huge", "--preset must be"),
    ("post file.exr --out out --set =3", "--set must be NAME=VALUE"),
    ("post file.exr --out out --device tpu", "--device must be cpu or cuda"),
    ("inspect missing.exr", "missing.exr does not exist"),
    ("inspect file", "file is of a kind that is not read"),
    ("passes --preset huge", "--preset must be"),
    ("ablate --out out --size 4", "--size must be"),
    ("ablate --out out --frames 0", "--frames must be 1 or more"),
    ("ablate --out out --samples 0", "--samples must be 1 or more"),
    ("ablate --out out --preset huge", "--preset must be"),
    ("ablate --out out --composite both", "--composite must be"),
    ("ablate --out out --set radius", "--set must be NAME=VALUE"),
    ("ablate --out out --only sound", "--only must be ao, gi,"),
    ("ablate --out out --views below", "no view 'below'"),
    ("ablate terrain --out out --paths orbit", "no view 'orbit' in world 'terrain'; it has horizon"),
    ("ablate missing.vox --out out", "missing.vox does not exist"),
    ("ablate --out file", "--out file must be a folder"),
    ("ablate --out out --cluster somewhere", "--cluster must be local or HOST:PORT"),
    ("ablate --out out --workers 2", "--workers is for --cluster"),
    ("bench --size 4", "--size must be"),
    ("bench --repeats 0", "--repeats must be 1 or more"),
    ("bench --busy -1", "--busy must be 0 or more"),
    ("bench --presets huge", "--presets must be low, medium, high or ultra"),
    ("bench --chart chart.svg", "--chart draws what --scaling measures"),
    ("bench --scaling --chart chart.png", "--chart must be a file that ends in .svg, got 'chart.png'"),
    ("bench --scaling --chart file/chart.svg", "--chart file/chart.svg needs a folder, but file is a file"),
    ("bench --json file/deep/found.json", "--json file/deep/found.json needs a folder, but file is a file"),
    ("bench --json .", "--json must be a file, but . is a folder"),
    ("bench --device tpu", "--device must be cpu or cuda"),
)
UNWRITABLE = (
    ("render --out /proc/x", "--out /proc/x cannot be written ("),
    ("render --debug --out deep/file", "--out deep/file/debug must be a folder, but deep/file is a file"),
    ("render --out out --video /proc/x.mp4", "--video /proc/x.mp4 cannot be written"),
    ("post file.exr --out /proc/x/y", "--out /proc/x/y cannot be written ("),
    ("inspect file.exr --out /proc/x", "--out /proc/x cannot be written ("),
    ("video file.exr --out /proc/x.mp4", "--out /proc/x.mp4 cannot be written ("),
    ("ablate --out /proc/x", "--out /proc/x cannot be written ("),
    ("ablate --out out --cache /proc/x", "--cache /proc/x cannot be written ("),
    ("bench --json /proc/x.json", "--json /proc/x.json cannot be written ("),
)
CODE = """
import sys
from gbufrt.commands.cli import main
for line in sys.argv[1:]:
    try:
        main(line.split())
    except SystemExit as done:
        print(done.code, *sorted({'torch', 'numba', 'ray'} & set(sys.modules)))
"""


def test_wrong_arguments_are_answered_before_torch_is_loaded(tmp_path: Path):
    for name in ("file", "file.exr", "deep/file"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("")
    wrong = WRONG + (UNWRITABLE if sys.platform == "linux" else ())
    lines = [line for line, _ in wrong]
    root = str(Path(checks.__file__).parents[2])
    command = [sys.executable, "-c", f"import sys; sys.path.insert(0, {root!r})\n{CODE}", *lines]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    errors = done.stderr.splitlines()
    assert len(errors) == len(wrong), done.stderr
    for (line, message), said, code in zip(wrong, errors, done.stdout.splitlines(), strict=True):
        assert message in said, (line, said)
        assert code == "2", f"{line}: exit code and heavy modules: {code}"
    assert not (tmp_path / "out").exists()
    assert not list(tmp_path.rglob("*.part"))


def test_names_are_those_of_the_code():
    from gbufrt.commands.ablation.subjects import SIGNALS
    from gbufrt.files.layers import COMPRESSIONS
    from gbufrt.files.precision import PRECISIONS
    from gbufrt.files.video import CODECS
    from post.passes.light.composite import Mode
    from post.path_traced import Denoiser
    from post.presets import STATUSES, Preset
    from tracer.formats.minecraft.window import LEAST, MOST
    from tracer.worlds import FORMATS, WORLDS, terrain
    from tracer.worlds.views import views

    assert tuple(STATUSES) == checks.STATUSES
    assert get_args(Preset) == checks.PRESETS
    assert (PRECISIONS, COMPRESSIONS, tuple(CODECS)) == (checks.PRECISIONS, checks.COMPRESSIONS, checks.VIDEOS)
    assert get_args(Mode) == checks.COMPOSITES
    assert get_args(Denoiser) == checks.DENOISERS
    assert checks.SUBJECTS[: len(SIGNALS)] == SIGNALS
    assert tuple(checks.WORLDS) == ("builtin", *WORLDS)
    assert tuple(FORMATS) == checks.ENDINGS
    assert (LEAST, MOST) == checks.WINDOW
    assert tuple(views()) == checks.WORLDS["builtin"] == checks.WORLDS["valley"]
    assert tuple(terrain((16, 16, 16)).views) == checks.WORLDS["terrain"]


def test_a_folder_may_be_made_or_be_there(tmp_path: Path):
    assert checks.check_folder(tmp_path / "deep" / "deeper") == tmp_path / "deep" / "deeper"
    assert checks.check_folder(tmp_path) == tmp_path
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("world", ["builtin", "terrain"])
def test_what_is_right_passes(world: str):
    checks.check_world(world, checks.WORLDS[world], seed=3)
    checks.check_device("cuda:1")
