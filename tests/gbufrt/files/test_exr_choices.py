"""EXR: what is rounded, packed and left out by choice, and what other programs make of it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import boxes
import numpy as np
import OpenEXR
import pytest
import torch

from gbufrt import Frame
from gbufrt.files.exr import read_exr, write_exr
from gbufrt.files.png import write_png
from gbufrt.files.precision import EXACT, as_stored

SIZE = (72, 128)
EXACT_NAMES = sorted(EXACT - {"exposure"})


def lit_frame() -> Frame:
    """A frame with results of passes, all of them with detail that half and DWAA change."""
    random = torch.Generator().manual_seed(3)
    across = torch.linspace(0, 9, SIZE[1]).sin() * torch.linspace(0, 5, SIZE[0])[:, None].cos()
    noise = 0.5 + 0.4 * across + 0.05 * torch.rand(1, 3, *SIZE, generator=random)
    frame = boxes.frame(boxes.camera(SIZE), previous=boxes.camera(SIZE, dx=0.3))
    g = frame.gbuffer
    turned = torch.nn.functional.normalize(torch.where(g.hit, g.normal + 0.1 * noise, g.normal), dim=1)
    g = g.replace(normal=turned, thickness=g.depth * noise[:, :1], object_id=(noise[:, :1] * 9e6).int())
    results = {"gi": noise, "composite": 3 * noise, "color": 3 * noise, "image": noise, "ao": noise[:, :1]}
    more = {"reflection_distance": 9 * noise[:, :1], "bent_normal": turned, "reflection": noise.flip(1)}
    behind = boxes.frame(boxes.camera(SIZE)).replace(gi=noise.flip(2))
    return frame.replace(gbuffer=g, behind=behind, extra={"moments": noise}, **results, **more)


def changed(a: Frame, b: Frame) -> set[str]:
    names = {name for name in a.present if not torch.equal(a.read(name), b.read(name))}
    return names | ({f"behind.{name}" for name in changed(a.behind, b.behind)} if a.behind and b.behind else set())


def test_half_rounds_colours_and_nothing_else(tmp_path: Path):
    frame = lit_frame()
    write_exr(tmp_path / "float.exr", frame)
    write_exr(tmp_path / "half.exr", frame, precision="half")
    back = read_exr(tmp_path / "half.exr")
    lost = changed(frame, back)
    assert {"gi", "composite", "image", "ao", "radiance", "behind.gi"} <= lost
    assert not lost & {*EXACT_NAMES, "hit", "object_id", "moments", "behind.depth", "behind.normal"}
    assert not changed(as_stored(frame, "half"), back)
    assert not changed(as_stored(back, "half"), back)
    assert not changed(as_stored(frame, "float"), frame)
    assert float((back.read("composite") / frame.read("composite") - 1).abs().max()) < 2**-11


def test_light_beyond_half_stays_finite_and_what_is_not_finite_stays(tmp_path: Path):
    frame = lit_frame()
    light = frame.read("radiance").clone()
    light[0, 0, 0, :4] = torch.tensor([1e6, -1e6, torch.inf, torch.nan])
    write_exr(tmp_path / "a.exr", frame.replace(radiance=light), precision="half")
    found = read_exr(tmp_path / "a.exr").read("radiance")[0, 0, 0, :4]
    assert found[:3].tolist() == [65504, -65504, float("inf")]
    assert found[3].isnan()


def test_dwaa_hurts_coloured_results_alone(tmp_path: Path):
    frame = as_stored(lit_frame(), "half")
    write_exr(tmp_path / "zip.exr", frame, precision="half")
    write_exr(tmp_path / "dwaa.exr", frame, precision="half", compression="dwaa")
    lost = changed(frame, read_exr(tmp_path / "dwaa.exr"))
    assert lost == {"gi", "reflection", "composite", "color", "image", "behind.gi"}
    error = (read_exr(tmp_path / "dwaa.exr").read("image") - frame.read("image")).abs().max()
    assert float(error) < 0.1  # of noise, the worst there is


def test_half_halves_colours(tmp_path: Path):
    sizes = []
    for precision in ("float", "half"):
        write_exr(tmp_path / "a.exr", lit_frame(), only=("color", "composite", "gi", "image"), precision=precision)
        sizes.append(os.path.getsize(tmp_path / "a.exr"))
    assert sizes[1] < 0.5 * sizes[0]


def test_only_some_layers(tmp_path: Path):
    frame = lit_frame()
    write_exr(tmp_path / "a.exr", frame, only=["image", "ao", "behind.gi"])
    header = OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True).parts[0].header
    layers = {channel.name.rpartition(".")[0] for channel in header["channels"]}
    assert layers == {"", "image", "ao", "behind.gi"}
    with pytest.raises(
        ValueError, match=r"a\.exr is no whole frame: it holds ao, image; .* write depth, hit, normal too"
    ):
        read_exr(tmp_path / "a.exr")
    write_exr(tmp_path / "b.exr", frame, only=["depth", "hit", "normal", "gi", "exposure", "moments", "behind"])
    back = read_exr(tmp_path / "b.exr")
    assert set(back.present) == {"depth", "hit", "normal", "gi", "moments"}
    assert back.behind is not None
    assert frame.behind is not None
    assert back.behind.present == frame.behind.present
    with pytest.raises(ValueError, match=r"only: the frame has no aoo; it holds depth"):
        write_exr(tmp_path / "c.exr", frame, only=["aoo", "gi"])
    for wrong, message in (({"precision": "double"}, "half or float"), ({"compression": "piz"}, "zip or dwaa")):
        with pytest.raises(ValueError, match=message):
            write_exr(tmp_path / "c.exr", frame, **wrong)  # pyright: ignore[reportArgumentType]
    assert not (tmp_path / "c.exr").exists()


@pytest.mark.parametrize("compression", ["zip", "dwaa"])
def test_openimageio_reads_the_layers(tmp_path: Path, compression: str):
    oiio = pytest.importorskip("OpenImageIO", reason="OpenImageIO is not installed: pip install gbufrt[dev]")
    frame = lit_frame()
    write_exr(tmp_path / "a.exr", frame, precision="half", compression=compression)  # pyright: ignore[reportArgumentType]
    file, found, kinds = oiio.ImageInput.open(str(tmp_path / "a.exr")), {}, {}
    part = 0
    while file.seek_subimage(part, 0):
        spec = file.spec()
        white = spec.getattribute("chromaticities")[6:]
        assert white == pytest.approx((0.3127, 0.329))
        pixels = file.read_image(part, 0, 0, spec.nchannels, oiio.FLOAT)
        formats = [str(f) for f in spec.channelformats] or [str(spec.format)] * spec.nchannels
        for n, name in enumerate(spec.channelnames):
            found[name], kinds[name] = pixels[..., n], formats[n]
        part += 1
    assert np.array_equal(found["depth.Z"], frame.gbuffer.depth[0, 0].numpy())  # the first row is the upper one
    assert np.array_equal(found["normal.Y"], frame.gbuffer.normal[0, 1].numpy())
    assert found["albedo.G"] == pytest.approx(frame.read("albedo")[0, 1].numpy(), rel=2**-11)
    assert found["G"] == pytest.approx(frame.read("color")[0, 1].numpy(), abs=1e-3 if compression == "zip" else 0.3)
    expected = {"depth.Z": "float", "motion.X": "float", "albedo.R": "half", "gi.R": "half", "object_id.X": "uint"}
    assert {name: kinds[name] for name in expected} == {**expected, "object_id.X": kinds["object_id.X"]}
    assert kinds["object_id.X"].startswith("uint")


COMPOSITOR = """
import sys
import bpy
import numpy as np
scene, tree = bpy.context.scene, bpy.data.node_groups.new("c", "CompositorNodeTree")
file = tree.nodes.new("CompositorNodeImage")
file.image = bpy.data.images.load(sys.argv[1])
try:
    file.layer = "?"
except TypeError as error:
    print(error)
for layer in sys.argv[3:]:
    file.layer = layer
    print(layer, sorted(output.name for output in file.outputs))
file.layer = "frame"
tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
out = tree.nodes.new("NodeGroupOutput")
tree.links.new(file.outputs["albedo"], out.inputs["Image"])
scene.compositing_node_group = tree
height, width = 72, 128
scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = width, height, 100
scene.render.image_settings.file_format = "OPEN_EXR"
scene.render.image_settings.color_depth = "32"
scene.render.filepath = sys.argv[2]
for thing in list(bpy.data.objects):
    bpy.data.objects.remove(thing)
camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
scene.collection.objects.link(camera)
scene.camera = camera
scene.render.engine = "CYCLES"
scene.cycles.samples = 1
scene.cycles.device = "CPU"
scene.render.threads_mode, scene.render.threads = "FIXED", 1
bpy.ops.render.render(write_still=True)
"""


def test_blender_composites_the_layers(tmp_path: Path):
    """Run in a Python that has bpy, which `GBUFRT_BPY` may give a folder to import from."""
    there = {"PYTHONPATH": os.environ.get("GBUFRT_BPY", "")}
    has = subprocess.run([sys.executable, "-c", "import bpy"], env={**os.environ, **there}, capture_output=True)
    if has.returncode:
        pytest.skip("bpy is not installed: pip install bpy, or set GBUFRT_BPY to the folder that it is in")
    frame = lit_frame()
    write_exr(tmp_path / "a.exr", frame, precision="half")
    command = [
        sys.executable,
        "-c",
        COMPOSITOR,
        str(tmp_path / "a.exr"),
        str(tmp_path / "b.exr"),
        "frame",
        "frame.behind",
    ]
    told = subprocess.run(command, env={**os.environ, **there}, capture_output=True, text=True, timeout=120)
    assert told.returncode == 0, told.stderr
    lines = told.stdout.splitlines()
    for layer, names in (("frame", ("depth", "normal", "ao", "gi", "image")), ("frame.behind", ("depth", "gi"))):
        line = next(line for line in lines if line.startswith(f"{layer} ["))
        assert all(f"'{name}'" in line for name in names), line
    made = OpenEXR.File(str(tmp_path / "b.exr"), separate_channels=True).parts[0].channels
    plane = next(channel.pixels for name, channel in made.items() if name.rpartition(".")[2] == "R")
    assert plane == pytest.approx(frame.read("albedo")[0, 0].numpy(), abs=1e-3)


def test_files_have_the_ending_of_what_they_are(tmp_path: Path) -> None:
    frame = boxes.frame(boxes.camera((4, 6)))
    with pytest.raises(ValueError, match=r"path must end in \.exr, got 'a.png'; gbufrt\.files\.png\.write_png writes"):
        write_exr(tmp_path / "a.png", frame)
    with pytest.raises(ValueError, match=r"path must end in \.png, got 'a.exr'; gbufrt\.files\.exr\.write_exr writes"):
        write_png(tmp_path / "a.exr", frame.read("radiance"))
    assert not list(tmp_path.iterdir())
    write_exr(tmp_path / "a.EXR", frame)
