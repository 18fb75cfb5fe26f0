"""What frames hold, states forget and stages are told beside pictures: named where it is of the wrong kind or size."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import boxes
import numpy as np
import pytest
import torch

import post
from gbufrt import Frame, Pipeline
from gbufrt.history import History, PipelineState

FRAME = boxes.frame(boxes.camera((12, 16)))
SMALL = boxes.frame(boxes.camera((6, 8)))
G, THREE = FRAME.gbuffer, torch.rand(1, 3, 12, 16)
LOW: Any = post.me1("low")
WORD: Any = "x"
NUMBER: Any = 3
SEVERAL: Any = ("gi", "ao")
MASK = torch.tensor([True, False, True])
LENS: dict[str, Any] = {"color": THREE, "depth": G.depth, "camera": G.camera, "focus_distance": 8.0}
MOVED: dict[str, Any] = {"color": THREE, "depth": G.depth, "motion": 9 * THREE[:, :2]}
TWO = torch.rand(2, 3, 12, 16)

SURFACES: dict[str, Any] = {"depth": G.depth, "normal": G.normal, "camera": G.camera}
FILTERED: dict[str, Any] = {**SURFACES, "hit": G.hit}

KINDS: list[tuple[Callable[[], Any], str]] = [
    (lambda: Frame(gbuffer=G, extra=WORD), r'extra must be a mapping such as \{"mine": tensor\}, got str'),
    (lambda: FRAME.write(NUMBER, THREE), "extra signals are named by text, got 3"),
    (lambda: FRAME.replace(behind=G), r"behind must be a gbufrt\.Frame, got GBuffer"),
    (lambda: FRAME.replace(previous=WORD), r"previous must be a gbufrt\.Frame, got str"),
    (lambda: FRAME.moving_as(WORD), r"frame must be a gbufrt\.Frame, got str"),
    (lambda: LOW.with_tunables({3: 1.0}), r"a tunable is named by text such as 'gtao\.radius', got 3"),
    (lambda: post.Denoise(signal=SEVERAL), r"signal must be one name such as 'radiance', got \('gi', 'ao'\)"),
    (lambda: post.ASVGF(signal=WORD[:0]), "signal must be one name such as 'diffuse', got ''"),
    (
        lambda: post.motion_from_depth(G.depth, G.camera, G.depth, WORD),
        r"previous_camera must be a gbufrt\.Camera, got",
    ),
    (
        lambda: post.ssgi(G.depth, G.normal, G.camera, THREE, THREE, distance=WORD),
        "distance must be a number or a 0-dim tensor, got 'x'",
    ),
    (lambda: post.vignette(THREE, strength=np.array(0.2)), "strength must be a number .*, got ndarray"),  # pyright: ignore
    (
        lambda: post.depth_of_field(**{**LENS, "focus_distance": torch.tensor(1j)}),
        r"focus_distance must be a number or a tensor, got one of torch\.complex64",
    ),
]
KINDS += [
    (lambda: post.denoise(THREE, G, behind=WORD), r"behind must be a gbufrt\.GBuffer, got str"),
    (lambda: post.fog(THREE, G.hit, G), "transmittance must be float32 or float64, got bool"),
    (lambda: post.fog(THREE, THREE[:, :1], G, iterations=WORD), "iterations must be a whole number, got 'x'"),
    (lambda: post.atrous(THREE * 1j, **FILTERED), r"signal must hold real numbers, got torch\.complex64"),
    (lambda: post.bitmask_ao(**SURFACES, where=G.depth), "where must be bool, got float32"),
]
VALUES: list[tuple[Callable[[], Any], str]] = [
    (lambda: Pipeline(given=NUMBER), r"given must be a name or several such as \('ao', 'gi'\), got 3"),
    (
        lambda: post.Temporal(signal="mine")(FRAME.write("mine", torch.rand(3))),
        r"mine must be \(B,C,H,W\), any unit; got \(3\)",
    ),
    (lambda: post.bitmask_ao(**SURFACES, where=SMALL.gbuffer.hit), r"where must be \(1,1,12,16\), .*got \(1,1,6,8\)"),
    (lambda: post.bilateral(THREE[:, :0], **FILTERED), r"signal must be \(1,C,12,16\) like its camera, got \(1, 0,"),
    (lambda: post.motion_blur(**{**MOVED, "color": THREE[:, :0]}), r"color must be \(B,C,H,W\), .* got \(1,0,12,16\)"),
    (
        lambda: post.denoise(THREE, G, behind=SMALL.gbuffer),
        r"behind\.depth must be \(1,C,12,16\) like its camera, got \(1, 1, 6, 8\)",
    ),
    (lambda: post.fog(TWO, THREE[:, :1], G), r"light must be of 1 pictures like its camera, got \(2, 3, 12, 16\)"),
    (lambda: post.fog(THREE, THREE[:, :2], G), r"transmittance must be \(B,1,H,W\), .* got \(1,2,12,16\)"),
    (lambda: FRAME.replace(behind=SMALL), "behind must have 16x12 pixels in a batch of 1, got 8x6 pixels in a batch"),
    (lambda: PipelineState(previous=FRAME).reset(MASK), r"mask must be \(1,\) bool, one for each picture, got \(3,\)"),
    (lambda: History(length=torch.ones(1, 1, 2, 2)).reset(MASK), r"mask must be \(1,\) bool, one for each picture"),
    (lambda: post.depth_of_field(**LENS, layer_step=torch.inf), r"layer_step must lie in \(0, 1\], got inf"),
    (
        lambda: post.depth_of_field(**LENS, aperture_radius=torch.ones(3)),
        r"aperture_radius must hold one number, or 1: one for each picture; got one of shape \(3,\)",
    ),
    (lambda: post.motion_blur(**MOVED, shutter=torch.ones(3)), "shutter must hold one number, or 1: one for each"),
    (lambda: post.tone_map(THREE, exposure=torch.ones(16)), "exposure must hold one number, or 1: one for each"),
    (lambda: post.exposure(THREE, torch.zeros(3)), r"previous must be \(1,\), one for each picture, got \(3,\)"),
    (lambda: post.exposure(THREE, torch.zeros(1), elapsed=torch.ones(2)), "elapsed must hold one number, or 1"),
    (lambda: post.exposure(THREE, torch.zeros(1), elapsed=torch.nan), "elapsed must be at least 0, got nan"),
    (
        lambda: post.ssr(G.depth, G.normal, G.camera, THREE, THREE[:, :1], environment=THREE[:, :, :0]),
        r"environment must be \(1,3,h,w\), .*; got \(1,3,0,16\)",
    ),
]


@pytest.mark.parametrize(("call", "message"), KINDS)
def test_the_wrong_kind_is_named(call: Callable[[], Any], message: str):
    with pytest.raises(TypeError, match=f"^{message}"):
        call()


@pytest.mark.parametrize(("call", "message"), VALUES)
def test_the_wrong_value_is_named(call: Callable[[], Any], message: str):
    with pytest.raises(ValueError, match=f"^{message}"):
        call()


def test_signals_of_any_shape_are_listed():
    assert "mine (3,)" in repr(FRAME.write("mine", torch.rand(3)))


def test_one_name_needs_no_list():
    assert Pipeline(given="image", encode=post.DisplayEncode()).given == {"image"}
    assert FRAME.write("reflection", THREE).write("reflection_confidence", THREE[:, :1]).only(
        "reflection_confidence"
    ).present == ("depth", "hit", "normal", "reflection_confidence")
    assert FRAME.as_previous("radiance").radiance is FRAME.radiance


@pytest.mark.parametrize("operator", ["agx", "reinhard"])
def test_exposures_of_a_batch_are_one_a_picture(operator: Any):
    """Not one a column, where pictures are as wide as the batch is long."""
    picture, gains = TWO[..., :2], torch.tensor([0.5, 2.0])
    alone = [
        post.tone_map(one[None], operator=operator, exposure=float(g)) for one, g in zip(picture, gains, strict=True)
    ]
    assert torch.allclose(post.tone_map(picture, operator=operator, exposure=gains), torch.cat(alone), atol=1e-6)


def test_a_ratio_may_be_a_tensor():
    assert post.upscale(THREE, G, ratio=torch.tensor(2.0))[0].shape == (1, 3, 24, 32)  # pyright: ignore


def test_focus_passes_over_surfaces_without_a_depth():
    """Files that hold 0 for the sky say elsewhere, or not at all, where that is."""
    depth = torch.full_like(G.depth, 5.0)
    depth[:, :, :7] = 0.0
    assert post.autofocus(depth, G.camera, region=1.0).tolist() == [5.0]
    assert post.autofocus(0 * depth, G.camera).tolist() == [G.camera.far]
