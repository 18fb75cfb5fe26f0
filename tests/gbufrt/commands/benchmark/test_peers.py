"""`gbufrt bench --peers`."""

from __future__ import annotations

from pathlib import Path

import boxes
import pytest
import torch

from gbufrt.commands.benchmark import peers
from gbufrt.files.exr import write_exr
from gbufrt.frame import Frame
from tracer.worlds import terrain


def noisy_and_clean() -> tuple[Frame, torch.Tensor]:
    frame = boxes.frame(boxes.camera((48, 64)))
    clean = torch.where(frame.gbuffer.hit, 0.6, 1.0)
    noise = torch.rand(clean.shape, generator=torch.Generator().manual_seed(0)) < clean
    return frame.replace(ao=noise.float()), clean


def test_filters_are_compared(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(peers, "occlusion", lambda size: noisy_and_clean())
    rows = {row["name"]: row for row in peers.compare_peers((48, 64), 1)}
    assert {"nothing", "post.bilateral, 9x9", "post.atrous, 5 iterations", "kornia joint bilateral, 9x9"} <= {*rows}
    before = rows.pop("nothing")
    assert all(row["ms"] > 0 for row in rows.values())
    assert all(row["psnr"] > before["psnr"] + 1 for row in rows.values()), "each filter denoises"
    assert all(row["psnr"] > before["psnr"] + 10 for name, row in rows.items() if name.startswith("post."))


def test_the_picture_that_they_denoise(monkeypatch: pytest.MonkeyPatch) -> None:
    noisy, clean = peers.occlusion((24, 32))
    assert noisy.read("ao").shape == clean.shape == (1, 1, 24, 32)
    assert set(noisy.read("ao").unique().tolist()) <= {0.0, 1.0}, "one ray is blocked or not"
    assert 0.3 < float(clean.mean()) < 1.0
    assert abs(float(noisy.read("ao").mean() - clean.mean())) < 0.1


def test_filters_are_timed_at_another_size(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tracer.worlds.builtin", lambda: terrain((32, 16, 32)))
    monkeypatch.setattr(peers, "HD", (24, 32))
    monkeypatch.setattr(peers, "filters", lambda frame: {"one": lambda: asked.append(frame) or frame.read("ao")})
    asked: list[Frame] = []
    assert peers.time_filters(2)["one"] > 0
    assert len(asked) == 3
    assert asked[0].gbuffer.camera.size == (24, 32)
    assert set(asked[0].read("ao").unique().tolist()) == {0.0, 1.0}


def test_oidn_denoises_the_light_of_a_frame(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    frame = boxes.frame(boxes.camera((16, 24)))
    write_exr(tmp_path / "frame.exr", frame)
    given: list[torch.Tensor] = []
    monkeypatch.setattr(peers, "oidn", lambda light, albedo, normal: given.extend((light, albedo, normal)))
    monkeypatch.setattr(peers, "has_oidn", lambda: False)
    assert peers.time_oidn(tmp_path / "frame.exr", 1) is None
    monkeypatch.setattr(peers, "has_oidn", lambda: True)
    ms = peers.time_oidn(tmp_path / "frame.exr", 1)
    assert ms is not None
    assert ms >= 0
    g = frame.gbuffer
    wanted = (frame.read("radiance"), torch.where(g.hit, frame.read("albedo"), 0.0), g.normal)
    assert all(torch.allclose(a, b, atol=1e-3) for a, b in zip(given[:3], wanted, strict=True))
