"""The tracer: voxel worlds, the G-buffers and direct light that a camera sees of them, and ray-traced truth."""

import gbufrt as gbufrt  # first: says how threads wait, before torch is loaded
from tracer.cache.irradiance import IrradianceCache
from tracer.formats.vox.scene_graph import load_vox_scene, read_vox
from tracer.frames import render
from tracer.gbuffers import gbuffer
from tracer.paths.one_sample import SampledLight, brightest_a_stratum, one_a_stratum, sample_light
from tracer.paths.sampled import sampled, sampled_with_cache
from tracer.scene.daylight import SunPath, at_hour
from tracer.scene.fog import Fog
from tracer.scene.material import Material, MaterialTable
from tracer.scene.scene import (
    MASK_ALL,
    MASK_PRIMARY,
    MASK_SECONDARY,
    MASK_SHADOW,
    Haze,
    Instance,
    Plain,
    Scene,
    Sky,
    Sun,
)
from tracer.scene.view import View
from tracer.scene.weather import Rain, Waves
from tracer.scene.world import World
from tracer.traversal.hits import Hits, Place
from tracer.traversal.programs import HitGroup, Launch, RayType, dispatch
from tracer.traversal.rays import trace, transmission
from tracer.truth.fog import fog_truth
from tracer.truth.one_path import one_path
from tracer.truth.truth import (
    Truth,
    ambient_occlusion,
    focus_distance,
    indirect_diffuse,
    light_truth,
    path_trace,
    reflection,
)
from tracer.weather.rain import raining
from tracer.worlds import WORLDS, load
from tracer.worlds.regions.stream import Stream, stream

__all__ = [
    "MASK_ALL",
    "MASK_PRIMARY",
    "MASK_SECONDARY",
    "MASK_SHADOW",
    "WORLDS",
    "Fog",
    "Haze",
    "HitGroup",
    "Hits",
    "Instance",
    "IrradianceCache",
    "Launch",
    "Material",
    "MaterialTable",
    "Place",
    "Plain",
    "Rain",
    "RayType",
    "SampledLight",
    "Scene",
    "Sky",
    "Stream",
    "Sun",
    "SunPath",
    "Truth",
    "View",
    "Waves",
    "World",
    "ambient_occlusion",
    "at_hour",
    "brightest_a_stratum",
    "dispatch",
    "focus_distance",
    "fog_truth",
    "gbuffer",
    "indirect_diffuse",
    "light_truth",
    "load",
    "load_vox_scene",
    "one_a_stratum",
    "one_path",
    "path_trace",
    "raining",
    "read_vox",
    "reflection",
    "render",
    "sample_light",
    "sampled",
    "sampled_with_cache",
    "stream",
    "trace",
    "transmission",
]
