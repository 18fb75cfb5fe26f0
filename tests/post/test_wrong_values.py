"""What is no frame, state, picture or camera is named in one sentence, before a kernel or torch fails over it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import boxes
import numpy as np
import pytest
import torch

import tracer
from gbufrt import Camera, Frame, GBuffer, Pipeline
from gbufrt.history import PipelineState
from post import (
    FXAA,
    TAA,
    Exposure,
    Reduced,
    asvgf,
    atrous,
    bilateral,
    composite,
    denoise,
    display_encode,
    exposure,
    fog,
    fxaa,
    me1,
    normals_from_depth,
    pulse,
    taa,
    temporal,
    tone_map,
    upscale,
    vignette,
)

FRAME = boxes.frame()
G = FRAME.gbuffer
FLAT, ROWS = torch.rand(8, 8), torch.rand(1, 8, 8, 3)
FILTER: Any = Pipeline(given={"image"}, fxaa=FXAA())
PICTURES: tuple[Callable[[Any], Any], ...] = (fxaa, tone_map, display_encode, exposure)


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (
            lambda: FILTER(np.zeros(3)),
            TypeError,
            r"frame must be a gbufrt\.Frame, got ndarray",
        ),  # pyright: ignore
        (lambda: FXAA()(G), TypeError, r"frame must be a gbufrt\.Frame, got GBuffer"),  # pyright: ignore
        (
            lambda: FILTER(FRAME, 3),
            TypeError,
            "state must be None or what the pipeline returned",
        ),  # pyright: ignore
        (
            lambda: GBuffer(camera=None, depth=G.depth, hit=G.hit, normal=G.normal),  # pyright: ignore
            TypeError,
            r"camera must be a gbufrt\.Camera, got NoneType",
        ),
        (
            lambda: G.replace(depth=G.depth.expand(2, -1, -1, -1)),
            ValueError,
            "got .2,1,72,96.; the camera sets the batch, 1: give it a pose for each picture",
        ),
        (lambda: G.replace(normal=G.normal[0].permute(1, 2, 0)), ValueError, r"use \.permute\(2, 0, 1\)\[None\]"),
        (lambda: G.replace(previous_camera=3), TypeError, r"previous_camera must be a gbufrt\.Camera or None, got int"),
        (
            lambda: Camera.from_intrinsics(G.camera.intrinsics, G.camera.world_from_view, size=(1, 72, 96)),  # pyright: ignore
            ValueError,
            r"size must be \(H, W\), whole numbers of at least 1 such as \(540, 960\), got \(1, 72, 96\)",
        ),
        (lambda: Camera.look_at((0, 0, 0), (0, 0, 1), size=540), ValueError, r"size must be \(H, W\).*got 540"),  # pyright: ignore
        (lambda: Camera.look_at((0, 0, 0), (0, 0, 1), size=(0, 9)), ValueError, r"size must be \(H, W\).*got \(0, 9\)"),
        (lambda: G.camera.resized(540), ValueError, r"size must be \(H, W\).*got 540"),  # pyright: ignore
        (lambda: Frame(gbuffer=G.camera), TypeError, r"gbuffer must be a gbufrt\.GBuffer, got Camera"),  # pyright: ignore
        (lambda: FRAME.replace(cut=True), TypeError, r"cut must be a \(1,\) bool tensor or None, got bool"),
        (lambda: FRAME.replace(emitters_sampled="x"), TypeError, r"emitters_sampled must be True or False, got 'x'"),  # pyright: ignore
        (lambda: FRAME.write("mine", ROWS.numpy()), TypeError, r"signal 'mine' must be a torch\.Tensor, got ndarray"),  # pyright: ignore
        (lambda: Pipeline(reduction=Reduced), TypeError, r"reduction must be one such as post\.Reduced\(\), got <cl"),  # pyright: ignore
        (lambda: Pipeline(**{"a.b": FXAA()}), ValueError, "a stage's name must hold no dot"),  # pyright: ignore
        (lambda: me1(None), ValueError, "preset must be one of low"),  # pyright: ignore
        (lambda: G.replace(hit=G.hit[..., 1:]), ValueError, "the camera sets the size, 72 rows of 96 pixels"),
        (lambda: G.replace(depth=G.depth.mT), ValueError, r"height comes before width: use \.transpose\(2, 3\)"),
        (lambda: normals_from_depth(G.depth[0], G.camera), ValueError, r"depth must be \(1,1,72,96\).*: x\[None\]"),
        (lambda: G.camera.normals_from_depth(G.depth[0]), ValueError, r"depth must be \(B,1,H,W\)"),
        (lambda: tracer.render("valley", G.camera), TypeError, r"scene must be a tracer\.Scene, got str"),  # pyright: ignore
    ],
)
def test_wrong_values_are_named(call: Callable[[], Any], error: type[Exception], message: str):
    with pytest.raises(error, match=message):
        call()


@pytest.mark.parametrize("function", PICTURES)
def test_wrong_pictures_are_named(function: Callable[[Any], Any]):
    with pytest.raises(TypeError, match=r"must be a torch\.Tensor, got ndarray"):
        function(ROWS.numpy())
    with pytest.raises(ValueError, match=r"must be \(B,3,H,W\).*; got \(8,8\)"):
        function(FLAT)
    with pytest.raises(ValueError, match="it looks channels-last: use"):
        function(ROWS)
    with pytest.raises(TypeError, match=r"must be float32 or float64, got uint8; convert it with \.float\(\) / 255"):
        function(torch.zeros(1, 3, 8, 8, dtype=torch.uint8))


def test_a_vignette_takes_pictures_of_any_number_of_components():
    assert vignette(torch.ones(1, 5, 8, 8)).shape == (1, 5, 8, 8)
    with pytest.raises(TypeError, match=r"image must be a torch\.Tensor, got ndarray"):
        vignette(ROWS.numpy())  # pyright: ignore
    with pytest.raises(ValueError, match=r"image must be \(B,C,H,W\).*add the batch dimension"):
        vignette(torch.ones(3, 8, 8))


@pytest.mark.parametrize("size", [(71, 96), (80, 128)])
def test_filters_refuse_pictures_of_another_size_than_the_camera(size: tuple[int, int]):
    """Their kernels would read, and write, beside them."""
    other, one = torch.rand(1, 3, *size), torch.rand(1, 3, 72, 96)
    of: Any = {"depth": G.depth, "normal": G.normal, "hit": G.hit, "camera": G.camera}
    wrong: dict[str, Callable[[], object]] = {
        "signal": lambda: bilateral(other, **of),
        "variance": lambda: bilateral(one, **of, variance=other[:, :1]),
        "confidence": lambda: atrous(one, **of, confidence=other[:, :1]),
        "distance": lambda: temporal(one, G, distance=other[:, :1]),
    }
    for name, call in wrong.items():
        with pytest.raises(ValueError, match=f"{name} must be .1,C,72,96. like its camera, got .1, ., {size[0]}"):
            call()
    channels: dict[str, Callable[[], object]] = {
        "roughness": lambda: atrous(one, **of, roughness=other[:, :1]),
        "light": lambda: denoise(other, G),
        "color": lambda: taa(other, G),
    }
    for name, call in channels.items():
        with pytest.raises(
            ValueError, match=rf"^{name} must be \(1,[13],72,96\).*; got \(1,[13],{size[0]},{size[1]}\)"
        ):
            call()
    for name in ("replayed", "chosen", "distance", "cached"):
        with pytest.raises(ValueError, match=rf"^{name} must be \(1,[13],72,96\) like light"):
            asvgf(one, G, **{name: other})  # pyright: ignore[reportArgumentType]


LIT = torch.rand(1, 3, 72, 96)
OVER_TIME: dict[Callable[..., Any], Any] = {
    **dict.fromkeys((temporal, denoise, asvgf, taa, upscale), LIT),
    (lambda light, *rest: fog(light, light[:, :1], *rest)): LIT,
}


@pytest.mark.parametrize("function", OVER_TIME)
def test_histories_of_another_pass_and_frames_in_place_of_g_buffers_are_named(function: Callable[..., Any]):
    with pytest.raises(TypeError, match=r"^gbuffer must be a gbufrt\.GBuffer, got Frame; frame\.gbuffer is one"):
        function(LIT, FRAME)
    with pytest.raises(TypeError, match=r"^history must be a gbufrt\.History, got PipelineState"):
        function(LIT, G, PipelineState())
    _, other = (temporal if function in (taa, upscale) else taa)(LIT, G)
    with pytest.raises(ValueError, match=r"^history must hold '\w+', got .*: another pass made it"):
        function(LIT, G, other)


def test_a_pass_names_a_state_that_is_none_of_its_own():
    color = FRAME.replace(color=LIT, cut=torch.tensor([True]))
    for state in ({}, PipelineState()):
        with pytest.raises(TypeError, match=r"^history must be a gbufrt\.History"):
            TAA()(color, state)
    with pytest.raises(ValueError, match=r"^history must hold 'log_luminance'"):
        Exposure()(color, taa(LIT, G)[1])


NUMBERS: list[tuple[Callable[..., Any], tuple[Any, ...], dict[str, Any], str]] = [
    (temporal, (LIT, G), {"clamp": -1.0, "firefly": -1.0, "motion_response": -1.0}, "at least 0, got -1"),
    (temporal, (LIT, G), {"blend": float("nan")}, "lie in 0 to 1, got nan"),
    (taa, (LIT, G), {"gamma": -1.0}, "at least 0, got -1"),
    (upscale, (LIT, G), {"gamma": -1.0, "stability": -1.0}, "at least 0, got -1"),
    (upscale, (LIT, G), {"lock": 2.0, "sharpness": 2.0}, "lie in 0 to 1, got 2"),
    (exposure, (LIT,), {"speed_up": -1.0, "speed_down": -1.0}, "at least 0, got -1"),
    (tone_map, (LIT,), {"saturation": -1.0}, "at least 0, got -1"),
    (fxaa, (LIT,), {"edge_threshold": -1.0, "dark_threshold": -1.0}, "at least 0, got -1"),
    (fxaa, (LIT,), {"subpixel": 2.0}, "lie in 0 to 1, got 2"),
    (composite, (LIT,), dict.fromkeys(("ao_intensity", "gi_intensity", "reflection_intensity"), -1.0), "at least 0"),
    (vignette, (LIT,), {"strength": -1.0}, "lie in 0 to 1, got -1"),
    (pulse, (LIT, 0.0), {"strength": 1.5}, "lie in 0 to 1, got 1.5"),
]


@pytest.mark.parametrize(("function", "given", "wrong", "message"), NUMBERS)
def test_numbers_out_of_range_and_texts_for_numbers_are_named(
    function: Callable[..., Any], given: tuple[Any, ...], wrong: dict[str, Any], message: str
):
    for name, value in wrong.items():
        with pytest.raises(ValueError, match=f"^{name} must .*{message}"):
            function(*given, **{name: value})
        with pytest.raises(TypeError, match=f"^{name} must be a number or a 0-dim tensor, got 'x'"):
            function(*given, **{name: "x"})


def test_numbers_of_filters_are_checked_alike():
    of: Any = {"depth": G.depth, "normal": G.normal, "hit": G.hit, "camera": G.camera}
    powers: dict[Callable[..., Any], tuple[str, ...]] = {
        bilateral: ("depth_sensitivity", "normal_power", "variance_sensitivity", "phi_color"),
        atrous: ("phi_color", "phi_normal", "phi_depth", "growth"),
    }
    for function, names in powers.items():
        for name in names:
            with pytest.raises(ValueError, match=f"^{name} must be at least 0, got -1"):
                function(LIT, **of, **{name: -1.0})
    counts: dict[Callable[..., Any], str] = {bilateral: "radius", atrous: "iterations"}
    for function, name in counts.items():
        with pytest.raises(TypeError, match=f"^{name} must be a whole number, got 2.5"):
            function(LIT, **of, **{name: 2.5})
