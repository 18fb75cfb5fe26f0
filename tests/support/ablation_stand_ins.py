"""A quick world, pipeline and truth for tests of the ablation; ``calls`` counts what would be slow."""

from __future__ import annotations

from collections import Counter
from importlib import import_module
from typing import Any

import boxes
import pytest
import torch
from torch import Tensor

from gbufrt import Camera, Frame, GBuffer, Pass, Pipeline
from gbufrt.commands.arguments.checks import WORLD
from post import TAA, Composite, DepthOfField, MotionBlur
from tracer.sampling.progressive import Truth
from tracer.scene.material import Material, MaterialTable
from tracer.scene.scene import Scene
from tracer.scene.view import View
from tracer.scene.world import World

calls: Counter[str] = Counter()
OPEN = 0.6  # what the true AO is


class FakeAO(Pass):
    """AO that is off by ``bias``."""

    reads, writes = frozenset({"depth", "normal"}), frozenset({"ao", "bent_normal"})

    def __init__(self, *, bias: float = 0.01, radius: float = 1.0, steps: int = 3) -> None:
        super().__init__()
        self.bias, self.radius, self.steps = bias, radius, steps

    def forward(self, frame: Frame) -> Frame:
        calls["ao"] += 1
        if self.radius > 3:
            raise ValueError(f"radius must be at most 3, got {self.radius}")
        ao = torch.where(frame.gbuffer.hit, OPEN + self.bias, 1.0)
        return frame.replace(ao=ao, bent_normal=frame.gbuffer.normal)


class FakeGI(Pass):
    """GI at half its true value."""

    reads, writes = frozenset({"radiance"}), frozenset({"gi", "sky_visibility"})

    def __init__(self, *, share: float = 0.5, bounces: int = 2) -> None:
        super().__init__()
        self.share, self.bounces = share, bounces

    def forward(self, frame: Frame) -> Frame:
        lit = self.share * self.bounces * 0.2 * frame.read("radiance")
        return frame.replace(gi=lit, sky_visibility=torch.ones_like(frame.gbuffer.depth))


class FakeSSR(Pass):
    """A reflection that is a tenth too bright."""

    reads, writes = frozenset({"radiance"}), frozenset({"reflection"})

    def forward(self, frame: Frame) -> Frame:
        return frame.replace(reflection=(0.11 if frame.gi is None else 0.15) * frame.read("radiance"))


def fake_me1(preset: str = "high", *, composite: str = "physical", units_per_metre: float = 1.0) -> Pipeline:
    if preset not in ("low", "medium", "high"):
        raise ValueError(f"preset must be low, medium or high, got {preset!r}")
    return Pipeline(
        ao=Pipeline(estimate=FakeAO()),
        gi=Pipeline(estimate=FakeGI()),
        reflection=Pipeline(estimate=FakeSSR()),
        composite=Composite(mode=composite),  # pyright: ignore[reportArgumentType]
        taa=TAA(),
        motion_blur=MotionBlur(),
        depth_of_field=DepthOfField(),
    )


def fake_render(scene: Scene, camera: Camera, *, previous_camera: Camera, time: float = 0.0, index: int = 0, **_: Any):
    calls["render"] += 1
    frame = boxes.frame(camera, previous=previous_camera, index=index)
    smooth = frame.gbuffer.replace(roughness=torch.zeros_like(frame.gbuffer.depth))
    return frame.replace(time=time, gbuffer=smooth)


def fake_gbuffer(scene: Scene, camera: Camera, *, previous_camera: Camera, **_: Any) -> GBuffer:
    return boxes.frame(camera, previous=previous_camera).gbuffer


def truth_of(**values: Tensor) -> Truth:
    return Truth(values=values, error={n: torch.full_like(v, 0.01) for n, v in values.items()}, samples=1)


def ambient_occlusion(scene: Scene, gbuffer: GBuffer, *, radius: float, **_: Any) -> Truth:
    calls["truth ao"] += 1
    ao = torch.where(gbuffer.hit, OPEN, 1.0)
    ao[..., ::2] -= 0.1 * gbuffer.hit[..., ::2]
    bent = torch.nn.functional.normalize(gbuffer.normal + torch.tensor([0.0, 0.5, 0.0]).view(1, 3, 1, 1), dim=1)
    return truth_of(ao=ao, bent_normal=bent, ao_onscreen=ao)


def indirect_diffuse(scene: Scene, gbuffer: GBuffer, *, bounces: int, **_: Any) -> Truth:
    calls["truth gi"] += 1
    light = 0.2 * boxes.frame(gbuffer.camera).read("radiance")
    return truth_of(gi=light * 1.5, gi_onscreen=light, sky_visibility=torch.ones_like(gbuffer.depth))


def reflection(scene: Scene, gbuffer: GBuffer, **_: Any) -> Truth:
    calls["truth reflection"] += 1
    light = 0.1 * boxes.frame(gbuffer.camera).read("radiance")
    return truth_of(reflection=light, reflection_onscreen=light, onscreen=torch.ones_like(gbuffer.depth))


def path_trace(scene: Scene, camera: Any, *, time: float, **_: Any) -> Truth:
    calls["truth picture"] += 1
    camera = camera(time) if callable(camera) else camera
    frame = boxes.frame(camera)
    light = 1.5 * frame.read("radiance") + frame.read("ambient")
    onscreen = light.clone()
    onscreen[..., ::2] *= 0.9
    return truth_of(radiance=light, radiance_onscreen=onscreen)


def fake_load(name: str) -> Scene:
    if name not in ("builtin", "other"):
        raise FileNotFoundError(f"no such file: {name}")
    voxels = torch.ones(2, 2, 2, dtype=torch.int16) if name == "builtin" else torch.ones(3, 3, 3, dtype=torch.int16)
    world = World.from_dense(voxels, MaterialTable.of([Material(name="stone"), Material(name="brick")]))
    front = View(eye=lambda t: (2.0 + 0.3 * t, 4.0, 9.0), target=lambda t: (0.3 * t, 1.0, 0.0), fov_y=50.0)
    above = View(eye=lambda t: (2.0, 8.0, 4.0), target=lambda t: (0.0, 1.0, 0.0), fov_y=60.0)
    return Scene(world=world, views={"front": front, "above": above})


def install(monkeypatch: pytest.MonkeyPatch) -> None:
    """Put the stand-ins in place of the real ones for one test."""
    calls.clear()
    stand_ins = {
        "post.presets": ("me1", fake_me1),
        "tracer.frames": ("render", fake_render),
        "tracer.gbuffers": ("gbuffer", fake_gbuffer),
        "tracer.worlds": ("load", fake_load),
    }
    for module, (name, value) in stand_ins.items():  # the packages hide some modules behind functions of their name
        monkeypatch.setattr(import_module(module), name, value)
    monkeypatch.setattr(
        "gbufrt.commands.arguments.checks.WORLDS", {"builtin": ("front", "above"), "other": ("front", "above")}
    )
    monkeypatch.setattr("gbufrt.commands.ablation.world.VIEWS", dict.fromkeys(WORLD, ()))
    monkeypatch.setattr("gbufrt.commands.ablation.denoising.FRAMES", 3)
    monkeypatch.setattr("gbufrt.commands.ablation.subjects.PATH_FRAMES", 6)
    for integrator in (ambient_occlusion, indirect_diffuse, reflection, path_trace):
        monkeypatch.setattr(import_module("tracer.truth.truth"), integrator.__name__, integrator)


__all__ = ["OPEN", "FakeAO", "FakeGI", "calls", "install"]
