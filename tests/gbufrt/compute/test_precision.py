"""Passes compute in the precision of their frame, whatever the program around them has set."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
import torch

import tracer
from gbufrt import Frame, Pipeline
from gbufrt.specimen import specimen
from post import Denoise, me1

PIPELINES = {"me1": lambda: me1("high"), "denoise": lambda: Pipeline(denoise=Denoise(signal="radiance"))}
SIGNALS = ("reflection", "gi", "image", "radiance")


@pytest.fixture
def frame() -> Iterator[Frame]:
    """One of single precision where another is the default."""
    before, made = torch.get_default_dtype(), specimen()
    torch.set_default_dtype(torch.float64)
    yield made
    torch.set_default_dtype(before)


def second(pipeline: Pipeline, frame: Frame) -> Frame:
    """The second of two frames."""
    _, state = pipeline(frame)
    return pipeline(frame.replace(index=1), state)[0]


@pytest.mark.parametrize("name", PIPELINES)
@torch.no_grad()
def test_autocast_changes_nothing(name: str):
    frame = specimen()
    true = second(PIPELINES[name](), frame)
    with torch.autocast("cpu", dtype=torch.bfloat16):
        found = second(PIPELINES[name](), frame)
    for signal in SIGNALS:
        if true.get(signal) is not None:
            assert torch.equal(found.read(signal), true.read(signal)), signal


@pytest.mark.parametrize("name", PIPELINES)
@torch.no_grad()
def test_frames_keep_their_kind_under_another_default(name: str, frame: Frame):
    found = second(PIPELINES[name](), frame)
    assert [signal for signal in found.present if found.read(signal).dtype == torch.float64] == []


@pytest.mark.parametrize("name", PIPELINES)
def test_torch_definitions_do_too(name: str, frame: Frame):
    radiance = frame.read("radiance").clone().requires_grad_()
    found = second(PIPELINES[name](), frame.replace(radiance=radiance))
    assert [signal for signal in found.present if found.read(signal).dtype == torch.float64] == []


def test_frames_are_traced_in_single_precision_under_another_default(frame: Frame):
    scene = tracer.load("valley")
    found = tracer.render(scene, scene.views["village"].camera(0.0, size=(9, 16)))
    assert [signal for signal in found.present if found.read(signal).dtype == torch.float64] == []
