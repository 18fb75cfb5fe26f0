"""Functions take floats of one kind, float32 or float64, and name the picture that is of another."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import boxes
import pytest
import torch
from torch import Tensor

import post
from gbufrt import Frame

FRAME = boxes.frame()
G = FRAME.gbuffer
THREE, ONE = torch.rand(1, 3, 72, 96), torch.rand(1, 1, 72, 96)
SURFACES: dict[str, Any] = {"depth": G.depth, "normal": G.normal, "camera": G.camera}
RECEIVERS = {**SURFACES, "light": THREE, "albedo": THREE, "thickness": ONE}
MIRRORS = {**SURFACES, "light": THREE, "roughness": ONE, "f0": THREE, "metallic": ONE, "visibility": ONE}
FILTERED = {**SURFACES, "hit": G.hit, "variance": ONE, "roughness": ONE, "confidence": ONE, "signal": THREE}
REPLAYED = {"replayed": THREE, "chosen": ONE, "distance": ONE, "cached": THREE}
SEVERAL: tuple[tuple[Callable[..., Any], dict[str, Any]], ...] = (
    (post.gtao, {**SURFACES, "thickness": ONE}),
    (post.gtao, {**SURFACES, "method": "horizon"}),
    (post.bitmask_ao, {**SURFACES, "thickness": ONE}),
    (post.ssgi, RECEIVERS),
    (post.march_gi, {**RECEIVERS, "bent_normal": G.normal, "normal_geo": G.normal}),
    (post.ssr, {**MIRRORS, "environment": THREE[..., :8], "bent_normal": G.normal, "normal_geo": G.normal}),
    (post.thickness_from_depth, SURFACES),
    (
        post.motion_from_depth,
        {"depth": G.depth, "camera": G.camera, "previous_depth": G.depth, "previous_camera": G.camera},
    ),
    (post.bilateral, {**FILTERED, "distance": ONE}),
    (post.atrous, FILTERED),
    (post.denoise, {"gbuffer": G, "light": THREE}),
    (post.asvgf, {"gbuffer": G, "light": THREE, **REPLAYED}),
    (post.temporal, {"gbuffer": G, "signal": THREE, "distance": ONE}),
    (post.taa, {"gbuffer": G, "color": THREE}),
    (post.upscale, {"gbuffer": G, "color": THREE, "reactive": ONE}),
    (post.motion_blur, {"color": THREE, "depth": G.depth, "motion": THREE[:, :2]}),
    (post.depth_of_field, {"color": THREE, "depth": G.depth, "camera": G.camera}),
    (post.composite, {"radiance": THREE, "gi": THREE, "visibility": ONE, "specular": ONE}),
    (post.fog, {"gbuffer": G, "light": THREE, "transmittance": ONE}),
    (post.aerial_perspective, {"color": THREE, "depth": G.depth, "hit": G.hit, "camera": G.camera}),
)
ALONE = {
    **dict.fromkeys((post.tone_map, post.exposure, post.roughness_from_color, post.metallic_from_color), "color"),
    **dict.fromkeys((post.display_encode, post.vignette, post.fxaa), "image"),
}


def _of_floats(given: dict[str, Any]) -> list[str]:
    return [name for name, value in given.items() if isinstance(value, Tensor) and value.is_floating_point()]


@pytest.mark.parametrize(("function", "given"), SEVERAL, ids=lambda part: getattr(part, "__name__", ""))
def test_kinds_of_floats_are_not_mixed(function: Callable[..., Any], given: dict[str, Any]):
    for name in _of_floats(given):
        # where the first picture is the odd one, the second is named: both names are in the message
        with pytest.raises(TypeError, match=rf"\b{name} is float64|but {name} is float64"):
            function(**{**given, name: given[name].double()})
        with pytest.raises(
            TypeError, match=rf"^{name} must be float32 or float64, got float16; convert it with|is float"
        ):
            function(**{**given, name: given[name].half()})


@pytest.mark.parametrize("function", ALONE)
def test_halves_are_refused_by_name(function: Callable[..., Any]):
    with pytest.raises(TypeError, match=rf"^{ALONE[function]} must be float32 or float64, got float16"):
        function(**{ALONE[function]: THREE.half()})


def test_light_of_a_frame_is_of_the_kind_of_its_surfaces():
    with pytest.raises(TypeError, match=r"^radiance is float64 but depth is float32; make them alike with \.float\(\)"):
        Frame(gbuffer=G, radiance=THREE.double())
    with pytest.raises(TypeError, match=r"^ao is float64 but depth is float32"):
        FRAME.write("ao", ONE.double())
