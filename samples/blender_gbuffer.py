"""G-buffers from Blender 4.2 or later: passes set up, frames rendered as EXR, and the camera of each.

blender -b scene.blend -P samples/blender_gbuffer.py -- OUT
gbufrt post OUT --from blender --camera OUT/camera.toml --out finished

Where the module bpy is installed, `python samples/blender_gbuffer.py OUT scene.blend` does the first step. Layers of
finished/frame_0001.exr (ao, gi, reflection, bent_normal...) are outputs of an Image node in Blender's compositor.
"""

import sys
from pathlib import Path

import bpy  # pyright: ignore[reportMissingImports]

LIGHT = [f"{lobe}_{part}" for lobe in ("diffuse", "glossy", "transmission") for part in ("direct", "color")]
AOVS = {"Base Color": "COLOR", "Roughness": "VALUE", "Metallic": "VALUE"}  # inputs of the Principled BSDF

out, *blend = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]
if blend:
    bpy.ops.wm.open_mainfile(filepath=blend[0])
scene, render, folder = bpy.context.scene, bpy.context.scene.render, Path(out).resolve()
if scene.camera is None or (kind := scene.camera.data.type) not in ("PERSP", "ORTHO"):
    sys.exit("the scene's camera must be perspective or orthographic; give it another")
for layer in scene.view_layers:
    for name in ("z", "vector", "normal", "emit", "environment", *LIGHT):
        setattr(layer, f"use_pass_{name}", name != "vector" or kind == "PERSP")  # wrong in Blender where orthographic
    for name, sort in AOVS.items():
        (aov := layer.aovs.add()).name, aov.type = name, sort
(plain := bpy.data.materials.new("plain")).use_nodes = True
for mesh in [mesh for mesh in bpy.data.meshes if not any(mesh.materials)]:
    mesh.materials.append(plain)
for material, tree in [(m, m.node_tree) for m in bpy.data.materials if m.node_tree]:
    shader = next((node for node in tree.nodes if node.type == "BSDF_PRINCIPLED"), None)
    other = {"Base Color": material.diffuse_color, "Roughness": 1.0, "Metallic": 0.0}  # of other shaders
    for name, sort in AOVS.items():
        node = tree.nodes.new("ShaderNodeOutputAOV")
        node.aov_name, target = name, node.inputs["Color" if sort == "COLOR" else "Value"]
        target.default_value = shader.inputs[name].default_value if shader else other[name]
        for link in shader.inputs[name].links if shader else ():
            tree.links.new(link.from_socket, target)

render.use_motion_blur = render.use_multiview = render.use_crop_to_border = False  # no motion vectors with blur
scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BOX", 0.01  # one point a pixel, as G-buffers are sampled
if hasattr(image := render.image_settings, "media_type"):  # from Blender 5.0 on; its files of several parts, which
    image.media_type, image.use_exr_interleave = "MULTI_LAYER_IMAGE", True  # this avoids, fail on pixels not square
image.file_format, image.color_depth, image.exr_codec = "OPEN_EXR_MULTILAYER", "32", "ZIP"

w, h = (round(s * render.resolution_percentage / 100) for s in (render.resolution_x, render.resolution_y))
shape = {"x": w, "y": h, "scale_x": render.pixel_aspect_x, "scale_y": render.pixel_aspect_y}
lines = ['convention = "opengl"\nup = "z"', f"far = {2 * scene.camera.data.clip_end}"]
for number in range(scene.frame_start, scene.frame_end + 1):
    scene.frame_set(number)
    render.filepath = str(folder / f"frame_{number:04}.exr")
    bpy.ops.render.render(write_still=True)
    camera = scene.camera.evaluated_get(graph := bpy.context.evaluated_depsgraph_get())
    (a, _, p, x), (_, b, q, y), _, (*_, parallel) = camera.calc_matrix_camera(graph, **shape)
    k = [[a * w / 2, 0.0, (1 - p + x) * w / 2], [0.0, b * h / 2, (1 + q - y) * h / 2], [0.0, 0.0, 1.0]]
    rows, flat = [list(row) for row in camera.matrix_world.normalized()], "true" if parallel else "false"
    lines.append(f"[[frames]]\nnumber = {number}\nworld_from_view = {rows}\nintrinsics = {k}\northographic = {flat}")
(folder / "camera.toml").write_text("\n".join(lines) + "\n")
