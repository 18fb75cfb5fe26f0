"""A small world, stand-ins for tracer and presets, and the command line in one process."""

from __future__ import annotations

import os
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import boxes
import OpenEXR
import pytest
import torch

from gbufrt import Frame, Pass, Pipeline, TemporalPass
from gbufrt.commands.cli import main
from gbufrt.files.exr import read_exr
from gbufrt.noise.noise import blue_noise
from tracer.scene.material import Material, MaterialTable
from tracer.scene.scene import Scene
from tracer.scene.view import View
from tracer.scene.world import World

SMALL = ("--size", "24x16")


class Speckle(Pass):
    """A noisy signal, as an estimator makes it.

    Args:
        radius: of the speckles, in [units].
    """

    reads, writes = frozenset({"depth"}), frozenset({"ao"})

    def __init__(self, *, radius: float = 0.5, taps: int = 3, method: str = "bitmask", soft: bool = True) -> None:
        super().__init__()
        self.radius, self.taps, self.method, self.soft = radius, taps, method, soft

    def forward(self, frame: Frame) -> Frame:
        if self.radius <= 0:
            raise ValueError(f"radius must be positive, in world units, got {self.radius}")
        noise = blue_noise(*frame.gbuffer.camera.size, index=frame.index)[None]
        return frame.replace(ao=(noise * self.radius).clamp(0, 1))


class Mean(TemporalPass):
    """A running mean that follows motion only as far as to notice it."""

    reads, writes = frozenset({"ao", "motion"}), frozenset({"ao", "ao_length"})

    def __init__(self, *, blend: float = 0.9) -> None:
        super().__init__()
        self.blend = blend

    def forward(self, frame: Frame, state: Any = None) -> tuple[Frame, Any]:
        ao, motion = frame.read("ao"), frame.read("motion").norm(dim=1, keepdim=True)
        count = torch.ones_like(ao)
        if state is not None:
            mean, length = state
            count = torch.where(motion > 4.0, count, length + 1)
            ao = mean + (ao - mean) / count.clamp_max(10.0)
        return frame.replace(ao=ao).write("ao_length", count), (ao, count)


class TAA(Pass):
    """Named as the one that wants a jittered camera."""

    reads, writes = frozenset({"radiance", "ao"}), frozenset({"composite", "color"})

    def forward(self, frame: Frame) -> Frame:
        lit = frame.read("radiance") * frame.read("ao")
        return frame.replace(composite=lit, color=lit)


class Display(Pass):
    """What ends in a picture."""

    reads, writes = frozenset({"color"}), frozenset({"image"})

    def __init__(self, *, gain: float = 1.0) -> None:
        super().__init__()
        self.gain = gain

    def forward(self, frame: Frame) -> Frame:
        return frame.replace(image=(frame.read("color") * self.gain).clamp(0, 1))


def fake_me1(preset: str = "high", *, composite: str = "physical", units_per_metre: float = 1.0) -> Pipeline:
    if composite not in ("physical", "me1"):
        raise ValueError(f"composite must be physical or me1, got {composite!r}")
    if preset not in ("low", "high"):
        raise ValueError(f"preset must be low or high, got {preset!r}")
    ao = Pipeline(
        estimate=Speckle(taps=2 if preset == "low" else 3, radius=(0.4 if preset == "low" else 0.8) * units_per_metre),
        mean=Mean(),
    )
    return Pipeline(ao=ao, taa=TAA(), display=Display())


def fake_render(
    scene: Scene, camera: Any, *, previous_camera: Any, time: float, previous_time: float, index: int, light_samples=4
) -> Frame:
    frame = boxes.frame(camera, previous=previous_camera, index=index)
    behind = boxes.frame(camera, previous=previous_camera, index=index)
    return frame.replace(time=time, radiance=frame.read("radiance") * (1 + light_samples / 100), behind=behind)


def fake_load(name: str) -> Scene:
    if name not in ("builtin", "hollow"):
        raise FileNotFoundError(f"{name} does not exist; check the path")
    voxels = torch.zeros(2, 2, 2, dtype=torch.int16)
    voxels[0] = name == "builtin"
    world = World.from_dense(voxels, MaterialTable.of([Material(name="stone")]))
    front = View(eye=lambda t: (2.0 + 0.3 * t, 4.0, 9.0), target=lambda t: (0.3 * t, 1.0, 0.0), fov_y=50.0)
    return Scene(world=world, views={"front": front, "above": replace(front, fov_y=80.0)})


def install(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for name, attribute, value in (("post.presets", "me1", fake_me1), ("tracer.frames", "render", fake_render)):
        monkeypatch.setattr(import_module(name), attribute, value)
    monkeypatch.setattr("tracer.worlds.load", fake_load)
    monkeypatch.setattr("gbufrt.commands.arguments.checks.WORLDS", {"builtin": ("front", "above"), "hollow": ()})
    monkeypatch.chdir(tmp_path)


def run(*arguments: object) -> int:
    with pytest.raises(SystemExit) as exit:
        main([str(argument) for argument in arguments])
    assert isinstance(exit.value.code, int)
    return exit.value.code


def files(folder: str) -> list[str]:
    return sorted(str(p.relative_to(folder)) for p in Path(folder).rglob("*") if p.is_file())


def assert_same_results(a: str, b: str) -> None:
    assert files(a) == files(b)
    for name in (n for n in files(a) if n.endswith(".exr")):
        left, right = read_exr(f"{a}/{name}"), read_exr(f"{b}/{name}")
        assert left.present == right.present
        for signal in left.present:
            assert torch.equal(left.read(signal), right.read(signal)), (name, signal)


def spoil(path: str) -> None:
    """Overwrite what passes stored, as another program would, keeping the header."""
    frame, results = read_exr(path), {"ao", "ao_length", "composite", "color", "image"}
    assert results & set(frame.present)
    file = OpenEXR.File(path, separate_channels=True)
    for name, channel in file.parts[0].channels.items():
        if name in "RGB" or name.partition(".")[0] in results:
            channel.pixels[:] = 123.0
    file.write(path + ".new")
    os.replace(path + ".new", path)
    assert float(read_exr(path).read("ao").min()) == 123.0
