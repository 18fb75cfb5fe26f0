"""The tracer: voxel worlds, the G-buffers and direct light that a camera sees of them, and ray-traced truth."""

from tracer.gbuffer import gbuffer
from tracer.material import Material, MaterialTable
from tracer.render import render
from tracer.scene import MASK_ALL, MASK_PRIMARY, MASK_SECONDARY, MASK_SHADOW, Instance, Scene, Sky, Sun, View
from tracer.traversal import Hits, trace, transmission
from tracer.truth import Truth, ambient_occlusion, focus_distance, indirect_diffuse, path_trace, reflection
from tracer.vox import load_vox_scene, read_vox
from tracer.world import World
from tracer.worlds import WORLDS, load

__all__ = [
    "MASK_ALL",
    "MASK_PRIMARY",
    "MASK_SECONDARY",
    "MASK_SHADOW",
    "WORLDS",
    "Hits",
    "Instance",
    "Material",
    "MaterialTable",
    "Scene",
    "Sky",
    "Sun",
    "Truth",
    "View",
    "World",
    "ambient_occlusion",
    "focus_distance",
    "gbuffer",
    "indirect_diffuse",
    "load",
    "load_vox_scene",
    "path_trace",
    "read_vox",
    "reflection",
    "render",
    "trace",
    "transmission",
]
