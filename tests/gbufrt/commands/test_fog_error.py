"""The figure of fog: small for the march, and that of light that is missing."""

from __future__ import annotations

import pytest
import torch

import tracer
from gbufrt import Camera
from gbufrt.commands.ablation.fog import fog_error


def test_error_is_small_and_sees_missing_light(monkeypatch: pytest.MonkeyPatch):
    table = tracer.MaterialTable.of([tracer.Material(name="lamp", emission=(8.0, 6.0, 4.0))])
    world = tracer.World.from_dense(torch.ones(1, 1, 1, dtype=torch.int16), table)
    sky = tracer.Sky(picture=torch.full((1, 3, 4, 8), 0.5))
    scene = tracer.Scene(world=world, sky=sky, fog=tracer.Fog(extinction=0.05, albedo=(1.0, 1.0, 1.0)))
    camera = Camera.look_at((-6.0, 3.0, 1.0), (0.0, 1.5, 0.5), size=(8, 12), far=20.0)
    assert fog_error(scene, camera, frames=8, steps=64) < 0.05
    given = tracer.fog_truth
    monkeypatch.setattr(tracer, "fog_truth", lambda *a, **k: {"fog": 2 * given(*a, **k)["fog"]})
    assert fog_error(scene, camera, frames=2, steps=16) > 0.5  # half is missing everywhere
