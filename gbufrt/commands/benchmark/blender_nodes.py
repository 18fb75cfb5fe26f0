"""Blender's compositor over pictures: a script for a Python that has bpy. It imports nothing else of gbufrt.

``python -P blender_nodes.py FOLDER`` does the jobs of ``FOLDER/jobs.json``; see `Job` in the file blender.py. A job
reads a picture for each socket, ``NAME_SOCKET.npy`` ``(H, W, C)`` float32 with the top row first, and makes
``NAME.npy``. ``done.json`` holds Blender's version and the median milliseconds of each job's node.

Conventions of Blender 5.0, as blurred squares show them: a speed is previous minus current in its first two channels
and current minus next in the others, in pixels with y up; a shutter of 1 is half a frame before and half a frame after;
depth is planar; a lens has the discs of `post.lens.thin_lens.circle_of_confusion`, in whole pixels.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from statistics import median
from typing import Any

import bpy  # pyright: ignore[reportMissingImports]
import numpy as np

SENSOR_MM = 36.0
MM = 1e-3


def main(folder: Path) -> None:
    """Do all jobs of a folder."""
    times = []
    for job in json.loads((folder / "jobs.json").read_text()):
        name = job["name"]
        pictures = {socket: np.load(folder / f"{name}_{socket}.npy") for socket in job["inputs"]}
        without = [render(pictures, None, {}) for _ in range(4)][1:]  # the first also allocates
        took = [render(pictures, job["node"], job["settings"]) for _ in range(job["repeats"])]
        times.append((median(took) - median(without)) * 1e3)
        np.save(folder / f"{name}.npy", result(folder / "result.exr"))
    (folder / "done.json").write_text(json.dumps({"version": bpy.app.version_string, "ms": times}))


def render(pictures: dict[str, Any], node: str | None, settings: dict[str, Any]) -> float:
    """Seconds of compositing: the picture ``Image`` as it is, or through a node."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    picture = scene.render
    picture.resolution_y, picture.resolution_x = pictures["Image"].shape[:2]
    picture.resolution_percentage = 100
    picture.compositor_device, picture.compositor_precision = "CPU", "FULL"
    tree = bpy.data.node_groups.new("compositor", "CompositorNodeTree")
    tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    scene.compositing_node_group = tree
    end = tree.nodes.new("NodeGroupOutput").inputs[0]
    if node is None:
        tree.links.new(source(tree, pictures["Image"]), end)
    else:
        effect = tree.nodes.new(node)
        for name, values in pictures.items():
            tree.links.new(source(tree, values), effect.inputs[name])
        configure(scene, effect, settings)
        tree.links.new(effect.outputs["Image"], end)
    begun = time.perf_counter()
    bpy.ops.render.render()
    return time.perf_counter() - begun


def source(tree: Any, values: np.ndarray) -> Any:
    """The output of a new image node. A socket for one number takes the luminance: all channels are alike for it."""
    height, width, count = values.shape
    rgba = np.ones((height, width, 4), np.float32)
    rgba[..., : max(count, 3)] = values[::-1]
    image = bpy.data.images.new("input", width, height, alpha=True, float_buffer=True)
    image.colorspace_settings.name = "Non-Color"
    image.alpha_mode = "CHANNEL_PACKED"
    image.pixels.foreach_set(rgba.ravel())
    node = tree.nodes.new("CompositorNodeImage")
    node.image = image
    return node.outputs["Image"]


def configure(scene: Any, effect: Any, settings: dict[str, Any]) -> None:
    """Samples and shutter; or the camera and its lens, with world units as metres."""
    for name, value in settings.get("sockets", {}).items():
        effect.inputs[name].default_value = value
    lens = settings.get("lens")
    if lens is None:
        return
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    scene.collection.objects.link(camera)
    scene.camera = camera
    data, focus = camera.data, lens["focus_distance"]
    data.sensor_fit, data.sensor_width = "HORIZONTAL", SENSOR_MM
    data.lens = SENSOR_MM * lens["focal_px"] / scene.render.resolution_x
    data.dof.use_dof, data.dof.focus_distance = True, focus
    focal = data.lens * MM
    effect.scene, effect.use_zbuffer, effect.bokeh = scene, True, "CIRCLE"
    effect.f_stop = (
        focal / (2 * lens["aperture_radius"]) * focus / (focus - focal)
    )  # the sensor stands behind the focus
    effect.blur_max = lens["max_radius_px"]


def result(path: Path) -> np.ndarray:
    """``(H, W, 3)``: what was rendered last."""
    settings = bpy.context.scene.render.image_settings
    settings.file_format, settings.color_depth, settings.exr_codec = "OPEN_EXR", "32", "NONE"
    bpy.data.images["Render Result"].save_render(str(path))
    image = bpy.data.images.load(str(path))
    image.colorspace_settings.name = "Non-Color"
    width, height = image.size
    rgba = np.empty(height * width * 4, np.float32)
    image.pixels.foreach_get(rgba)
    return np.ascontiguousarray(rgba.reshape(height, width, 4)[::-1, :, :3])


if __name__ == "__main__":
    main(Path(sys.argv[1]))
