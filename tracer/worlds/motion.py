"""How the models of the built-in world move: rigid poses as smooth functions of time."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from tracer.scene.scene import Instance
from tracer.worlds import movers
from tracer.worlds.land import VILLAGE, WATER
from tracer.worlds.outskirts import HUB
from tracer.worlds.village import PLAZA

TAU = 2.0 * math.pi


def translation(x: float, y: float, z: float) -> Tensor:
    """``(4, 4)`` that moves by a vector."""
    m = torch.eye(4, dtype=torch.float64)
    m[:3, 3] = torch.tensor((x, y, z), dtype=torch.float64)
    return m


def rotation(axis: str, angle: float) -> Tensor:
    """``(4, 4)`` right-handed turn about an axis, in radians."""
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    m = torch.eye(4, dtype=torch.float64)
    m[i, i] = m[j, j] = math.cos(angle)
    m[i, j], m[j, i] = -math.sin(angle), math.sin(angle)
    return m


def sails_pose(time: float) -> Tensor:
    """The mill's sails turn once in nine seconds, facing away from the tower."""
    facing = rotation("y", math.atan2(HUB_AXIS[0], HUB_AXIS[1]))
    pivot = translation(-0.25, -0.25, -0.25)
    return translation(*HUB) @ facing @ rotation("z", TAU * time / 9.0 + 0.5) @ pivot


HUB_AXIS = (0.647, 0.762)
"""Which way the sails face, x and z."""


def boat_pose(time: float) -> Tensor:
    """The boat rounds the lake in a minute, rolling a little."""
    angle = TAU * time / 60.0 + 0.2
    x, z = 100.0 + 25.0 * math.cos(angle), 153.0 + 15.0 * math.sin(angle)
    heading = math.atan2(-15.0 * math.cos(angle), -25.0 * math.sin(angle))
    rise = 0.10 * math.sin(TAU * time / 3.1)
    roll = rotation("x", 0.035 * math.sin(TAU * time / 4.3)) @ rotation("z", 0.02 * math.sin(TAU * time / 3.7))
    return translation(x, WATER + rise, z) @ rotation("y", heading) @ roll


def cart_pose(time: float) -> Tensor:
    """The cart rolls out of the mine and back in eighteen seconds."""
    return translation(151.0, VILLAGE, 64.0 + 34.0 * math.cos(TAU * (time / 18.0 + 0.08)))


def walk(time: float) -> tuple[Tensor, float]:
    """The walker's hips on a round of the fountain, and the phase of the stride."""
    pace, radius = 3.0, 10.0
    angle = pace * time / radius - 0.6
    x, z = PLAZA[0] + 0.5 + radius * math.cos(angle), PLAZA[1] + 0.5 + radius * math.sin(angle)
    stride = TAU * time / 1.1
    bob = 0.05 * math.cos(2.0 * stride)
    return translation(x, VILLAGE + 1.30 + bob, z) @ rotation("y", -angle), stride


def limb_pose(time: float, *, at: tuple[float, float, float], phase: float) -> Tensor:
    """A limb that swings about its joint ``at``, relative to the hips."""
    hips, stride = walk(time)
    return hips @ translation(*at) @ rotation("x", 0.55 * math.sin(stride + phase))


def lantern_pose(time: float, *, at: tuple[float, float, float], phase: float) -> Tensor:
    """A lantern that drifts round ``at``, swaying."""
    x, y, z = at
    drift = translation(
        x + 1.2 * math.sin(TAU * time / 11.0 + phase),
        y + 0.6 * math.sin(TAU * time / 5.0 + 1.7 * phase),
        z + 1.2 * math.cos(TAU * time / 13.0 + phase),
    )
    sway = rotation("z", 0.12 * math.sin(TAU * time / 2.9 + phase))
    return drift @ rotation("y", 0.4 * time + phase) @ sway @ translation(-0.5, -0.5, -0.5)


LANTERNS = ((176.5, VILLAGE + 8.0, 116.0), (195.0, VILLAGE + 10.0, 114.0), (170.6, VILLAGE + 3.2, 123.2))


def instances() -> tuple[Instance, ...]:
    """Everything that moves over the valley."""
    leg, arm, lamp = movers.walker_leg(), movers.walker_arm(), movers.lantern()
    limbs = (
        ("left leg", leg, (0.25, 0.0, 0.0), 0.0),
        ("right leg", leg, (-0.25, 0.0, 0.0), math.pi),
        ("left arm", arm, (0.50, 1.25, 0.0), math.pi),
        ("right arm", arm, (-0.75, 1.25, 0.0), 0.0),
    )
    return (
        Instance(model=movers.sails(), pose=sails_pose, scale=0.5, name="mill sails"),
        Instance(model=movers.boat(), pose=boat_pose, scale=0.25, name="boat"),
        Instance(model=movers.mine_cart(), pose=cart_pose, scale=0.25, name="mine cart"),
        Instance(model=movers.walker_body(), pose=lambda t: walk(t)[0], scale=0.25, name="walker"),
        *(
            Instance(model=m, pose=lambda t, a=at, p=ph: limb_pose(t, at=a, phase=p), scale=0.25, name=f"walker {n}")
            for n, m, at, ph in limbs
        ),
        *(
            Instance(
                model=lamp,
                pose=lambda t, a=at, p=2.1 * i: lantern_pose(t, at=a, phase=p),
                scale=0.25,
                name=f"lantern {i + 1}",
            )
            for i, at in enumerate(LANTERNS)
        ),
    )
