"""ME1 pipelines: the order of passes and the numbers of ME1 Path Tracing, from low to ultra."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, get_args

from gbufrt import Pipeline, Stage
from gbufrt.names import meant
from gbufrt.numeric import check_kind, check_numbers
from post.passes.denoising.atrous import Atrous
from post.passes.denoising.bilateral import Bilateral
from post.passes.denoising.temporal import Temporal
from post.passes.display.exposure import Exposure
from post.passes.display.fxaa import FXAA
from post.passes.display.overlay import Overlay
from post.passes.display.pulse import Pulse
from post.passes.display.tone_map import DisplayEncode, ToneMap
from post.passes.display.vignette import Vignette
from post.passes.lens.depth_of_field import DepthOfField
from post.passes.lens.motion_blur import MotionBlur
from post.passes.lens.taa import TAA
from post.passes.light.composite import Composite, Mode
from post.passes.light.fog import Fog
from post.passes.light.gtao import GTAO
from post.passes.light.ssgi import SSGI
from post.passes.light.ssr import SSR
from post.passes.light.submerged import Submerged
from post.upsampling.reduced import Reduced

Preset = Literal["low", "medium", "high", "ultra"]

GI_PHI = 2.0  # between those for one path a pixel and for none: what is left of noise after accumulation is little
ITERATIONS = 3  # of wavelets for bounce light: more gain nothing
REDUCED_ITERATIONS = 2  # of those for pixels that lie apart: as far in the picture
REFLECTION_REACH = 4  # pixels of the picture: sigma of the reflections' denoiser, and radius of its square of taps
REFLECTION_CLAMP = 2.5  # of few rays a frame: their noise passes more often for a change than that of sweeps
AO_RADIUS = 2.0  # metres
APERTURE_RADIUS = 0.05  # metres
AO_BLUR = 0.75  # pixels: sigma of the denoiser; wider loses more than it gains, with few directions too
FRESH = 2  # times as many slices in a frame with none before it
BEHIND_STEPS = 6
AO_STEPS = 16  # taps on each side of a direction, for all scales together


@dataclass(frozen=True, kw_only=True)
class Quality:
    """One row of ME1's table of presets; distances in metres.

    Slices, and the taps on each of their sides, are ours: ME1 sweeps 4, 6, 8 or 12 directions for AO and sends 4, 8,
    12 or 16 rays for GI. With a history few are enough, but of one alone bent normals lie in its plane: their error is
    half again as large as of two. A frame without a history takes `FRESH` times as many. With 24 taps for 36 the light
    in the gaps is a twentieth darker. Reflections send half of their rays after the first frame, see `post.SSR`: over
    the village, 4 after 8 have noise of 0.085 of the light in the first frame of a flight and 0.055 in the eighth, 6 in
    all frames 0.10 and 0.038, for a sixth more time of the branch.
    """

    strides: Mapping[str, int]
    """Branches that run on every second or third pixel both ways: in a quarter or ninth of the time."""
    ao_slices: int
    ao_scales: int
    gi_slices: int
    gi_steps: int
    gi_bounces: int
    gi_distance: float
    reflection_samples: int
    reflection_steps: int
    reflection_distance: float


QUALITIES: Mapping[str, Quality] = {
    "low": Quality(
        strides={"ao": 3, "gi": 3, "reflection": 3, "behind": 3},
        ao_slices=1, ao_scales=1, gi_slices=1, gi_steps=12, gi_bounces=1, gi_distance=30,
        reflection_samples=1, reflection_steps=48, reflection_distance=40,
    ),
    "medium": Quality(
        strides={"ao": 2, "gi": 2, "behind": 2},
        ao_slices=1, ao_scales=2, gi_slices=1, gi_steps=36, gi_bounces=2, gi_distance=50,
        reflection_samples=1, reflection_steps=64, reflection_distance=60,
    ),
    "high": Quality(
        strides={},
        ao_slices=2, ao_scales=2, gi_slices=1, gi_steps=36, gi_bounces=2, gi_distance=70,
        reflection_samples=8, reflection_steps=96, reflection_distance=75,
    ),
    "ultra": Quality(
        strides={},
        ao_slices=3, ao_scales=3, gi_slices=2, gi_steps=36, gi_bounces=3, gi_distance=100,
        reflection_samples=16, reflection_steps=128, reflection_distance=100,
    ),
}  # fmt: skip

STATUSES: Mapping[str, Mapping[str, float]] = {
    "blindness": {"composite.sight": 5.0, "composite.sight_begin": 0.25},
    "darkness": {"composite.sight": 15.0, "composite.sight_begin": 0.75, "pulse.strength": 0.45},
}
"""Tunables of Minecraft's status effects: in blocks, which are world units where a world's voxels are its blocks."""


def me1(
    preset: Preset | str = "high",
    *,
    composite: Mode = "physical",
    units_per_metre: float = 1.0,
    tunables: Mapping[str, Any] | None = None,
) -> Pipeline:
    """The ME1 pipeline: AO, GI and reflections, estimated, denoised and accumulated; their composite; lens; display.

    GI is accumulated before it is denoised, as in SVGF, not after as in ME1: the wavelets then blur only what noise is
    left. After 16 frames its error is up to a fifth less.

    Fourteen passes of ME1 make the composite and its history (here the history is the pipeline's state, not
    passes). Anti-aliasing, motion blur, depth of field, exposure, tone curve and vignette follow. Tunables differ from
    those of passes that are made without arguments: ``gbufrt passes`` lists both.

    Args:
        preset: ``low``, ``medium``, ``high`` or ``ultra``.
        composite: ``physical`` takes sky visibility and GI from one sweep over the whole picture, so that nothing is
            counted twice, and ``ao`` hardly counts; ``me1`` is ME1's own formula, which darkens by ``ao``, with its
            distances and its factor of 0.6 per bounce.
        units_per_metre: world units per metre, for ME1's distances, the radius of ``ao`` and the lens's aperture.
        tunables: changes by dotted name, see `Pipeline.with_tunables`.

    Returns:
        A pipeline that reads a frame with ``radiance`` (``ambient`` and ``environment`` where there are any) and
        writes everything up to ``image``.

    Raises:
        ValueError: unknown preset, composite or tunable, or a scale that is not positive.

    Source: ME1 Path Tracing technical overview.
    """
    if preset not in QUALITIES:
        raise ValueError(f"preset must be one of {', '.join(QUALITIES)}, got {preset!r}{meant(preset, QUALITIES)}")
    if composite not in get_args(Mode):
        raise ValueError(f"composite must be one of {', '.join(get_args(Mode))}, got {composite!r}")
    check_numbers(units_per_metre=units_per_metre)
    if not units_per_metre > 0:
        raise ValueError(f"units_per_metre must be positive, got {units_per_metre}")
    pipeline = Pipeline(**_light(QUALITIES[preset], composite, units_per_metre), **_finish(composite, units_per_metre))
    return pipeline.with_tunables(tunables or {})


def with_fog(pipeline: Pipeline) -> Pipeline:
    """A pipeline whose composite lies in fog, also behind glass and water, and in what mirrors show.

    Args:
        pipeline: with a stage ``composite``, as of `me1` and `minecraft_rtx`.

    Returns:
        One that also reads the fog that the tracer marched.

    Raises:
        TypeError: it is no pipeline.
        ValueError: there is no such stage.

    Source: see `post.fog`.
    """
    check_kind(Pipeline, "pipeline", pipeline, "; post.me1() is one")
    paths = [name for name, _ in pipeline.passes() if name.rpartition(".")[2] == "composite"]
    inner = paths[0].removesuffix("composite") if paths else ""
    behind = Pipeline(layer="behind", fog=Fog())
    pipeline = pipeline.with_stage(f"{inner}fog", Fog(), before="composite")
    return pipeline.with_stage(f"{inner}fog_behind", behind, before="composite")


def _light(quality: Quality, composite: Mode, metre: float) -> dict[str, Stage]:
    physical = composite == "physical"
    ao = GTAO(
        radius=AO_RADIUS * metre,
        directions=quality.ao_slices,
        fresh=FRESH,
        steps=AO_STEPS,
        scales=quality.ao_scales,
    )
    gi = SSGI(
        directions=quality.gi_slices,
        fresh=FRESH,
        steps=quality.gi_steps,
        bounces=quality.gi_bounces,
        distance=None if physical else quality.gi_distance * metre,
        bounce_loss=1.0 if physical else 0.6,
    )
    reflection = SSR(
        samples=quality.reflection_samples,
        steps=quality.reflection_steps,
        distance=None if physical else quality.reflection_distance * metre,
    )
    both = ("ao", "bent_normal")
    bounced = ("gi", "sky_visibility")
    ao_blur = Bilateral(signal=both, radius=2, sigma=AO_BLUR)
    at = {name: Reduced(stride) for name, stride in quality.strides.items()}
    reach = max(REFLECTION_REACH // quality.strides.get("reflection", 1), 2)
    return {
        "ao": Pipeline(
            reduction=at.get("ao"),
            estimate=ao,
            denoise=ao_blur,
            accumulate=Temporal(signal=both, blend=0.95, variance=False),
        ),
        "gi": Pipeline(
            reduction=at.get("gi"),
            estimate=gi,
            accumulate=Temporal(signal=bounced, blend=0.97),
            denoise=Atrous(
                signal=bounced, phi_color=GI_PHI, iterations=REDUCED_ITERATIONS if "gi" in at else ITERATIONS
            ),
        ),
        "reflection": Pipeline(
            reduction=at.get("reflection"),
            estimate=reflection,
            denoise=Bilateral(signal="reflection", radius=reach, sigma=reach),
            accumulate=Temporal(signal="reflection", blend=0.95, clamp=REFLECTION_CLAMP, variance=False),
        ),
        "submerged": Submerged(),
        "behind": Pipeline(
            layer="behind",
            reduction=at.get("behind"),
            gi=SSGI(directions=2, steps=BEHIND_STEPS, bounces=1, distance=gi.distance),
            denoise=Atrous(signal=bounced, iterations=ITERATIONS),
        ),
    }


def _finish(composite: Mode, metre: float) -> dict[str, Any]:
    return {
        "composite": Composite(mode=composite),
        "taa": TAA(),
        "motion_blur": MotionBlur(),
        "depth_of_field": DepthOfField(aperture_radius=APERTURE_RADIUS * metre),
        "exposure": Exposure(),
        "pulse": Pulse(),
        "tone_map": ToneMap(),
        "vignette": Vignette(),
        "encode": DisplayEncode(),
        "fxaa": FXAA(),
        "ui": Overlay(),
    }
