"""Arguments of the wrong kind to cameras, frames, files and pipelines are named in our words."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import boxes
import pytest
import torch

import tracer
from gbufrt import Camera, Pipeline
from gbufrt.files import read_gbuffer
from gbufrt.files.exr import write_exr
from post import GTAO, SSR, Temporal, Upscale, me1, motion_blur

FRAME: Any = boxes.frame()
G = FRAME.gbuffer
CAMERA: Any = G.camera
K, POSE = CAMERA.intrinsics[0], CAMERA.world_from_view[0]
SIZE: Any = CAMERA.size
LOW: Any = me1("low")
AHEAD: Any = {"eye": (0, 0, 0), "target": (0, 0, 1), "size": (4, 5)}
WORD: Any = "x"
NONE: Any = None
NUMBER: Any = 3
KIND: Any = GTAO


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: Camera.from_intrinsics(K, POSE, size=SIZE, near=WORD), "near must be a number or a 0-dim tensor"),
        (lambda: Camera.from_intrinsics(WORD, POSE, size=SIZE), "intrinsics must be rows of numbers, got 'x'"),
        (
            lambda: Camera(intrinsics=K.numpy()[None], world_from_view=POSE[None], size=SIZE),
            r"intrinsics must be a torch\.Tensor, got ndarray; Camera\.from_intrinsics takes arrays and lists",
        ),
        (lambda: Camera(intrinsics=K[None], world_from_view=POSE[None], size=SIZE, far=WORD), "far must be a number"),
        (lambda: Camera.look_at(**AHEAD, fov_y=WORD), "fov_y must be a number"),
        (lambda: Camera.look_at(**{**AHEAD, "eye": "x"}), "eye must be three numbers or a tensor, got 'x'"),
        (lambda: CAMERA.unproject(G.depth.numpy()), r"depth must be a torch\.Tensor, got ndarray"),
        (lambda: FRAME.replace(time="1"), "time must be a number or a 0-dim tensor, got '1'"),
        (lambda: FRAME.replace(index=1.5), "index must be a whole number, got 1.5"),
        (lambda: FRAME.to(torch.float16), "channels are float32 or float64, got float16; convert single pictures"),
        (lambda: write_exr("a.exr", G), r"frame must be a gbufrt\.Frame, got GBuffer"),
        (lambda: tracer.load(3), "name_or_path must be a name or a path, got int"),  # pyright: ignore
        (lambda: LOW.settle(FRAME, 2.5), "runs must be a whole number, got 2.5"),
        (lambda: LOW(FRAME, keep_graph=WORD), "keep_graph must be True or False, got 'x'"),
        (lambda: next(LOW.stream([FRAME], keep_graph=NUMBER)), "keep_graph must be True or False, got 3"),
        (lambda: G.replace(depth=G.depth.numpy()), r"depth must be .*, got ndarray; use torch\.from_numpy\(x\)"),
        (
            lambda: G.replace(depth=G.depth.half()),
            r"depth must be float32 or float64, got float16; convert it with \.float\(\)",
        ),
        (lambda: G.replace(hit=G.hit.byte()), r"hit must be bool, got uint8; convert it with \.bool\(\)"),
        (lambda: LOW.settle(G), r"frame must be a gbufrt\.Frame, got GBuffer"),
        (lambda: list(LOW.stream(FRAME)), r"frames must be frames in order, got a Frame; stream\(\[frame\]\)"),
        (lambda: list(LOW.stream(NONE)), "frames must be frames in order, got a NoneType"),
        (lambda: FRAME.validate(WORD), r"before must be a gbufrt\.Frame, got str"),
        (lambda: FRAME.validate(G), r"before must be a gbufrt\.Frame, got GBuffer"),
        (lambda: G.validate(FRAME), r"before must be a gbufrt\.GBuffer, got Frame"),
        (lambda: FRAME.replace(radience=G.depth), r"Frame has no field 'radience' \(did you mean radiance\?\)"),
        (lambda: G.replace(dept=G.depth), r"GBuffer has no field 'dept' \(did you mean depth\?\)"),
        (lambda: LOW.without(["gi", "ao"]), r"a stage is named by text .*, several one by one; got \['gi', 'ao'\]"),
        (lambda: Pipeline(ao=KIND), r"stage 'ao' must be a Pass.*, got the class GTAO; write GTAO\(\)"),
        (lambda: Temporal()(G), r"frame must be a gbufrt\.Frame, got GBuffer"),
        (lambda: read_gbuffer("a.exr", camera=WORD), r"camera must be a gbufrt\.Camera, got str"),
        (lambda: read_gbuffer("a.exr", fov=WORD), "fov must be a number or a 0-dim tensor, got 'x'"),
        (lambda: read_gbuffer("a.exr", fov=45.0, index=WORD), "index must be a whole number, got 'x'"),
        (lambda: read_gbuffer(NUMBER), "path must be a path, or those of one frame, got int"),
        (lambda: me1(units_per_metre=WORD), "units_per_metre must be a number or a 0-dim tensor, got 'x'"),
        (lambda: motion_blur(WORD, G.depth, NONE), r"color must be a torch\.Tensor, got str"),
        (lambda: GTAO(radios=1), ".*unexpected keyword argument 'radios'"),  # pyright: ignore
        (lambda: LOW.with_tunables([("a", 1)]), r'values must be a mapping such as \{"gtao\.radius": 2\.0\}, got list'),
    ],
)
def test_the_wrong_kind_is_named(
    call: Callable[[], Any], message: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(TypeError, match=f"^{message}"):
        call()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: Camera.from_intrinsics(torch.eye(4), POSE, size=SIZE),
            r"intrinsics must be .*, got \(1,4,4\); its first three rows and columns: intrinsics\[\.\.\., :3, :3\]",
        ),
        (lambda: Camera.look_at(**AHEAD, orthographic_height=-1.0), "orthographic_height must be positive"),
        (lambda: CAMERA.with_jitter((1, 2, 3)), r"jitter must be \(2,\) or \(1,2\) in pixels, got \(3\)"),
        (lambda: CAMERA.unproject(G.depth[..., :4]), r"depth must be \(B,1,72,96\) like its camera, got \(1,1,72,4\)"),
        (lambda: CAMERA.normals_from_depth(G.depth[..., :4]), r"depth must be \(B,1,72,96\) like its camera"),
        (lambda: FRAME.to("foo"), "device must be one that torch knows, such as 'cpu' or 'cuda', got 'foo'"),
        (lambda: FRAME.to(3.5), r"device must be one that torch knows, such as 'cpu' or 'cuda', got 3\.5"),
        (lambda: FRAME.to("cuda:99"), r"there is no device 'cuda:99': torch sees (no|\d+) GPUs; 'cpu' is always there"),
        (lambda: CAMERA.to(device="cuda:99"), "there is no device 'cuda:99'"),
        (lambda: FRAME.read("dept"), r"the frame has no 'dept' \(did you mean depth\?\); it has depth, hit"),
        (lambda: me1(units_per_metre=float("nan")), "units_per_metre must be positive, got nan"),
        (lambda: Upscale(ratio=0), "ratio must lie in 1 to 4, got 0"),
        (
            lambda: LOW.with_tunables({"gtao.method": "bit"}),
            r"method of GTAO must be one of 'bitmask', 'horizon', got 'bit' \(did you mean bitmask\?\)",
        ),
        (lambda: SSR(method=WORD), "method of SSR must be one of 'ggx', 'cone', got 'x'"),
        (lambda: Temporal(signal=3), "signal must be a name or several such as"),  # pyright: ignore
    ],
)
def test_the_wrong_value_is_named(call: Callable[[], Any], message: str):
    with pytest.raises(ValueError, match=f"^{message}"):
        call()
