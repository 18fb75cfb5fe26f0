"""The README's table of gradients, cell by cell, against finite differences."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import boxes
import pytest
import smooth
import torch
from torch import Tensor

import post
from gbufrt import CHANNELS, Frame, Stage, TemporalPass

README = (Path(__file__).parents[2] / "README.md").read_text()


@dataclass(frozen=True)
class Case:
    """How a row is tried: where the pass is smooth, and with its inputs there."""

    stage: Stage
    light: str = ""
    instead: dict[str, dict[str, Any]] = field(default_factory=dict)
    """Tunables for single columns."""
    absent: tuple[str, ...] = ()
    """Channels that the frame lacks."""
    without: dict[str, tuple[str, ...]] = field(default_factory=dict)
    """Further ones, for single columns."""
    among_boxes: tuple[str, ...] = ()
    """Columns for which a floor and a wall have no silhouettes to tell anything by."""
    step: float = 1e-6
    groups: int = 3
    agree: float = 1.0
    """Share of the groups that must. Rays that hit a crack between surfaces stay at a pixel's border: few, but some."""
    tolerance: float = 1e-3


SWEEP: dict[str, Any] = {"directions": 2, "steps": 4}
RAYS: dict[str, Any] = {"step": 1e-3, "groups": 40, "agree": 0.85, "tolerance": 1e-2}  # float32 inside
MATERIAL = ("roughness", "metallic", "motion")
CASES = {
    "GTAO, bitmask": Case(post.GTAO(**SWEEP, radius=2.0), without={"thickness=": ("thickness",)}),
    "GTAO, horizons": Case(post.GTAO(**SWEEP, radius=2.0, method="horizon")),
    "SSGI": Case(post.SSGI(**SWEEP), "radiance", without={"thickness=": ("thickness",)}),
    "MarchGI": Case(post.MarchGI(rays=4), "radiance", **RAYS),
    "SSR": Case(post.SSR(samples=2), "radiance", **RAYS),
    "Bilateral": Case(post.Bilateral(signal="gi"), "gi", instead={"roughness": {"signal": "reflection"}}),
    "Atrous": Case(post.Atrous(signal="gi", iterations=2), "gi", instead={"roughness": {"signal": "reflection"}}),
    "Denoise": Case(  # metals that curve read light of other places: without noise each is a change, and all jumps
        post.Denoise(signal="gi"), "gi", without={"depth": ("metallic",), "motion": ("metallic",)}
    ),
    "ASVGF": Case(post.ASVGF(iterations=2), "diffuse", instead={"roughness": {"signal": "specular"}}),
    "Temporal": Case(post.Temporal(signal="gi"), "gi"),
    "Composite": Case(post.Composite(reflection_intensity=0.8), "radiance"),
    "Fog": Case(post.Fog(), "fog_light"),
    "AerialPerspective": Case(post.AerialPerspective(unit=0.1), "color"),
    "TAA": Case(post.TAA(), "color"),
    "Upscale": Case(post.Upscale(), "color"),
    "FXAA": Case(post.FXAA(), "image"),
    "MotionBlur": Case(post.MotionBlur(samples=6), "color"),
    "DepthOfField": Case(post.DepthOfField(aperture_radius=1.0), "color"),
    "Exposure": Case(post.Exposure(), "color"),
    "ToneMap": Case(post.ToneMap(), "color", absent=("exposure",)),
    "Vignette": Case(post.Vignette(), "image"),
    "DisplayEncode": Case(post.DisplayEncode(), "image"),
    "Pulse": Case(post.Pulse(strength=0.5), "image"),
    "Overlay": Case(post.Overlay(), "image"),
    "EstimateMissing": Case(
        post.EstimateMissing(),
        "radiance",
        absent=MATERIAL,
        without={"light": ("albedo",), "normal": ("thickness",)},
        among_boxes=("normal",),
    ),
}
NUMBERS = {"distance": 3.0, "thickness": 0.4, "focus_distance": 6.0, "roughness_cutoff": 0.5}  # where None or a bend


def table() -> dict[str, dict[str, str]]:
    """Cells of the README's table by row and column."""
    section = README.split("## Gradients")[1].split("\n## ")[0]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in section.splitlines() if line[:1] == "|"]
    return {row[0].replace("`", ""): dict(zip(rows[0][1:], row[1:], strict=True)) for row in rows[2:]}


TABLE = table()
CELLS = [(row, column, cell) for row, cells in TABLE.items() for column, cell in cells.items() if column != "numbers"]
TUNED = [(row, name) for row, cells in TABLE.items() for name in re.findall(r"`(\w+)`", cells["numbers"])]


def setting(case: Case, column: str) -> tuple[Frame, Any]:
    """The second of two frames, and the state after the first."""
    frame = smooth.corner(uneven=case.groups == 3)
    if column in case.among_boxes:
        frame = boxes.frame(boxes.camera((10, 14)), previous=boxes.camera((10, 14), dx=0.05)).to(torch.float64)
    lacks = dict.fromkeys(case.absent + case.without.get(column, ()))
    g = frame.gbuffer.replace(**{k: None for k in lacks if k in CHANNELS})
    frame = frame.replace(gbuffer=g, **{k: None for k in lacks if k not in CHANNELS})
    if isinstance(case.stage, post.MotionBlur):
        frame = frame.replace(gbuffer=g.replace(motion=6 * frame.read("motion")))
    state = None
    if isinstance(case.stage, TemporalPass):
        lit = {name: 0.9 * frame.read(name) for name in ("gi", "color", "radiance", "reflection", "fog_light")}
        state = case.stage(frame.replace(**lit))[1]
    return frame.replace(index=1, time=0.03, previous=frame.as_previous()), state


def run(stage: Stage, frame: Frame, state: Any) -> Tensor:
    """All that a pass writes, one after another."""
    result = stage(frame, state)[0] if isinstance(stage, TemporalPass) else stage(frame)
    written = [result.get(name) for name in sorted(stage.writes)]
    return torch.cat([t.flatten() for t in written if t is not None and t.is_floating_point()])


def agrees(function: Any, at: Tensor, case: Case) -> None:
    by_gradient, wanted = smooth.compare(function, at, step=case.step, groups=case.groups)
    assert float(by_gradient.abs().max()) > 1e-2, "a gradient of zero is none"
    right = (by_gradient - wanted).abs() < case.tolerance
    assert float(right.double().mean()) >= case.agree, f"{by_gradient} instead of {wanted}"


def test_every_pass_has_its_row():
    classes = {type(case.stage).__name__ for case in CASES.values()}
    stages = {n for n in post.__all__ if isinstance(getattr(post, n), type) and issubclass(getattr(post, n), Stage)}
    assert classes == stages
    assert set(TABLE) == set(CASES)


@pytest.mark.parametrize(("row", "column", "cell"), CELLS, ids=lambda v: v)
def test_a_cell_says_what_the_pass_does(row, column, cell):
    case = CASES[row]
    stage = case.stage.tuned(**case.instead.get(column, {}))
    name = case.light if column == "light" else column
    if cell == "-":
        assert name not in stage.reads | stage.optional
        return
    assert name in stage.reads | stage.optional
    frame, state = setting(case, column)

    def function(tensor: Tensor) -> Tensor:
        if name == "normal":
            tensor = torch.nn.functional.normalize(tensor, dim=1)
        channel = {name: tensor}
        changed = (
            frame.replace(gbuffer=frame.gbuffer.replace(**channel))
            if name in CHANNELS
            else frame.write(*channel.popitem())
        )
        return run(stage, changed, state)

    if cell == "yes":
        agrees(function, frame.read(name), case)
        return
    assert cell == "no"
    result = function(leaf := frame.read(name).clone().requires_grad_())
    if result.requires_grad:
        gradient = torch.autograd.grad(result.sum() + result.square().sum(), leaf, allow_unused=True)[0]
        assert gradient is None or float(gradient.abs().max()) == 0


@pytest.mark.parametrize(("row", "name"), TUNED, ids=lambda v: v)
def test_a_number_has_its_gradient(row, name):
    case = CASES[row]
    frame, state = setting(case, f"{name}=")
    value = NUMBERS.get(name, case.stage.tunables()[name])
    agrees(lambda t: run(case.stage.tuned(**{name: t}), frame, state), torch.tensor(value, dtype=torch.float64), case)
