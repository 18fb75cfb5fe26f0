"""The padded picture: the kernel against the torch code of `post.margin`."""

from __future__ import annotations

from typing import Any

import boxes
import pytest
import torch

from gbufrt import Camera
from post.margin.op import padded_cpu, scene
from post.margin.view import PaddedView
from post.passes.light import ssgi as ssgi_module
from post.passes.light.ssgi import ssgi
from post.sweep import bitmask
from post.sweep.bitmask import bitmask_ao


@pytest.mark.parametrize("case", ["plain", "moved", "orthographic", "jittered"])
@pytest.mark.parametrize(("lit", "within"), [(False, False), (True, False), (True, True)])
def test_kernel_pads_as_the_reference(case: str, lit: bool, within: bool):
    camera = boxes.camera((54, 72), orthographic=case == "orthographic", dx=0.7 if case == "moved" else 0.0)
    g = boxes.frame(camera.with_jitter((0.3, -0.4)) if case == "jittered" else camera).gbuffer
    light = torch.rand(g.normal.shape) if lit else None
    given = (g.camera, g.depth, g.normal, g.hit, torch.rand(g.depth.shape) + 0.5)
    kernel, reference = (scene(*given, light=light, within=within, compiled=compiled) for compiled in (True, False))
    same = (kernel.picture > 0) == (reference.picture > 0)
    assert float(same.double().mean()) > 0.9999
    torch.testing.assert_close(
        torch.where(same, kernel.picture, 0.0), torch.where(same, reference.picture, 0.0), rtol=2e-4, atol=1e-4
    )
    assert float(kernel.picture[:, :1].sum()) > float((g.depth * g.hit).sum()), "the margin is not empty"


def test_one_pixel_and_an_empty_picture():
    camera = Camera.look_at((0.0, 0.0, 3.0), (0.0, 0.0, 0.0), size=(1, 1))
    one = torch.ones(1, 1, 1, 1)
    normal = torch.tensor([0.0, 0.0, 1.0]).view(1, 3, 1, 1)
    for hit in (one > 0, one < 0):
        found = [scene(camera, one, normal, hit, one, compiled=compiled).picture for compiled in (True, False)]
        torch.testing.assert_close(*found)
        assert bool(hit.any()) == bool(found[0].any())


def test_operator_is_registered_properly():
    g = boxes.frame(boxes.camera((6, 8))).gbuffer
    for light in (g.normal, g.normal[:, :0]):
        given = (g.depth, g.normal, g.depth, g.hit, light, torch.ones(1, 4), torch.eye(3)[None], 2, 0.1, False)
        torch.library.opcheck(padded_cpu, given, test_utils=("test_schema", "test_faketensor"))


@pytest.mark.parametrize("compiled", [True, False])
def test_taps_that_end_at_the_border_need_no_more_of_the_margin(compiled: bool, monkeypatch: pytest.MonkeyPatch):
    def whole(*given: Any, within: bool, **options: Any) -> PaddedView:
        assert within
        return scene(*given, **options)

    frame = boxes.frame(boxes.camera((40, 52)))
    g, light = frame.gbuffer, frame.read("radiance")
    known: dict[str, Any] = {"hit": g.hit, "thickness": 0.5, "directions": 2, "steps": 8, "compiled": compiled}
    found = []
    for _ in range(2):
        found.append(
            [
                torch.cat(ssgi(g.depth, g.normal, g.camera, light, g.normal, **known), dim=1),
                torch.cat(ssgi(g.depth, g.normal, g.camera, light, g.normal, distance=2.0, **known), dim=1),
                torch.cat(bitmask_ao(g.depth, g.normal, g.camera, radius=None, **known), dim=1),
            ]
        )
        monkeypatch.setattr(ssgi_module, "scene", whole)
        monkeypatch.setattr(bitmask, "scene", whole)
    assert all(torch.equal(*pair) for pair in zip(*found, strict=True))
