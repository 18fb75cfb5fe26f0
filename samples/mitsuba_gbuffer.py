"""G-buffers from Mitsuba 3: the surface at the middle of each pixel, direct light, and the camera.

python samples/mitsuba_gbuffer.py OUT [scene.xml]     # Mitsuba's own Cornell box without a scene
gbufrt post OUT --from mitsuba --camera OUT/camera.toml --out finished

Each sensor of the scene makes a frame. Surface and light are rendered apart, because depth must not be a mean of
several surfaces, and light should be one of many samples.
"""

import math
import sys
from pathlib import Path

import mitsuba as mi  # pyright: ignore[reportMissingImports]
import numpy as np

SAMPLES = 64  # of light, a pixel
AOVS = {"type": "aov", "aovs": "depth:depth,normal:sh_normal,albedo:albedo"}
FILM = {"type": "hdrfilm", "pixel_format": "rgb", "component_format": "float32", "rfilter": {"type": "box"}}
NEAR = 1e-4  # Mitsuba counts depth from the near plane
MIDDLE = {"type": "stratified", "sample_count": 1, "jitter": False}
NAMES = ("depth.T", "normal.X", "normal.Y", "normal.Z", "albedo.R", "albedo.G", "albedo.B")
LIGHT = ("direct.R", "direct.G", "direct.B")  # gbufrt's profile takes a layer called direct for direct light,
GLOW = ("emission.R", "emission.G", "emission.B")  # and what lamps in sight have lit already from one called emission

out, *path = sys.argv[1:]
mi.set_variant("scalar_rgb")  # llvm_ad_rgb is faster where LLVM is installed
scene = mi.load_file(path[0]) if path else mi.load_dict(mi.cornell_box())
Path(out).mkdir(parents=True, exist_ok=True)


def rendered(look: dict, integrator: dict, sampler: dict) -> np.ndarray:
    """What the integrator makes of the scene, (H, W, channels)."""
    sensor = mi.load_dict({**look, "sampler": sampler})
    return np.array(mi.render(scene, integrator=mi.load_dict(integrator), sensor=sensor))


lines = ['convention = "opengl"', 'up = "y"']  # "z" for scenes that are built so
for number, sensor in enumerate(scene.sensors()):
    x_fov, (width, height) = float(np.ravel(mi.traverse(sensor)["x_fov"])[0]), map(int, sensor.film().size())
    film = {**FILM, "width": width, "height": height}
    pose = sensor.world_transform()
    look = {"type": "perspective", "fov": x_fov, "fov_axis": "x", "near_clip": NEAR, "to_world": pose, "film": film}
    surface = rendered(look, AOVS, MIDDLE)
    light = rendered(look, {"type": "direct"}, {"type": "independent", "sample_count": SAMPLES})
    glow = rendered(look, {"type": "path", "max_depth": 1}, MIDDLE)
    pixels = np.concatenate([surface, light, glow], -1).astype(np.float32)
    picture = mi.Bitmap(pixels, mi.Bitmap.PixelFormat.MultiChannel, channel_names=[*NAMES, *LIGHT, *GLOW])
    picture.write(f"{out}/frame_{number:04}.exr")

    rows = np.array(pose.matrix).reshape(4, 4) @ np.diag([-1, 1, -1, 1])  # cameras there look along z, x to the left
    fov = math.degrees(2 * math.atan(math.tan(math.radians(x_fov) / 2) * height / width))
    lines.append(f"[[frames]]\nnumber = {number}\nworld_from_view = {rows.tolist()}\nfov = {fov}")
Path(out, "camera.toml").write_text("\n".join(lines) + "\n")
