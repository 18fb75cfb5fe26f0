"""The samples that make G-buffers in other renderers, run in these; their files go through the passes and back.

They run in a Python that has bpy or mitsuba, which `GBUFRT_BPY` and `GBUFRT_MITSUBA` may give a folder to import from.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
import torch
from command_line import run

import gbufrt
from gbufrt import Frame
from gbufrt.commands.foreign import Source
from gbufrt.files.exr import read_exr

SAMPLES = Path(gbufrt.__file__).parents[1] / "samples"
SIZE = (54, 96)

SCENE = """
import sys
from math import radians
import bpy
bpy.ops.wm.read_factory_settings(use_empty=True)
scene, render = bpy.context.scene, bpy.context.scene.render
render.engine, render.threads_mode, render.threads = "CYCLES", "FIXED", 1
scene.cycles.device, scene.cycles.samples = "CPU", 2
render.resolution_x, render.resolution_y, render.resolution_percentage = 192, 108, 50
scene.frame_start, scene.frame_end = 1, 2
bpy.ops.mesh.primitive_plane_add(size=40)
bpy.ops.mesh.primitive_cube_add(size=2, location=(-1.5, 0, 1))
cube = bpy.context.object
bpy.ops.mesh.primitive_uv_sphere_add(location=(1.6, 0, 1), segments=48, ring_count=24)
bpy.ops.object.shade_smooth()
gold = bpy.data.materials.new("gold")
gold.use_nodes = True
shader = gold.node_tree.nodes["Principled BSDF"].inputs
shader["Base Color"].default_value, shader["Roughness"].default_value = (0.9, 0.6, 0.2, 1), 0.15
shader["Metallic"].default_value = 1
bpy.context.object.data.materials.append(gold)
bpy.ops.mesh.primitive_plane_add(size=3, location=(1.6, -3, 1.5), rotation=(radians(90), 0, 0))
hole = bpy.data.materials.new("hole")  # such as between leaves: Blender adds up the AOVs of all it looks through
hole.use_nodes = True
hole.node_tree.nodes["Principled BSDF"].inputs["Alpha"].default_value = 0
bpy.context.object.data.materials.append(hole)
bpy.ops.object.light_add(type="SUN", rotation=(0.7, 0.4, 0))
bpy.context.object.data.energy = 3
camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
scene.collection.objects.link(camera)
scene.camera, camera.rotation_euler, camera.data.lens = camera, (radians(72), 0, radians(5)), 30
for number in (1, 2):
    camera.location, cube.location = (0.4 * number, -8, 3), (-1.5 + 0.2 * number, 0, 1)
    camera.keyframe_insert("location", frame=number)
    cube.keyframe_insert("location", frame=number)
bpy.ops.wm.save_as_mainfile(filepath=sys.argv[1])
"""

COMPOSITOR = """
import sys
import bpy
scene, tree = bpy.context.scene, bpy.data.node_groups.new("c", "CompositorNodeTree")
file = tree.nodes.new("CompositorNodeImage")
file.image = bpy.data.images.load(sys.argv[1])
file.layer = "frame"
tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
out = tree.nodes.new("NodeGroupOutput")
scene.compositing_node_group = tree
scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 96, 54, 100
scene.render.image_settings.file_format, scene.render.image_settings.color_depth = "OPEN_EXR", "32"
scene.render.engine, scene.cycles.samples, scene.cycles.device = "CYCLES", 1, "CPU"
scene.render.threads_mode, scene.render.threads = "FIXED", 1
for layer in sys.argv[3:]:
    tree.links.new(file.outputs[layer], out.inputs["Image"])
    scene.render.filepath = f"{sys.argv[2]}/{layer}.exr"
    bpy.ops.render.render(write_still=True)
"""

SENSOR = """
  <sensor type="perspective">
    <float name="fov" value="50"/>
    <transform name="to_world"><lookat origin="{x}, 2.5, 7" target="0, 1, 0" up="0, 1, 0"/></transform>
    <film type="hdrfilm"><integer name="width" value="96"/><integer name="height" value="54"/></film>
  </sensor>"""
MITSUBA = f"""<scene version="3.0.0">{SENSOR.format(x=0)}{SENSOR.format(x=0.5)}
  <shape type="rectangle">
    <transform name="to_world"><rotate x="1" angle="-90"/><scale value="20"/></transform>
  </shape>
  <shape type="cube">
    <bsdf type="diffuse"><rgb name="reflectance" value="0.8, 0.1, 0.1"/></bsdf>
    <transform name="to_world"><translate y="1"/></transform>
  </shape>
  <shape type="sphere">
    <point name="center" x="2.5" y="2.5" z="0"/><float name="radius" value="0.3"/>
    <emitter type="area"><rgb name="radiance" value="2"/></emitter>
  </shape>
  <shape type="sphere">
    <bsdf type="roughconductor"><float name="alpha" value="0.09"/><string name="material" value="Au"/></bsdf>
    <point name="center" x="-2.5" y="0.8" z="0"/><float name="radius" value="0.8"/>
  </shape>
  <shape type="sphere">
    <bsdf type="dielectric"/><point name="center" x="2.5" y="0.8" z="0"/><float name="radius" value="0.8"/>
  </shape>
  <emitter type="directional"><vector name="direction" x="1" y="-2" z="-1"/></emitter>
  <emitter type="constant"><rgb name="radiance" value="0.3"/></emitter>
</scene>"""


def renderer(module: str, variable: str) -> dict[str, str]:
    """The environment in which Python has a renderer's module; skips where there is none."""
    path = os.pathsep.join(filter(None, (os.environ.get(variable), os.environ.get("PYTHONPATH"))))
    environment = {**os.environ, "PYTHONPATH": path}
    if subprocess.run([sys.executable, "-c", f"import {module}"], env=environment, capture_output=True).returncode:
        pytest.skip(f"{module} is not installed: pip install {module}, or set {variable} to the folder that it is in")
    return environment


def python(environment: dict[str, str], *arguments: object) -> None:
    command = [sys.executable, *map(str, arguments)]
    told = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120)
    assert told.returncode == 0, told.stdout + told.stderr


def finished(folder: Path, profile: str, *passes: str) -> list[Frame]:
    """The results of `gbufrt post` over a folder of the sample."""
    camera, out = folder / "camera.toml", folder / "finished"
    options = ("--preset", "low", "--warmup", "0", *passes)
    assert run("post", folder, "--from", profile, "--camera", camera, *options, "--out", out) == 0
    return [read_exr(path) for path in sorted(out.glob("*.exr"))]


@pytest.fixture(scope="module")
def blender(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the sample's two frames of a cube that moves and a ball of gold, under a camera that moves."""
    environment, folder = renderer("bpy", "GBUFRT_BPY"), tmp_path_factory.mktemp("blender")
    python(environment, "-c", SCENE, folder / "scene.blend")
    python(environment, SAMPLES / "blender_gbuffer.py", folder / "scene.blend", folder / "frames")
    return folder / "frames"


def test_blender_gives_a_whole_g_buffer(blender: Path, capfd) -> None:
    source = Source.of(sorted(blender.glob("*.exr")), "auto", blender / "camera.toml", None)
    _, frame = source.frames()
    told, g = capfd.readouterr().err, frame.gbuffer
    assert "blender (100% sure" in told
    assert "fits better" not in told
    frame.validate()
    assert g.camera.size == SIZE
    assert g.metallic is not None
    assert g.roughness is not None
    assert g.albedo is not None
    assert g.motion is not None
    assert g.previous_camera is not None
    ball = g.metallic[0, 0] > 0.5
    assert 200 < int(ball.sum()) < 1000
    assert torch.allclose(g.albedo[0][:, ball].mean(1), torch.tensor([0.9, 0.6, 0.2]), atol=1e-3)
    assert float(g.roughness[0, 0][ball].mean()) == pytest.approx(0.15, abs=1e-3)
    moves = (g.motion - g.camera.static_motion(g.previous_camera, g.depth, g.hit)[0]).norm(dim=1)[0] > 0.1
    assert int(moves.sum()) > 300  # the cube
    assert float(g.motion.norm(dim=1)[0][~moves].max()) > 1


def test_what_the_passes_add_composites_in_blender(blender: Path, tmp_path: Path) -> None:
    frame = finished(blender, "blender")[-1]
    layers = ("ao", "gi", "reflection", "bent_normal")
    python(renderer("bpy", "GBUFRT_BPY"), "-c", COMPOSITOR, blender / "finished/frame_0002.exr", tmp_path, *layers)
    for name in layers:
        channels = OpenEXR.File(str(tmp_path / f"{name}.exr"), separate_channels=True).parts[0].channels
        made = np.stack([next(c.pixels for n, c in channels.items() if n.rpartition(".")[2] == end) for end in "RGB"])
        wanted = frame.read(name)[0].expand(3, *SIZE).numpy()
        assert made == pytest.approx(wanted, abs=2e-3), name
        assert wanted.std() > 0.01, name


def test_mitsuba_gives_a_surface_a_pixel_and_direct_light(tmp_path: Path, capfd) -> None:
    environment = renderer("mitsuba", "GBUFRT_MITSUBA")
    scene = tmp_path / "scene.xml"
    scene.write_text(MITSUBA)
    python(environment, SAMPLES / "mitsuba_gbuffer.py", tmp_path / "frames", scene)
    _, frame = finished(tmp_path / "frames", "auto")
    told, g = capfd.readouterr().err, frame.gbuffer
    assert "mitsuba (100% sure" in told
    assert "fits better" not in told
    frame.validate()
    assert g.camera.position[0].tolist() == pytest.approx([0.5, 2.5, 7])
    x, y, z = g.camera.to_world(g.camera.unproject(g.depth))[0]
    cube = (frame.read("albedo")[0, 0] > 0.7) & (frame.read("albedo")[0, 1] < 0.2)
    lamp = frame.read("emission")[0].amin(0) > 0
    assert 10 < int(lamp.sum()) < 200
    assert float(frame.read("radiance")[0, :, lamp].median()) == float(frame.read("emission")[0, :, lamp].min()) == 2
    assert frame.emitters_mirrored
    gold, rough = frame.read("metallic")[0, 0] > 0.5, frame.read("roughness")[0, 0]
    assert 50 < int(gold.sum()) < 500
    assert float(rough[gold].mean()) == pytest.approx(0.3, abs=1e-3)  # alpha is its square
    assert frame.read("albedo")[0][:, gold].mean(1).tolist() == pytest.approx([0.97, 0.8, 0.32], abs=0.02)
    glass = g.hit[0, 0] & ~lamp & (frame.read("albedo")[0].amax(0) == 0)
    assert 50 < int(glass.sum()) < 500
    assert float(frame.read("radiance")[0].mean(0)[glass].median()) > 0.1  # the floor behind it
    assert float(rough[glass].min()) == 1
    floor = g.hit[0, 0] & ~cube & ~lamp & ~gold & ~glass
    assert 300 < int(cube.sum()) < 1500
    assert float(y[floor].abs().max()) < 2e-3
    assert float((torch.stack([x, y - 1, z]).abs().amax(0)[cube] - 1).abs().max()) < 2e-3
    assert float(frame.read("reflection")[0].mean(0)[gold].mean()) > 0.05
    assert float(frame.read("gi")[0, 0][floor].max()) > 0.02  # red of the cube
