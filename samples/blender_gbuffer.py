"""G-buffers from Blender 4.2 or later: passes set up, frames rendered as EXR, and the camera of each.

blender -b scene.blend -P samples/blender_gbuffer.py -- OUT
python samples/blender_gbuffer.py scene.blend OUT    # the same, where the module bpy is installed
gbufrt post OUT --from blender --camera OUT/camera.toml --out finished
"""

import sys
from pathlib import Path

import bpy  # pyright: ignore[reportMissingImports]

PASSES = [f"{lobe}_{part}" for lobe in ("diffuse", "glossy", "transmission") for part in ("direct", "color")]
INPUTS = {"Base Color": "COLOR", "Roughness": "VALUE", "Metallic": "VALUE"}  # of the Principled BSDF, and AOVs here
if bpy.app.module:
    bpy.ops.wm.open_mainfile(filepath=sys.argv[1])
folder, scene = Path(sys.argv[-1]).resolve(), bpy.context.scene
render, image = scene.render, scene.render.image_settings
if scene.camera is None or scene.camera.data.type not in ("PERSP", "ORTHO"):
    sys.exit("the scene's camera must be perspective or orthographic; give it another")
for layer in scene.view_layers:
    for name in ("z", "normal", "emit", "environment", "transmission_indirect", *PASSES):
        setattr(layer, f"use_pass_{name}", True)
    layer.use_pass_vector = scene.camera.data.type == "PERSP"  # wrong in Blender where orthographic
    for name, kind in INPUTS.items():
        aov = layer.aovs.add()
        aov.name, aov.type = name, kind
plain, plain.use_nodes = bpy.data.materials.new("plain"), True
for mesh in [mesh for mesh in bpy.data.meshes if not any(mesh.materials)]:
    mesh.materials.append(plain)
for material in [material for material in bpy.data.materials if material.node_tree]:
    tree, defaults = material.node_tree, {"Base Color": material.diffuse_color, "Roughness": 1.0, "Alpha": 1.0}
    shader = next((node.inputs for node in tree.nodes if node.type == "BSDF_PRINCIPLED"), None)
    for name, kind in INPUTS.items():
        aov, shown = tree.nodes.new("ShaderNodeOutputAOV"), tree.nodes.new("ShaderNodeVectorMath")
        aov.aov_name, shown.operation = name, "MULTIPLY"  # by alpha: Blender adds what is behind
        tree.links.new(shown.outputs[0], aov.inputs[kind.capitalize()])
        for target, key in zip(shown.inputs[:2], (name, "Alpha"), strict=True):
            value = shader[key].default_value if shader else defaults.get(key, 0.0)
            target.default_value = value[:3] if key == "Base Color" else [value] * 3
            for link in shader[key].links if shader else ():
                tree.links.new(link.from_socket, target)
render.use_motion_blur = render.use_multiview = render.use_crop_to_border = False  # no motion vectors with blur
scene.cycles.pixel_filter_type = "BOX"  # a pixel wide: colours are means over a pixel, depth is that of its middle
if bpy.app.version >= (5, 0):  # its files of several parts, which this avoids, fail on pixels not square
    image.media_type, image.use_exr_interleave = "MULTI_LAYER_IMAGE", True
image.file_format, image.color_depth, image.exr_codec = "OPEN_EXR_MULTILAYER", "32", "ZIP"
w, h = (round(n * render.resolution_percentage / 100) for n in (render.resolution_x, render.resolution_y))
shape = {"x": w, "y": h, "scale_x": render.pixel_aspect_x, "scale_y": render.pixel_aspect_y}
cameras = f'convention = "opengl"\nup = "z"\nfar = {2 * scene.camera.data.clip_end}\n'
for number in range(scene.frame_start, scene.frame_end + 1):
    scene.frame_set(number)
    render.filepath = str(folder / f"frame_{number:04}.exr")
    bpy.ops.render.render(write_still=True)
    camera = scene.camera.evaluated_get(graph := bpy.context.evaluated_depsgraph_get())
    (a, _, p, x), (_, b, q, y), _, (*_, flat) = camera.calc_matrix_camera(graph, **shape)  # flat: 1 if orthographic
    pixels = [[a * w / 2, 0.0, (1 - p + x) * w / 2], [0.0, b * h / 2, (1 + q - y) * h / 2], [0.0, 0.0, 1.0]]
    cameras += f"[[frames]]\nnumber = {number}\nintrinsics = {pixels}\northographic = {str(flat == 1).lower()}\n"
    cameras += f"world_from_view = {[list(row) for row in camera.matrix_world.normalized()]}\n"
(folder / "camera.toml").write_text(cameras)
