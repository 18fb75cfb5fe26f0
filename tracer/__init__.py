"""The tracer: voxel worlds, and the G-buffers and direct light that a camera sees of them."""

from tracer.gbuffer import gbuffer
from tracer.material import Material, MaterialTable
from tracer.render import render
from tracer.scene import MASK_ALL, MASK_PRIMARY, MASK_SECONDARY, MASK_SHADOW, Instance, Scene, Sky, Sun, View
from tracer.traversal import Hits, trace, transmission
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
    "View",
    "World",
    "gbuffer",
    "load",
    "load_vox_scene",
    "read_vox",
    "render",
    "trace",
    "transmission",
]
