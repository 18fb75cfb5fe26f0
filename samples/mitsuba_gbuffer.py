"""G-buffers from Mitsuba 3: the surface at the middle of each pixel, direct light of 64 samples, and the camera.

python samples/mitsuba_gbuffer.py OUT [scene.xml]     # Mitsuba's own Cornell box without a scene
gbufrt post OUT --from mitsuba --camera OUT/camera.toml --out finished

A frame a sensor. Glass has all of its light, as no pass makes what it shows, and counts as black and rough.
"""

import sys
from pathlib import Path

import mitsuba as mi  # pyright: ignore[reportMissingImports]
import numpy as np

LOOK = {"type": "perspective", "fov_axis": "x", "near_clip": 1e-4}  # Mitsuba counts depth from the near plane
FILM = {"type": "hdrfilm", "pixel_format": "rgb", "component_format": "float32", "rfilter": {"type": "box"}}
SAMPLERS = {"type": "stratified", "sample_count": 1, "jitter": False}, {"type": "independent", "sample_count": 64}
LAYERS = {"direct": "RGB", "depth": "T", "normal": "XYZ", "albedo": "RGB", "emission": "RGB"}
NAMES = [*(f"{name}.{end}" for name, ends in LAYERS.items() for end in ends), "roughness", "metallic"]
out, *path = sys.argv[1:]
mi.set_variant("scalar_rgb")  # which `Surface` is written for
mi.set_log_level(mi.LogLevel.Error)  # it need not be fast
KINDS = mi.BSDFFlags.DiffuseReflection, mi.BSDFFlags.Transmission, mi.BSDFFlags.DeltaReflection


class Surface(mi.SamplingIntegrator):
    aov_names = lambda self: [*NAMES[3:], "glass"]

    def sample(self, scene, sampler, ray, medium=None, active=True):
        if not (hit := scene.ray_intersect(ray)).is_valid():
            return 0.0, False, [0.0] * 13
        bsdf, lamp, normal = hit.bsdf(), hit.emitter(scene), hit.sh_frame.n
        diffuse, through, sharp = (mi.has_flag(bsdf.flags(), kind) for kind in KINDS)
        glass, glow = through and not diffuse, [0.0] * 3 if lamp is None else lamp.eval(hit)
        told = lambda name, other: bsdf.eval_attribute_1(name, hit) if bsdf.has_attribute(name) else other
        alpha = told("alpha", max(told("alpha_u", 0.0), told("alpha_v", 0.0)) or 1.0 - sharp)
        hit.wi = [0.0, 0.0, 1.0]  # metals have the colour that they reflect straight back
        color = bsdf.eval_diffuse_reflectance(hit) if diffuse else bsdf.sample(mi.BSDFContext(), hit, 0.5, [0.5] * 2)[1]
        made = [*color, *glow, told("roughness", alpha**0.5), told("metallic", 1.0 - diffuse), 0.0]
        return 0.0, True, [hit.t, *normal, *([0.0, 0.0, 0.0, *glow, 1.0, 0.0, 1.0] if glass else made)]


mi.register_integrator("surface", Surface)
scene, load = mi.load_file(path[0]) if path else mi.load_dict(mi.cornell_box()), mi.load_dict
picture = lambda kind, sensor: np.array(mi.render(scene, sensor=sensor, integrator=load({"type": kind})))
Path(out).mkdir(parents=True, exist_ok=True)
lines = ['convention = "opengl"', 'up = "y"']  # "z" for scenes that are built so
for number, sensor in enumerate(scene.sensors()):
    fov, (width, height) = float(np.ravel(mi.traverse(sensor)["x_fov"])[0]), map(int, sensor.film().size())
    pose, film = sensor.world_transform(), {**FILM, "width": width, "height": height}
    middle, many = (load({**LOOK, "fov": fov, "to_world": pose, "film": film, "sampler": by}) for by in SAMPLERS)
    surface, light = picture("surface", middle)[..., 3:], picture("direct", many)
    if (glass := surface[..., -1:] > 0).any():
        light = np.where(glass, picture("path", many), light)
    pixels = np.concatenate([light, surface[..., :-1]], -1).astype(np.float32)
    mi.Bitmap(pixels, mi.Bitmap.PixelFormat.MultiChannel, channel_names=NAMES).write(f"{out}/frame_{number:04}.exr")
    rows = np.array(pose.matrix).reshape(4, 4) @ np.diag([-1, 1, -1, 1])  # cameras there look along z, x to the left
    fov = np.degrees(2 * np.arctan(np.tan(np.radians(fov) / 2) * height / width))
    lines.append(f"[[frames]]\nnumber = {number}\nworld_from_view = {rows.tolist()}\nfov = {fov}")
Path(out, "camera.toml").write_text("\n".join(lines) + "\n")
