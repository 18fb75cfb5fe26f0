"""A floor and a wall before a camera that moves, written as another renderer writes them."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import OpenEXR
import torch

from gbufrt.camera import Camera

SIZE = (48, 64)
NEAR, FAR = 0.1, 200.0
CAMERA = Camera.look_at((0.3, 2, 4), (0, 1.2, 0), size=SIZE, fov_y=50)
BEFORE = Camera.look_at((0.0, 1.8, 4.1), (-0.2, 1.1, 0), size=SIZE, fov_y=50)


def truth() -> dict[str, np.ndarray]:
    """Planar and ray depth, world normals and motion in px, of y = 0 and of x = 2 below 3 units; inf is sky."""
    origins, directions = (t[0].double() for t in CAMERA.rays())
    floor = -origins[..., 1] / directions[..., 1]
    wall = (2 - origins[..., 0]) / directions[..., 0]
    floor[(floor <= 0) | (floor > 30)] = torch.inf
    wall[(wall <= 0) | (origins[..., 1] + wall * directions[..., 1] > 3)] = torch.inf
    ray = torch.minimum(floor, wall)
    hit = torch.isfinite(ray)
    normal = (
        torch.where((floor < wall)[..., None], torch.tensor([0.0, 1, 0]), torch.tensor([-1.0, 0, 0])) * hit[..., None]
    )
    planar = ray * (directions @ CAMERA.forward[0].double())
    depth = torch.where(hit, planar, 1.0).float()[None, None]
    motion, _ = CAMERA.static_motion(BEFORE, depth, hit[None, None])
    return {
        "planar": planar.numpy(),
        "ray": ray.numpy(),
        "hit": hit.numpy(),
        "normal": normal.numpy(),
        "motion": motion[0].permute(1, 2, 0).numpy(),
    }


def write(path: Path, layers: Mapping[str, np.ndarray], header: Mapping[str, str] | None = None) -> Path:
    """Layers by name with the letters of their channels, such as ``Normal.XYZ``; depth as ``Depth.Z``."""
    planes = {}
    for name, pixels in layers.items():
        base, _, letters = name.rpartition(".")
        stack = pixels[..., None] if pixels.ndim == 2 else pixels
        for i, letter in enumerate(letters):
            full = f"{base}.{letter}" if base else letter
            planes[full] = np.ascontiguousarray(stack[..., i], np.float32)
    kind = {"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION, **(header or {})}
    OpenEXR.File(kind, planes).write(str(path))
    return path


def write_parts(path: Path, parts: Mapping[str, Mapping[str, np.ndarray]], views: Sequence[str] = ()) -> Path:
    """Parts by name, each of channels by name; those whose names end in one of the views are of it."""
    kind = {"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION}
    made = [
        OpenEXR.Part(
            kind | ({"view": re.split("[_.]", name)[-1]} if name.endswith((*views,)) else {}),
            {n: np.ascontiguousarray(p, np.float32) for n, p in channels.items()},
            name,
        )
        for name, channels in parts.items()
    ]
    OpenEXR.File(made).write(str(path))
    return path
