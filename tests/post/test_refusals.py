"""What is no frame, state, camera, scene or picture is named in one sentence."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
import torch

import tracer
from gbufrt import Camera, GBuffer
from post import display_encode, exposure, fxaa, me1, normals_from_depth, tone_map

CAMERA = Camera.look_at((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), size=(3, 4))
FLAT: Any = torch.ones(3, 3, 4)
GBUFFER: Any = GBuffer
WRONG: dict[str, tuple[Callable[[], Any], str]] = {
    "frame": (lambda: me1("low")(FLAT), "frame must be a gbufrt.Frame, got Tensor"),
    "camera": (lambda: GBUFFER(camera=None, depth=FLAT, normal=FLAT, hit=FLAT), "camera must be a gbufrt.Camera, got"),
    "scene": (lambda: tracer.gbuffer(GBUFFER, CAMERA), "scene must be a tracer.Scene, got"),
    "batch": (lambda: tone_map(FLAT), r"color must be \(B,3,H,W\)"),
    "array": (lambda: fxaa(FLAT.numpy()), "must be a torch.Tensor, got ndarray"),
    "bytes": (lambda: display_encode(FLAT[None].byte()), "image must be of floats, got uint8"),
    "exposed": (lambda: exposure(FLAT), r"color must be \(B,3,H,W\)"),
    "depth": (lambda: normals_from_depth(FLAT[None], CAMERA), r"depth must be \(B,1,H,W\)"),
    "planes": (lambda: CAMERA.normals_from_depth(FLAT[None]), r"depth must be \(B,1,H,W\)"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_does_not_fit_is_named(name: str):
    call, message = WRONG[name]
    with pytest.raises((TypeError, ValueError), match=message):
        call()
