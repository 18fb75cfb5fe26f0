"""The passes: functions on tensors, and thin modules on frames. One paper, one file."""

from post.atrous import Atrous, atrous
from post.bilateral import Bilateral, bilateral
from post.bitmask import bitmask_ao
from post.composite import Composite, composite
from post.denoise import Denoise, denoise
from post.depth_of_field import DepthOfField, depth_of_field
from post.estimate import (
    EstimateMissing,
    metallic_from_color,
    motion_from_depth,
    normals_from_depth,
    roughness_from_color,
)
from post.exposure import Exposure, exposure
from post.fxaa import FXAA, fxaa
from post.gtao import GTAO, gtao
from post.march_gi import MarchGI, march_gi
from post.motion_blur import MotionBlur, motion_blur
from post.presets import me1
from post.ssgi import SSGI, ssgi
from post.ssr import SSR, ssr
from post.taa import TAA, taa
from post.temporal import Temporal, temporal
from post.thin_lens import autofocus, circle_of_confusion
from post.tone_map import DisplayEncode, ToneMap, display_encode, tone_map
from post.vignette import Vignette, vignette

__all__ = [
    "FXAA",
    "GTAO",
    "SSGI",
    "SSR",
    "TAA",
    "Atrous",
    "Bilateral",
    "Composite",
    "Denoise",
    "DepthOfField",
    "DisplayEncode",
    "EstimateMissing",
    "Exposure",
    "MarchGI",
    "MotionBlur",
    "Temporal",
    "ToneMap",
    "Vignette",
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
    "fxaa",
    "gtao",
    "march_gi",
    "me1",
    "metallic_from_color",
    "motion_blur",
    "motion_from_depth",
    "normals_from_depth",
    "roughness_from_color",
    "ssgi",
    "ssr",
    "taa",
    "temporal",
    "tone_map",
    "vignette",
]
