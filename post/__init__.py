"""The passes: functions on tensors, and thin modules on frames. One paper, one file."""

import gbufrt as gbufrt  # first: sets how threads wait, before torch is loaded
from post.lens.thin_lens import autofocus, circle_of_confusion
from post.passes.denoising.asvgf import ASVGF, asvgf
from post.passes.denoising.atrous import Atrous, atrous
from post.passes.denoising.bilateral import Bilateral, bilateral
from post.passes.denoising.denoise import Denoise, denoise
from post.passes.denoising.temporal import Temporal, temporal
from post.passes.display.exposure import Exposure, exposure
from post.passes.display.fxaa import FXAA, fxaa
from post.passes.display.overlay import Overlay, overlay
from post.passes.display.pulse import Pulse, pulse
from post.passes.display.tone_map import DisplayEncode, ToneMap, display_encode, tone_map
from post.passes.display.vignette import Vignette, vignette
from post.passes.lens.depth_of_field import DepthOfField, depth_of_field
from post.passes.lens.motion_blur import MotionBlur, motion_blur
from post.passes.lens.taa import TAA, taa
from post.passes.lens.upscale import Upscale, reactive_mask, upscale
from post.passes.light.aerial_perspective import AerialPerspective, aerial_perspective
from post.passes.light.composite import Composite, composite
from post.passes.light.estimate import (
    EstimateMissing,
    metallic_from_color,
    motion_from_depth,
    normals_from_depth,
    roughness_from_color,
)
from post.passes.light.fog import Fog, fog
from post.passes.light.gtao import GTAO, gtao
from post.passes.light.march_gi import MarchGI, march_gi
from post.passes.light.ssgi import SSGI, ssgi
from post.passes.light.ssr import SSR, ssr
from post.path_traced import minecraft_rtx
from post.presets import me1, with_fog
from post.sweep.bitmask import bitmask_ao
from post.sweep.chords import thickness_from_depth
from post.upsampling.enlarged import Enlarged
from post.upsampling.reduced import Reduced

__all__ = [
    "ASVGF",
    "FXAA",
    "GTAO",
    "SSGI",
    "SSR",
    "TAA",
    "AerialPerspective",
    "Atrous",
    "Bilateral",
    "Composite",
    "Denoise",
    "DepthOfField",
    "DisplayEncode",
    "Enlarged",
    "EstimateMissing",
    "Exposure",
    "Fog",
    "MarchGI",
    "MotionBlur",
    "Overlay",
    "Pulse",
    "Reduced",
    "Temporal",
    "ToneMap",
    "Upscale",
    "Vignette",
    "aerial_perspective",
    "asvgf",
    "atrous",
    "autofocus",
    "bilateral",
    "bitmask_ao",
    "circle_of_confusion",
    "composite",
    "denoise",
    "depth_of_field",
    "display_encode",
    "exposure",
    "fog",
    "fxaa",
    "gtao",
    "march_gi",
    "me1",
    "metallic_from_color",
    "minecraft_rtx",
    "motion_blur",
    "motion_from_depth",
    "normals_from_depth",
    "overlay",
    "pulse",
    "reactive_mask",
    "roughness_from_color",
    "ssgi",
    "ssr",
    "taa",
    "temporal",
    "thickness_from_depth",
    "tone_map",
    "upscale",
    "vignette",
    "with_fog",
]
