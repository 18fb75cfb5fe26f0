"""Signals of a small frame by kernels, for tests that compare their forms. Run as a script, it answers in the CUDA form
by numba's simulator and saves what it finds, with the names of the bodies that ran:
``NUMBA_ENABLE_CUDASIM=1 python forms.py FILE``."""

from __future__ import annotations

from typing import Any

import boxes
import torch
from simulated import save
from torch import Tensor

from gbufrt import Frame
from gbufrt.atmosphere import Atmosphere
from gbufrt.atmosphere.rays import marched
from gbufrt.atmosphere.tables import DTYPE, Tables
from post.display.op import darkened, encoded, tone_curve
from post.filters.around import kindred
from post.filters.fxaa_op import smooth_stairs
from post.filters.op import bilateral_limits, joint_bilateral, moments, wavelet
from post.filters.regression import fitted, with_places
from post.filters.surfaces import surface
from post.filters.units import unit_vectors
from post.history.changes import follow_changes
from post.history.op import anti_alias, blended, taken_in
from post.history.read import read_history
from post.history.virtual import closer, virtual_motion
from post.lens.arc_op import turned
from post.lens.op import blur_alike, reconstruct
from post.march.rays import depth_hierarchy, march_rays
from post.passes.lens.depth_of_field import depth_of_field
from post.passes.lens.taa import ray_matrix
from post.passes.lens.upscale import upscale
from post.passes.light.ssgi import ssgi
from post.passes.light.ssr import ssr
from post.shading.composite_op import specular_albedo, sum_light
from post.shading.fireflies import without_lone_fireflies
from post.sweep.bitmask import bitmask_ao
from post.sweep.thickness import planar_thickness
from post.upsampling.op import upsample

SIZE = (10, 14)
SWEEP = {"directions": 2, "steps": 3}


def answers(device: str = "cpu") -> dict[str, Tensor]:
    """Occlusion within two radii, gathered light, reflections, where rays along the normals end; and `of_pixels`."""
    frame = boxes.frame(boxes.camera(SIZE)).to(device)
    g, light, albedo = frame.gbuffer, frame.read("radiance"), frame.read("albedo")
    given: dict[str, Any] = {"hit": g.hit, "thickness": g.thickness}
    roughness = torch.full_like(g.depth, 0.2)
    ao, bent = bitmask_ao(g.depth, g.normal, g.camera, radius=2.0, scales=2, **SWEEP, **given)
    gi, sky, _ = ssgi(g.depth, g.normal, g.camera, light=light, albedo=albedo, **SWEEP, **given)
    mirrored = ssr(
        g.depth,
        g.normal,
        g.camera,
        light,
        roughness,
        f0=albedo,
        metallic=albedo[:, :1],
        environment=light[:, :, :4, :8],
        samples=2,
        **given,
    )
    hierarchy = depth_hierarchy(g.depth, g.normal, g.camera, **given)
    ends = march_rays(hierarchy, g.camera.unproject(g.depth), g.camera.rotate_to_view(g.normal), g.camera)
    found = {"ao": ao, "bent": bent, "gi": gi, "sky": sky, "reflection": mirrored[0], "confidence": mirrored[1]}
    found |= {"ray": torch.cat([ends.px, ends.distance, ends.hit.float(), ends.blocked.float()], dim=1)}
    return {
        name: value.cpu()
        for name, value in {
            **found,
            **of_pixels(frame),
            **of_sums(frame),
            **of_filters(frame),
            **of_lens(frame),
            **of_upscale(device),
            **of_air(device),
        }.items()
    }


def of_pixels(frame: Frame) -> dict[str, Tensor]:
    """Anti-aliased, tone-mapped, upsampled and calmed light, depth of bodies, motion of images, and light of a frame
    before, read twice."""
    g, light = frame.gbuffer, frame.read("radiance")
    before = boxes.frame(boxes.camera(SIZE, dx=0.35)).to(light.device).gbuffer
    geometry, moved = surface(g.depth, g.normal, g.hit, g.camera), light[:, :2] * 3 - 1
    sharp, found = (read_history(g, before, light, search=not how, sharp=how, lenient=not how) for how in (True, False))
    jitter, old = light.new_full((1, 2), 0.2), light.flip(3) / 2
    aliased = anti_alias(
        light,
        jitter,
        g.depth,
        moved,
        old,
        g.hit.float(),
        normal=g.normal,
        rays=ray_matrix(g.camera),
        blend=0.9,
        gamma=1.0,
    )
    return {
        "aliased": torch.cat(aliased, dim=1),
        "toned": tone_curve(light, light.new_full((), 2.0), "agx", 1.2, 1.2, 4.0),
        "encoded": encoded(light / 3),
        "darkened": darkened(light, 0.5, 0.2, 0.8),
        "smooth": smooth_stairs(light.clamp(0, 1), subpixel=0.75, edge_threshold=0.06, dark_threshold=0.02),
        "upsampled": upsample(light[..., 1::2, 1::2], geometry, offset=(1, 1)),
        "solid": planar_thickness(g.camera, g.depth, g.hit, light[:, :1] + 0.2, 0.1),
        "calmed": without_lone_fireflies(noise(light)[:, :3] ** 8, torch.full_like(g.depth, 0.1)),
        "image's motion": virtual_motion(g, before, light[:, :1]),
        "closer": closer(old, noise(light)[:, :3], light, g.hit).float(),
        "before": torch.cat([found.image, found.support, found.valid.float()], dim=1),
        "sharp before": torch.cat([sharp.image, sharp.support, sharp.valid.float()], dim=1),
    }


def of_sums(frame: Frame) -> dict[str, Tensor]:
    """All light of surfaces together, with each part and with one alone; what they reflect; and unit vectors."""
    g, light = frame.gbuffer, frame.read("radiance")
    grain = noise(light)
    mirrored, tilted = specular_albedo(g.replace(roughness=1.2 * grain[:, :1] - 0.1)), grain[:, 1:4] - 0.5
    parts = light / 3, grain[:, :3] / 5, 1.3 * grain[:, 3:4], light.flip(3), grain[:, 2:], light.flip(2), mirrored
    none = (None,) * 4
    formulas = [{"physical": physical, "intensities": (1.0, 0.7, 1.4)} for physical in (False, True)]
    return {
        "sum": sum_light(light, *parts, **formulas[1]),
        "sum of seed": sum_light(light, *parts, **formulas[0]),
        "sum of few": sum_light(light, None, None, parts[2], *none, **formulas[1]),
        "specular": mirrored,
        "units": unit_vectors(torch.where(grain[:, 4:] > 0.8, 0.0, tilted), g.normal),
    }


def of_filters(frame: Frame) -> dict[str, Tensor]:
    """Light with noise, filtered, and what is known of it first."""
    g, light = frame.gbuffer, frame.read("radiance")
    grain = noise(light)
    geometry = surface(g.depth, g.normal, g.hit, g.camera, grain[:, :1] / 9)
    values = torch.cat([light, light[:, :1]], dim=1) + grain[:, :4] / 2
    around = moments(values[:, 3:], geometry)
    known = around[:, :1], around[:, 1:]
    reach, tolerance = bilateral_limits(*known, sigma=2.0, sensitivity=0.7, phi_color=2.0)
    edge: dict[str, Any] = {"depth_sensitivity": 1.0, "normal_power": 40.0}
    smooth = wavelet(
        torch.cat([values, grain[:, 4:] / 9], dim=1), geometry, 0.05 * grain[:, 4:], step=2, phi_color=1.0,
        phi_depth=1.0, phi_normal=128.0,
    )  # fmt: skip
    planes = torch.cat([with_places(light), values[:, 3:], grain[:, 4:] / 9], dim=1)  # as many as a GPU's thread holds
    wide = wavelet(planes, geometry, 0 * grain[:, :1], step=1, phi_color=1.0, phi_depth=1.0, phi_normal=128.0)
    fast, age = values[:, :3] * (0.8 + 0.4 * grain[:, 1:4]), torch.floor(9 * grain[:, :1])
    state = torch.cat(
        [values * (0.6 + grain[:, 1:]), fast, fast[:, :1], fast[:, :1] ** 2 + 0.01, 1 / (1 + age), age], 1
    )
    bright = values * (1 + 9 * (grain[:, :1] > 0.9))
    sample = taken_in(bright, state, lead=3, firefly=3.0)
    changes = follow_changes(sample, state, g, lead=3, clamp=1.0)
    return {
        "accumulated": blended(sample.signal, state, 4 + 8 * grain[:, 4:], changes, lead=3),
        "sample": sample.signal,
        "changes": torch.cat(changes, dim=1),
        "guide": geometry.guide,
        "plane": geometry.plane,
        "moments": around,
        "limits": torch.cat([reach, tolerance], dim=1),
        "kindred": kindred(values, grain[:, 1:2], grain[:, 2:3] > 0.2, geometry, 2),
        "bilateral": joint_bilateral(values, geometry, reach, tolerance, radius=2, **edge),
        "wavelet": smooth,
        "fit": fitted(wide[:, :-2], wide[:, -1:]),
    }


def noise(like: Tensor) -> Tensor:
    """``(1, 5, H, W)`` in [0, 1)."""
    return torch.rand((1, 5, *SIZE), generator=torch.Generator().manual_seed(0)).to(like)


def of_lens(frame: Frame) -> dict[str, Tensor]:
    """Light behind a lens whose focus lies between the surfaces, and behind an open shutter."""
    g, light = frame.gbuffer, frame.read("radiance")
    lens: dict[str, Any] = {"hit": g.hit, "focus_distance": 9.0, "aperture_radius": 0.8, "max_radius_px": 5.0}
    lamp = light * (1 + 50 * (torch.arange(SIZE[1], device=light.device) % 5 == 0))
    path, moment = 8 * noise(light)[:, 1:3] - 3, noise(light)[0, 0]
    shutter: dict[str, Any] = {"opening": -0.5, "samples": 3, "softness": 0.05}
    return {
        "layers": depth_of_field(lamp, g.depth, g.camera, **lens),
        "turned": turned(0.1 * path),
        "alike": blur_alike(light, path, moment, opening=-0.5, samples=3),
        "blurred": reconstruct(light, g.depth, path, path.roll(2, 3), moment, **shutter),
    }


def of_upscale(device: str) -> dict[str, Tensor]:
    """The second of two jittered frames from a camera that moves, half as large again, and its history."""
    light, history = torch.zeros(()), None
    for index, place in enumerate(((0.3, -0.2), (-0.4, 0.1))):
        camera = boxes.camera(SIZE, dx=0.35 * index).with_jitter(torch.tensor([place]))
        frame = boxes.frame(camera, previous=boxes.camera(SIZE)).to(device)
        color = frame.read("radiance") * (0.2 + 3 * noise(frame.read("radiance"))[:, index : index + 3])
        light, history = upscale(color, frame.gbuffer, history, ratio=1.5, reactive=noise(color)[:, 4:])
    assert history is not None
    signals = history.signals["toned"], history.signals["planes"], history.length
    return {"upscaled": light, "upscaled history": torch.cat(signals, dim=1)}


def of_air(device: str) -> dict[str, Tensor]:
    """Light and transmittance along rays through air whose tables hold few entries, of chance."""
    chance = torch.Generator().manual_seed(3)
    sizes = (4, 5, 3), (3, 4, 5, 3, 6), (4, *SIZE)
    clear, again, rays = (torch.rand(size, dtype=DTYPE, generator=chance).to(device) for size in sizes)
    up, sun, between, height = rays
    found = marched(Tables(Atmosphere(), clear, again), height, up, sun, between, 50 * height, 5, slices=3)
    return {"air": torch.cat(found, dim=-1).flatten(2).permute(2, 0, 1)[None].float()}


if __name__ == "__main__":
    save(answers)
