"""The passes that fit frames of other renderers, for `gbufrt post`."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Sequence
from typing import Any

from gbufrt.commands.recipe import Recipe
from gbufrt.files.gbuffers.grain import noisy
from gbufrt.frame import LIGHT, Frame
from gbufrt.gbuffer import CHANNELS
from gbufrt.names import unknown
from gbufrt.pipeline import Pipeline
from post import Composite, Denoise, EstimateMissing
from post.lens.thin_lens import autofocus, circle_of_confusion
from post.presets import APERTURE_RADIUS

LIT = ("ao", "gi", "reflection", "behind", "composite")
"""Stages that make light of direct light; a finished picture holds it already."""
DISPLAY = ("exposure", "tone_map", "encode")
ESTIMATED = ("motion", "motion_z", "thickness")
GUESSED = ("roughness", "metallic")
AOVS = {"albedo": "Base Color", "roughness": "Roughness", "metallic": "Metallic"}
"""What Blender's files call channels that it has no passes of."""
SEEN = 0.01  # of the height of what is seen at the median depth: a smaller radius of ``ao`` leaves next to nothing
BLURRED = 0.01  # of the picture's height: a median radius of depth of field that is no longer a lens's of a camera
MIRRORING = 0.01  # share of the surfaces that are black through and through, from which it is told
SHORT = {"dof": "depth_of_field"}


def pipeline_for(frame: Frame, recipe: Recipe, wanted: Iterable[str]) -> Pipeline:
    """The passes that fit a frame of another renderer.

    Direct light goes through all of them. Motion and thickness that the G-buffer lacks are estimated first; roughness
    and metalness, whose estimates are worse than none, only for reflections that are asked for. A finished picture has
    its indirect light, shadows and reflections: none is added again. Ambient occlusion may be asked for as a layer,
    which leaves the picture as it is. Noisy light is denoised first, unless passes without that are asked for; without
    albedo it may be a texture's, and must be asked for.

    Args:
        frame: the first one.
        recipe: of the command line.
        wanted: stages to keep beside those of the display, and ``denoise``; by default all that fit.

    Raises:
        ValueError: no such stage, or one that adds light to a finished picture.
    """
    finished = frame.radiance is None
    whole = recipe.build()
    stages = dict(whole.stages.items())
    names = [SHORT.get(name, name) for name in wanted]
    for name in names:
        if name not in (*stages, "denoise"):
            raise ValueError(unknown("stage", name, "--passes", (*stages, "denoise")))
        if finished and name in LIT and name != "ao":
            raise ValueError(
                f"--passes {name} would add light that the finished picture holds already; render the passes of direct "
                "light too"
            )
    denoised = "denoise" in names or _denoised_unasked(frame, names)
    left_out = set(LIT) - set(names) if finished else set()
    if not finished and not names and frame.gbuffer.roughness is None:
        left_out.add("reflection")
        warnings.warn(f"the files hold no roughness, so that reflections are left out{_black(frame)}", stacklevel=2)
    if names:
        always = {"denoise", "missing", *DISPLAY, *(() if finished else ("composite",))}
        left_out |= set(stages) - set(names) - always
    kept = {name: stage for name, stage in stages.items() if name not in left_out}
    for name in recipe.set:
        if (stage := whole.resolve(name).partition(".")[0]) not in kept and stage in stages:
            warnings.warn(f"--set {name} changes nothing: {stage} is left out; see --passes", stacklevel=2)
    if not finished and isinstance(sums := kept.get("composite"), Composite):
        kept["composite"] = sums.tuned(layered=False)  # a renderer's diffuse passes lack what is reflected
    light = "color" if finished else "radiance"
    guessed = GUESSED if "reflection" in kept and frame.gbuffer.roughness is None else ()
    first: dict[str, Any] = {"missing": EstimateMissing(channels=(*ESTIMATED, *guessed))}
    if denoised:
        first["denoise"] = Denoise(signal=light)
    return Pipeline(given={"color"} if finished else (), **first, **kept)  # pyright: ignore[reportArgumentType]


def _black(frame: Frame) -> str:
    """What to do about reflections that are left out: surfaces with neither light nor albedo are mirrors or glass."""
    g, light = frame.gbuffer, frame.read("radiance")
    dark = g.hit if g.albedo is None else g.hit & (g.albedo.amax(1, keepdim=True) <= 0)
    share = float((dark & (light.amax(1, keepdim=True) <= 0)).sum() / g.hit.sum().clamp_min(1))
    if g.albedo is None or share < MIRRORING:
        return "; --passes reflection,ao,gi,... guesses it"
    return (
        f", and {share:.0%} of the surfaces, which have neither light nor albedo as mirrors and glass, stay black: "
        "give roughness, metallic and albedo, or the finished picture in place of the direct light"
    )


def _denoised_unasked(frame: Frame, names: Sequence[str]) -> bool:
    """Whether light is denoised though nobody asked for it; says so, or that it should be."""
    noise = noisy(frame)
    if noise is None:
        return False
    denoised = not names and frame.gbuffer.albedo is not None
    leave = "and is denoised first; --passes that do not name denoise leave it as it is"
    what = leave if denoised else "from which --passes denoise,... would free it"
    warnings.warn(f"the light is noisy, by {noise:.0%} from pixel to pixel, {what}", stacklevel=3)
    return denoised


def hint_of_units(frame: Frame, pipeline: Pipeline) -> str:
    """What to say where ``ao`` reaches so little of the picture, or the lens blurs so much of it, that world units are
    hardly metres; else nothing."""
    g = frame.gbuffer
    if not bool(g.hit.any()):
        return ""
    tunables, depth = pipeline.all_tunables(), float(g.depth[g.hit].median())
    radius, aperture = (tunables.get(path) for path in ("ao.estimate.radius", "depth_of_field.aperture_radius"))
    seen = g.camera.size[0] / float(g.camera.lens[0, 1]) * (1.0 if g.camera.orthographic else depth)
    if radius is not None and radius < SEEN * seen:
        return (
            f"the median depth is {depth:.4g} units, of which ambient occlusion looks {radius:g} far, as if they were "
            "metres: --units-per-metre 100 if they are centimetres"
        )
    ours = aperture == APERTURE_RADIUS
    blur = _blur(frame, tunables["depth_of_field.focus_distance"], APERTURE_RADIUS) if ours else 0.0
    if blur < BLURRED * g.camera.height:
        return ""
    return (
        f"depth of field blurs half of the picture by {blur:.2g} pixels or more, as a lens of "
        f"{200 * APERTURE_RADIUS:g} cm does at a depth of {depth:.2g} m: --without depth_of_field, or --set "
        f"depth_of_field.aperture_radius={APERTURE_RADIUS * BLURRED * g.camera.height / blur / 2:.1g}, in world units"
    )


def _blur(frame: Frame, focus: float | None, aperture: float) -> float:
    """The median radius in pixels by which a lens blurs surfaces."""
    g = frame.gbuffer
    at = autofocus(g.depth, g.camera, hit=g.hit) if focus is None else focus
    radius = circle_of_confusion(g.depth, g.camera, focus_distance=at, aperture_radius=aperture, hit=g.hit)
    return float(radius[g.hit].abs().median())


def remedies(*, sky: str) -> dict[str, str]:
    """What to do on the command line about a channel or light that files lack; ``sky`` about the environment."""
    found = {"environment": sky}
    for name in (*CHANNELS, *LIGHT):
        aov = f", in Blender as the AOV {AOVS[name]}" if name in AOVS else ""
        found.setdefault(
            name, f"render it too{aov}, or leave the stage out with --without (see gbufrt inspect, passes)"
        )
    return found
