"""The sum of all light: the renderer's, plus that of the screen-space passes."""

from __future__ import annotations

import math
from typing import Literal

import torch
from torch import Tensor

from gbufrt import Frame, Pass
from gbufrt.demands.pictures import check_alike
from gbufrt.numeric import check_between
from post.shading.composite_op import specular_albedo, sum_light
from post.shading.sight import within_sight

Mode = Literal["physical", "me1"]


def composite(
    radiance: Tensor,
    *,
    ambient: Tensor | None = None,
    emission: Tensor | None = None,
    visibility: Tensor | None = None,
    gi: Tensor | None = None,
    reflection: Tensor | None = None,
    behind: Tensor | None = None,
    specular: Tensor | None = None,
    mode: Mode = "physical",
    ao_intensity: float = 1.0,
    gi_intensity: float = 1.0,
    reflection_intensity: float = 1.0,
) -> Tensor:
    """Add up a surface's light. Absent parts count as zero, an absent visibility as 1.

    ``physical``: (1 - specular) x (radiance - emission + ambient x visibility + gi + behind) + emission + reflection.
    Exact when visibility and gi come from one sweep of unlimited radius: open directions bring sky light, occluded ones
    the occluder's light. What is reflected is not diffused as well: in uniform light a surface sends no more
    than arrives.

    ``me1``: visibility x (radiance + ambient - emission) + emission + gi + behind + reflection, the formula of ME1
    Path Tracing with a radius-limited ambient occlusion that darkens direct light too. Emission is not darkened.

    Args:
        radiance: ``(B, 3, H, W)`` direct light and emission, outgoing linear radiance.
        ambient: ``(B, 3, H, W)`` unoccluded sky light, outgoing linear radiance.
        emission: ``(B, 3, H, W)`` the part of ``radiance`` that the surface emits.
        visibility: ``(B, 1, H, W)`` sky visibility (physical) or ambient occlusion (me1), 1 open.
        gi: ``(B, 3, H, W)`` indirect diffuse, outgoing linear radiance.
        reflection: ``(B, 3, H, W)`` specular light with Fresnel, linear radiance.
        behind: ``(B, 3, H, W)`` light transmitted through the surface, linear radiance.
        specular: ``(B, 1, H, W)`` directional albedo of the specular lobe, see `specular_albedo`; counts only
            where there is a reflection to take its place.
        mode: which formula.
        ao_intensity: exponent on the visibility; 0 switches it off, above 1 exaggerates.
        gi_intensity: factor on ``gi``.
        reflection_intensity: factor on ``reflection``.

    Returns:
        ``(B, 3, H, W)`` linear radiance.

    Raises:
        TypeError: what must be a tensor or a number is none.
        ValueError: unknown mode, a negative intensity, or a picture of another size than ``radiance``.

    Source: ME1 Path Tracing technical overview, pass 10, for ``me1``.
    """
    if mode not in ("physical", "me1"):
        raise ValueError(f'mode must be "physical" or "me1", got {mode!r}')
    check_alike(
        "radiance",
        radiance=radiance,
        ambient=ambient,
        emission=emission,
        visibility=visibility,
        gi=gi,
        reflection=reflection,
        behind=behind,
        specular=specular,
    )
    check_between(
        0, math.inf, ao_intensity=ao_intensity, gi_intensity=gi_intensity, reflection_intensity=reflection_intensity
    )
    given = (radiance, ambient, emission, visibility, gi, reflection, behind, specular)
    intensities = (ao_intensity, gi_intensity, reflection_intensity)
    return sum_light(*given, physical=mode == "physical", intensities=intensities)


class Composite(Pass):
    """See `composite`. What is behind is transmittance x the composite of ``frame.behind``.

    Fog lies over what is behind, over reflections, and over ``color``; ``composite`` is the surface's light before it.

    ``physical`` reads ``sky_visibility`` and falls back to ``ao``; ``me1`` reads ``ao``.

    Args:
        mode: see `composite`, as the intensities.
        layered: whether diffuse light loses what the surface reflects, under ``physical``; False for the light passes
            of a renderer that has taken it off already.
        sight: distance from which on nothing is seen, world units, as under the effects Blindness and Darkness of
            Minecraft; surfaces, mirrors and what is behind glass and water fade by the whole way of their light. None
            for clear air.
        sight_begin: share of ``sight`` up to which nothing fades.
    """

    reads = frozenset({"radiance"})
    optional = frozenset(
        {
            *("ambient", "emission", "ao", "sky_visibility", "gi", "reflection", "transmittance"),
            *("reflection_confidence", "reflection_distance"),  # for limited sight
            *("depth", "normal", "hit", "roughness"),  # for the specular albedo, where there is a reflection
            *("fog", "fog_transmittance", "fog_reflection", "albedo", "metallic"),
            "behind",
        }
    )
    writes = frozenset({"composite", "color"})

    def __init__(
        self,
        *,
        mode: Mode = "physical",
        layered: bool = True,
        ao_intensity: float = 1.0,
        gi_intensity: float = 1.0,
        reflection_intensity: float = 1.0,
        sight: float | None = None,
        sight_begin: float = 0.25,
    ) -> None:
        super().__init__()
        self.mode: Mode = mode
        self.layered = layered
        self.ao_intensity = ao_intensity
        self.gi_intensity = gi_intensity
        self.reflection_intensity = reflection_intensity
        self.sight, self.sight_begin = sight, sight_begin

    def forward(self, frame: Frame) -> Frame:
        seen = frame if self.sight is None else within_sight(frame, self.sight, self.sight_begin)
        behind = None
        if seen.behind is not None and seen.gbuffer.transmittance is not None:
            behind = seen.gbuffer.transmittance * _fogged(seen.behind, self._surface(seen.behind))
        result = self._surface(seen, behind)
        return frame.replace(composite=result, color=_fogged(frame, result))

    def _surface(self, frame: Frame, behind: Tensor | None = None) -> Tensor:
        fitting = (frame.sky_visibility, frame.ao) if self.mode == "physical" else (frame.ao,)
        return composite(
            frame.read("radiance"),
            ambient=frame.ambient,
            emission=frame.gbuffer.emission,
            visibility=next((v for v in fitting if v is not None), None),
            gi=frame.gi,
            reflection=_fogged_reflection(frame),
            behind=behind,
            specular=specular_albedo(frame.gbuffer) if self.layered and frame.reflection is not None else None,
            mode=self.mode,
            ao_intensity=self.ao_intensity,
            gi_intensity=self.gi_intensity,
            reflection_intensity=self.reflection_intensity,
        )


def _fogged(frame: Frame, light: Tensor) -> Tensor:
    """What the fog of a frame leaves of its light, and what it adds."""
    if frame.fog is None or frame.fog_transmittance is None:
        return light
    return light * frame.fog_transmittance + frame.fog


def _fogged_reflection(frame: Frame) -> Tensor | None:
    """The reflection with fog along the mirrored ray, as much of it as the surface reflects."""
    reflection, along = frame.reflection, frame.fog_reflection
    if reflection is None or along is None:
        return reflection
    g, share = frame.gbuffer, specular_albedo(frame.gbuffer)
    if g.metallic is not None and g.albedo is not None:
        share = torch.lerp(share.expand_as(g.albedo), g.albedo, g.metallic)
    return reflection * along[:, 3:] + along[:, :3] * share
