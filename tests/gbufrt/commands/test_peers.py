"""`gbufrt bench --peers`."""

from __future__ import annotations

import boxes
import pytest
import torch

from gbufrt.commands import peers
from gbufrt.frame import Frame


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
