"""Direct light on a small picture, for tests that compare its forms. Run as a script, it answers in the CUDA form by
numba's simulator and saves what it finds, with the names of the bodies that ran:
``NUMBA_ENABLE_CUDASIM=1 python direct_light.py FILE``."""

from __future__ import annotations

from typing import Any
from unittest.mock import patch

import torch
import voxels
from simulated import save
from torch import Tensor

from gbufrt import Camera
from tracer.direct import drivers
from tracer.direct.lighting import light
from tracer.gbuffers import gbuffer

SIZE = (10, 13)


def answers(device: str | torch.device = "cpu") -> dict[str, Tensor]:
    """Light of sun and lamps where all lamps are candidates; and, in bands, where each tile leaves some out."""
    scene = voxels.polished_scene(1).to(device)
    g = gbuffer(scene, Camera.look_at((14, 16, 19), (0, 2, 0), size=SIZE).to(device), time=0.3)
    given: dict[str, Any] = {"poses": scene.poses([0.3]).to(device), "samples": 8}
    seen = torch.linspace(0.2, 1.0, SIZE[1], device=device).expand_as(g.depth)
    found = {"light": light(scene, g, **given)[0]}
    with patch.object(drivers, "FEW", 0), patch.object(drivers, "BAND", 1):
        found["light of tiles"] = light(scene, g, seen=seen, **given)[0]
    return {name: value.cpu() for name, value in found.items()}


if __name__ == "__main__":
    save(answers)
