"""Pictures of another size than the frame, and texts for numbers, are named before torch or a kernel meets them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import boxes
import numpy as np
import pytest
import torch

from post import (
    GTAO,
    SSR,
    autofocus,
    bitmask_ao,
    circle_of_confusion,
    composite,
    gtao,
    march_gi,
    metallic_from_color,
    motion_from_depth,
    normals_from_depth,
    roughness_from_color,
    ssgi,
    ssr,
    thickness_from_depth,
)

FRAME = boxes.frame()
G = FRAME.gbuffer
LIGHT = torch.rand(1, 3, 72, 96)
ONE, THREE = torch.rand(1, 1, 40, 50), torch.rand(1, 3, 40, 50)
SURFACES: dict[str, Any] = {"depth": G.depth, "normal": G.normal, "camera": G.camera}
MIRRORS = {**SURFACES, "light": LIGHT, "roughness": LIGHT[:, :1]}
RECEIVERS = {**SURFACES, "light": LIGHT, "albedo": LIGHT}
OPTIONAL = {"hit": ONE > 0.5, "thickness": ONE, "bent_normal": THREE, "normal_geo": THREE}
WRONG = {"depth": ONE, "normal": THREE, "light": THREE, "roughness": ONE, "albedo": THREE, **OPTIONAL}
MORE = {"f0": THREE, "metallic": ONE, "visibility": ONE}
PARTS: dict[str, Any] = dict.fromkeys(("ambient", "emission", "gi", "reflection", "behind"), THREE)
BOUNDS = [(gtao, SURFACES), (bitmask_ao, SURFACES), (ssgi, RECEIVERS), (ssr, MIRRORS), (march_gi, RECEIVERS)]


@pytest.mark.parametrize(
    ("function", "given", "name"),
    [
        *((ssr, MIRRORS, name) for name in [*MIRRORS, *OPTIONAL, *MORE] if name != "camera"),
        *((march_gi, RECEIVERS, name) for name in [*RECEIVERS, *OPTIONAL] if name != "camera"),
        *((function, given, name) for function, given in BOUNDS[:3] for name in ("depth", "hit", "thickness")),
        *((thickness_from_depth, SURFACES, name) for name in ("depth", "normal", "hit")),
    ],
)
def test_planes_of_another_size_are_named(function: Callable[..., Any], given: dict[str, Any], name: str):
    wrong = {**given, name: {**WRONG, **MORE}[name]}
    with pytest.raises(ValueError, match=rf"^{name} must be \(1,[13],72,96\).*the camera sets the size, 72 rows of 96"):
        function(**wrong)


@pytest.mark.parametrize("name", [*PARTS, "visibility", "specular"])
def test_parts_of_another_size_are_named(name: str):
    with pytest.raises(ValueError, match=rf"^{name} must be \(1,[13],72,96\) like radiance; got \(1,[13],40,50\)"):
        composite(LIGHT, **{name: PARTS.get(name, ONE)})


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: ssr(**{**MIRRORS, "depth": G.depth.numpy()}), r"depth must be a torch\.Tensor, got ndarray"),
        (lambda: composite(np.zeros((1, 3, 2, 2))), r"radiance must be a torch\.Tensor, got ndarray"),  # pyright: ignore
        (lambda: composite(LIGHT, gi=np.zeros((1, 3, 72, 96))), r"gi must be a torch\.Tensor"),  # pyright: ignore
        (lambda: gtao(G.depth, G.normal, None), r"camera must be a gbufrt\.Camera, got NoneType"),  # pyright: ignore
        (lambda: metallic_from_color(np.zeros(3)), r"color must be a torch\.Tensor"),  # pyright: ignore
        (lambda: ssr(**{**MIRRORS, "steps": "4"}), "steps must be a whole number, got '4'"),
        (lambda: ssr(**{**MIRRORS, "samples": 1.5}), "samples must be a whole number, got 1.5"),
        (lambda: march_gi(**{**RECEIVERS, "rays": "4"}), "rays must be a whole number, got '4'"),
        (
            lambda: march_gi(**{**RECEIVERS, "distance": "far"}),
            "distance must be a number or a 0-dim tensor, got 'far'",
        ),
        (lambda: gtao(**{**SURFACES, "directions": 2.5}), "directions must be a whole number, got 2.5"),
        (lambda: gtao(**{**SURFACES, "radius": "2"}), "radius must be a number or a 0-dim tensor, got '2'"),
        (lambda: gtao(**{**SURFACES, "thickness": "1"}), "thickness must be a number or a 0-dim tensor, got '1'"),
        (lambda: GTAO(radius="2"), "radius of GTAO must be a number, got '2'"),  # pyright: ignore
        (lambda: SSR(distance="far"), "distance of SSR must be a number, got 'far'"),  # pyright: ignore
        (lambda: setattr(GTAO(), "steps", "4"), "steps of GTAO must be a number, got '4'"),
    ],
)
def test_what_is_no_tensor_or_number_is_named(call: Callable[[], Any], message: str):
    with pytest.raises(TypeError, match=f"^{message}"):
        call()


def test_one_thickness_for_all_is_a_number():
    for function, given in BOUNDS:
        for thickness in (0.5, torch.tensor(0.5)):
            found = function(**given, thickness=thickness)
            assert (found[0] if isinstance(found, tuple) else found).isfinite().all()


@pytest.mark.parametrize(
    "call",
    [
        lambda: normals_from_depth(ONE, G.camera),
        lambda: motion_from_depth(ONE, G.camera, G.depth, G.camera),
        lambda: motion_from_depth(G.depth, G.camera, ONE, G.camera),
        lambda: autofocus(ONE, G.camera),
        lambda: circle_of_confusion(ONE, G.camera, focus_distance=3.0, aperture_radius=0.1),
    ],
)
def test_depth_of_another_size_is_named(call: Callable[[], Any]):
    with pytest.raises(ValueError, match=r"^(previous_)?depth must be \([1B],1,72,96\)"):
        call()


def test_colours_without_a_batch_are_named():
    for function in (roughness_from_color, metallic_from_color):
        with pytest.raises(ValueError, match=r"color must be \(B,3,H,W\).*add the batch dimension"):
            function(LIGHT[0])
