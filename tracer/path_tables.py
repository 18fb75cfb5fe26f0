"""A scene as the flat arrays that compiled paths read."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from gbufrt.kernel import array
from tracer import sky
from tracer.lamp_table import LampTable
from tracer.light_kernel import DISC, GLOW, TOWARD
from tracer.light_samples import Lights
from tracer.scene import Scene
from tracer.traversal import grid_from_world


def arrays_of(scene: Scene, poses: Tensor, lights: Lights | None = None) -> tuple[np.ndarray, ...]:
    """What `tracer.meet_kernel.Tables` are assembled of: the scene at ``poses``, with its lights where wanted."""
    table = scene.materials
    columns = (table.albedo, table.roughness, table.metallic, table.opacity, table.emission, table.variation)
    return (
        array(grid_from_world(scene, poses, poses.device)[0]),
        *(array(grid) for grid in scene.grids.tensors),
        array(torch.cat([c.reshape(len(table), -1) for c in (*columns, table.tint)], dim=1)),
        np.array([1.0, *(i.scale for i in scene.instances)]),
        _sky(scene),
        *_lamps(None if lights is None else lights.lamps),
    )


def _sky(scene: Scene) -> np.ndarray:
    colors, sun = scene.sky, scene.sun
    rows = np.zeros((GLOW + len(sky.GLOW), 3))
    rows[:3] = colors.zenith, colors.horizon, colors.ground
    if sun is not None:
        toward = np.array(sun.direction, np.float64)
        rows[TOWARD:DISC] = toward / np.linalg.norm(toward), sun.irradiance
        rows[DISC, :2] = np.sin(np.radians(sun.angular_radius)), 1.0
        rows[GLOW:, :2] = np.array(sky.GLOW).reshape(-1, 2)
    return rows


def _lamps(lamps: LampTable | None) -> tuple[np.ndarray, ...]:
    if lamps is None:
        none = torch.zeros(0, 1)
        return array(none), array(none[:, 0]), array(none.int()), array(none.short()), np.zeros(7)
    half = (lamps.edge_u + lamps.edge_v) / 2
    columns = [lamps.corner + half, lamps.facing, half.norm(dim=1, keepdim=True), lamps.power[:, None]]
    columns += [lamps.corner, lamps.edge_u, lamps.edge_v, lamps.area[:, None], lamps.radiance]
    cells = np.array([*lamps.low.tolist(), lamps.cell, *lamps.shape], np.float64)
    tables = torch.cat(columns, dim=1), lamps.power.cumsum(0), lamps.slots, lamps.counts
    return *(array(t) for t in tables), cells
