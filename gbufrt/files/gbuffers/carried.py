"""The camera that an EXR file carries in its header.

``worldToCamera`` and ``worldToNDC`` are OpenEXR's standard attributes, which Arnold, Karma, RenderMan and others write:
rows times matrix, x right, y up, and the whole picture from (0, 0) at its upper left to (1, 1). Some writers look along
-z, and some span -1 to 1; both are told from the matrices. pbrt's go before columns, look along +z in worlds of either
hand, and count from the lower left by the picture's shorter side. Unreal's Movie Render Queue writes position, angles
and field of view as text, under ``unreal/camera``, or under the camera's name where a shot has several. Sources:
OpenEXR's list of standard attributes; pbrt-v4's cameras.cpp and image.cpp; Unreal's FRotationMatrix.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch

from gbufrt.camera import Camera
from gbufrt.files.gbuffers.profile import AUTO, Profile

RIGID = 1e-3  # how far a camera's axes may be from unit length and right angles
ROLL = 1e-3  # how far the camera's right points up, from which on it tells which axis is not up
UNREAL = re.compile(r"unreal/(.*/)?(curPos/[xyz]|curRot/(?:pitch|yaw|roll)|fov)")
POSE = 6  # numbers of position and angles


@dataclass(frozen=True)
class _Found:
    """A camera as a file has it.

    Args:
        pose: 4x4, world from view in the file's world; columns are right, down, and forward or back.
        project: 3x4, view to parts of the picture's width and height from its upper left, homogeneous.
        handed: of the file's world, where the camera tells it.
    """

    pose: np.ndarray
    project: np.ndarray
    handed: str = ""


def carried_camera(header: Mapping[str, Any], profile: Profile, size: tuple[int, int]) -> Camera | None:
    """The camera in a header, for a picture of ``(H, W)``, by the axes of a profile; None where there is none.

    None also stands for one that cannot be: a singular matrix, or a pose that scales.
    """
    try:
        found = _standard(header, size) or _unreal(header, size)
    except (TypeError, ValueError, np.linalg.LinAlgError):
        return None
    if found is None:
        return None
    up = _upright(found.pose) if profile.up == AUTO else profile.up
    axes = _axes(replace(profile, up=up, handed=found.handed or profile.handed))
    turn, project = axes @ found.pose[:3, :3], found.project
    if np.linalg.det(turn) < 0:  # a left-handed view space looks along +z, a right-handed one along -z
        turn, project = turn * (1, 1, -1), project * (1, 1, -1, 1)
    height, width = size
    k = project[:, :3] / project[2, 2] * np.array([[width], [height], [1]])
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = turn, axes @ found.pose[:3, 3] * abs(profile.depth_scale)
    if not (np.isfinite(k).all() and np.isfinite(pose).all() and k[0, 0] > 0 and k[1, 1] > 0):
        return None
    if np.abs(turn.T @ turn - np.eye(3)).max() > RIGID:
        return None
    k[0, 1] = k[1, 0] = k[2, 0] = k[2, 1] = 0.0
    return Camera.from_intrinsics(torch.from_numpy(k).float(), torch.from_numpy(pose).float(), size=size)


def _standard(header: Mapping[str, Any], size: tuple[int, int]) -> _Found | None:
    matrices = [header.get(name) for name in ("worldToCamera", "worldToNDC")]
    if any(matrix is None for matrix in matrices):
        return None
    camera, ndc = (np.asarray(matrix, np.float64).reshape(4, 4).T for matrix in matrices)
    down = np.diag([1.0, -1.0, 1.0, 1.0])
    if camera[3, :3].any():  # where the camera stands, in matrices that go before columns
        camera, project = camera.T, (ndc.T @ np.linalg.inv(camera.T) @ down)[[0, 1, 3]]
        project[1] = project[2] - project[1]
        shares = np.array([[min(size) / size[1]], [min(size) / size[0]]])
        project[:2] = project[2] / 2 + (project[:2] - project[2] / 2) * shares
        return _Found(np.linalg.inv(camera) @ down, project, "left" if np.linalg.det(camera) > 0 else "right")
    project = (ndc @ np.linalg.inv(camera) @ down)[[0, 1, 3]]
    centre = project[:2, 2] / project[2, 2]
    if np.abs(centre).max() < np.abs(centre - 0.5).max():  # -1 to 1, y up
        project = np.array([[0.5, 0, 0.5], [0, -0.5, 0.5], [0, 0, 1]]) @ project
    return _Found(np.linalg.inv(camera) @ down, project)


def _unreal(header: Mapping[str, Any], size: tuple[int, int]) -> _Found | None:
    if not (cameras := _told_by_unreal(header)):
        return None
    name, told = next(iter(cameras.items()))
    if others := [other for other, numbers in cameras.items() if numbers != told]:
        text = f"the file carries the cameras {', '.join((name, *others))}; took {name}, --camera gives another"
        warnings.warn(text, stacklevel=4)
    pitch, yaw, roll = (np.radians(told[f"curRot/{name}"]) for name in ("pitch", "yaw", "roll"))
    (cp, sp), (cy, sy), (cr, sr) = ((np.cos(angle), np.sin(angle)) for angle in (pitch, yaw, roll))
    forward = (cp * cy, cp * sy, sp)
    right = (sr * sp * cy - cr * sy, sr * sp * sy + cr * cy, -sr * cp)
    up = (-(cr * sp * cy + sr * sy), cy * sr - cr * sp * sy, cr * cp)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.negative(up), forward], 1)
    pose[:3, 3] = [told[f"curPos/{axis}"] for axis in "xyz"]
    across = 0.5 / np.tan(np.radians(told["fov"]) / 2)
    project = np.array([[across, 0, 0.5, 0], [0, across * size[1] / size[0], 0.5, 0], [0, 0, 1, 0]])
    return _Found(pose, project)


def _told_by_unreal(header: Mapping[str, Any]) -> dict[str, dict[str, float]]:
    """Position, angles and field of view of all cameras that have them, by their names.

    The player's camera has its field of view one level below its pose, for each pass; others both in one place.
    """
    told: dict[str, dict[str, float]] = {}
    for key in header:
        if match := UNREAL.fullmatch(key):
            told.setdefault(match[1] or "", {})[match[2]] = float(header[key])
    poses = {place: numbers for place, numbers in told.items() if len(numbers.keys() - {"fov"}) == POSE}
    found = {place: numbers for place, numbers in poses.items() if "fov" in numbers}
    if not found:
        below = {p: next((t for q, t in told.items() if q.startswith(p) and "fov" in t), {}) for p in poses}
        found = {place: {**numbers, "fov": below[place]["fov"]} for place, numbers in poses.items() if below[place]}
    return {place.rstrip("/"): numbers for place, numbers in found.items()}


def _upright(pose: np.ndarray) -> str:
    """Which axis of the file's world is up, as cameras seldom roll: y where that cannot be told."""
    roll, lean = np.abs(pose[1:3, 0]), np.abs(pose[1:3, 1])
    return "z" if (roll[1] < roll[0] if roll.max() > ROLL else lean[1] > lean[0]) else "y"


def _axes(profile: Profile) -> np.ndarray:
    """From the file's world to ours, as normals go."""
    mirror = -1.0 if profile.handed == "left" else 1.0
    if profile.up == "z":
        return np.array([[1, 0, 0], [0, 0, 1], [0, -mirror, 0]])
    return np.diag([1.0, 1.0, mirror])
