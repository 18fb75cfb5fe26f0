"""The ray-traced Cornell box, where ``GBUFRT_TEST_DATA`` names a folder that holds it."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor

from gbufrt import Camera, Frame, GBuffer

FAR = 100.0


def cornell(step: int = 3) -> tuple[Frame, dict[str, Tensor]]:
    """Frame 1 and its truth (``ao_gt``..., and ``ok``: pixels to judge), every ``step``-th pixel both ways."""
    root = os.environ.get("GBUFRT_TEST_DATA")
    folder = Path(root or ".") / "truth"
    if root is None or not (folder / "cornell_f1.npz").exists():
        pytest.skip("set GBUFRT_TEST_DATA to a folder with truth/cornell_f1.npz")
    stored, truth = np.load(folder / "cornell_f1.npz"), np.load(folder / "cornell_gt.npz")
    depth = _picture(stored["depth"], step)
    hit = torch.isfinite(depth)
    k = torch.from_numpy(stored["K"]).float()
    k[:2] = k[:2] / step
    k[:2, 2] += 0.5 - 0.5 / step  # the first pixel is kept
    camera = Camera.from_intrinsics(
        k, torch.from_numpy(stored["cam_to_world"]).float(), size=(depth.shape[2], depth.shape[3]), far=FAR
    )
    fields: dict[str, Any] = {name: _picture(stored[name], step) for name in ("albedo", "metallic", "emission")}
    gbuffer = GBuffer(
        camera=camera,
        depth=torch.where(hit, depth, FAR),
        hit=hit,
        normal=torch.where(hit, _picture(stored["normal_world"], step), 0.0),
        **fields,
    )
    names = ("ao_gt", "ao_inf_gt", "bent_gt", "indirect_diffuse_1_onscreen_gt")
    answers = {name: _picture(truth[name], step) for name in names}
    answers["ok"] = (_picture(truth["gt_ok"], step) > 0) & hit
    answers["object"] = _picture(stored["object_id"], step)
    return Frame(gbuffer=gbuffer, radiance=_picture(stored["radiance"], step)), answers


def _picture(array: np.ndarray, step: int) -> Tensor:
    kept = torch.from_numpy(np.ascontiguousarray(array[::step, ::step].astype(np.float32)))
    return kept[None, None] if kept.ndim == 2 else kept.permute(2, 0, 1)[None].contiguous()
