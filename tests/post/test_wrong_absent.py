"""What a function cannot do without is named where it is absent; numbers of numpy are numbers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import boxes
import numpy as np
import pytest
import torch

import post
from gbufrt import Camera, History
from gbufrt.compute.kernel import Kernel
from gbufrt.history import PipelineState
from gbufrt.mending import mended

FRAME = boxes.frame(boxes.camera((12, 16)))
G, THREE = FRAME.gbuffer, torch.rand(1, 3, 12, 16)
SURFACES: dict[str, Any] = {"depth": G.depth, "normal": G.normal, "camera": G.camera}
FILTERED = {**SURFACES, "signal": THREE, "hit": G.hit}
LIT = {**SURFACES, "light": THREE, "albedo": THREE}
NONE: Any = None
X: Any = "x"
C: Any = G.camera
LOW: Any = post.me1("low")
NEEDED: tuple[tuple[Callable[..., Any], dict[str, Any], str], ...] = (
    (post.atrous, FILTERED, "signal depth normal hit"),
    (post.bilateral, FILTERED, "signal depth normal hit"),
    (post.ssgi, LIT, "depth normal light albedo"),
    (post.march_gi, LIT, "depth normal light albedo"),
    (post.gtao, SURFACES, "depth normal"),
    (post.taa, {"color": THREE, "gbuffer": G}, "color"),
    (post.denoise, {"light": THREE, "gbuffer": G}, "light"),
    (post.circle_of_confusion, {"depth": G.depth, "camera": C, "focus_distance": 1.0, "aperture_radius": 0.1}, "depth"),
)


@pytest.mark.parametrize(("function", "given", "names"), NEEDED, ids=lambda part: getattr(part, "__name__", ""))
def test_absent_pictures_are_named(function: Callable[..., Any], given: dict[str, Any], names: str):
    """A G-buffer holds None for what it lacks, which is easily passed on."""
    for name in names.split():
        with pytest.raises(TypeError, match=rf"^{name} must be a torch\.Tensor, got None"):
            function(**{**given, name: None})


def test_numbers_of_numpy_are_numbers_and_need_no_kernels_of_their_own(monkeypatch: pytest.MonkeyPatch):
    of: dict[Callable[..., Any], dict[str, Any]] = {
        post.fxaa: {"image": THREE, "subpixel": 0.25},
        post.atrous: {**FILTERED, "phi_color": 2.5},
        post.bilateral: {**FILTERED, "sigma": 1.5},
    }
    plain = {function: function(**given) for function, given in of.items()}
    called = list[Any]()
    call = Kernel.__call__

    def spied(kernel: Kernel, *arguments: Any, **grid: Any) -> None:
        before = len(kernel.dispatcher.overloads)
        call(kernel, *arguments, **grid)
        called.append(len(kernel.dispatcher.overloads) - before)

    monkeypatch.setattr(Kernel, "__call__", spied)
    for function, given in of.items():
        narrow = {name: np.float32(x) if isinstance(x, float) else x for name, x in given.items()}
        found, wanted = function(**narrow), plain[function]
        pairs = zip(found, wanted, strict=True) if isinstance(found, tuple) else [(found, wanted)]
        assert all(torch.equal(one, other) for one, other in pairs)
    assert called
    assert not any(called), "a kernel was compiled for float32"


KINDS: list[tuple[Callable[[], Any], str]] = [
    (lambda: Camera.from_intrinsics(NONE, C.world_from_view, size=(12, 16)), "intrinsics must be rows of numbers, got"),
    (lambda: C.with_jitter(X), "jitter must be two numbers or a tensor, in pixels, got 'x'"),
    (lambda: C.to_world(G.normal.numpy()), "points and directions must be a tensor of float32 or float64, got ndarray"),
    (lambda: C.project(G.hit.expand(1, 3, 12, 16)), r"points and directions must be a tensor .*, got torch\.bool"),
    (lambda: C.static_motion(X, G.depth, G.hit), r"previous must be a gbufrt\.Camera, got str"),
    (lambda: Camera.look_at(NONE, (0, 0, 0), size=(3, 4)), "eye must be three numbers or a tensor, got None"),
    (lambda: LOW.with_stage(NONE, post.FXAA(), before="taa"), "name of the new stage must be a text such as 'fog'"),
    (lambda: LOW.compile(X), r"frame must be a gbufrt\.Frame, got str"),
    (lambda: mended(X), r"frame must be a gbufrt\.Frame, got str"),
    (
        lambda: History(length=torch.ones(1, 1, 2, 2)).reset(torch.ones(1)),
        r"mask must be a \(B,\) bool tensor, got \(1,",
    ),
    (lambda: PipelineState().reset(X), r"mask must be a \(B,\) bool tensor, got str"),
    (lambda: post.exposure(THREE, X), r"previous must be a torch\.Tensor, got str; this function returned it"),
    (lambda: post.exposure(THREE, torch.zeros(1), elapsed=X), "elapsed must be a number"),
    (lambda: post.pulse(X, 0.0), r"exposure must be a torch\.Tensor, got str"),
    (lambda: post.pulse(torch.ones(1), X), "time must be a number"),
    (lambda: post.depth_of_field(THREE, G.depth, X), r"camera must be a gbufrt\.Camera, got str"),
    (lambda: post.autofocus(G.depth, C, hit=G.hit.int()), "hit must be bool, got int32"),
]
VALUES: list[tuple[Callable[[], Any], str]] = [
    (lambda: Camera.from_intrinsics([1, 2], C.world_from_view, size=(12, 16)), r"intrinsics must be \(3,3\) or"),  # pyright: ignore
    (lambda: Camera.from_intrinsics(C.intrinsics, 3, size=(12, 16)), r"world_from_view must be \(4,4\) or \(B,4,4\)"),  # pyright: ignore
    (lambda: Camera.look_at((0, torch.nan, 0), (0, 0, 1), size=(3, 4)), r"eye must be finite, got \(0, nan, 0\)"),
    (lambda: C.to_view(torch.rand(3)), r"points and directions must be \(B,3,...\), got \(3,\)"),
    (lambda: C.static_motion(C, G.depth[..., 1:], G.hit), r"depth must be \(B,1,12,16\) like its camera"),
    (lambda: post.pulse(torch.ones(1), torch.inf), "time must be finite, in seconds, got inf"),
    (
        lambda: post.circle_of_confusion(G.depth, C, focus_distance=torch.zeros(0), aperture_radius=0.1),
        r"focus_distance must hold a number at least, got an empty tensor \(0,\)",
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
