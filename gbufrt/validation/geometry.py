"""Checks of depth, normals and the camera's matrix against each other."""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol

import torch
from torch import Tensor

from gbufrt.camera import Camera
from gbufrt.validation.pixels import WRONG_SHARE, check_unit, count, example, place, share

FACING_TOLERANCE = 1e-2  # shading normals may tip past the silhouette by this much
FAR_TOLERANCE = 1e-4  # of the camera's near and far
SMOOTH = 0.02  # relative second difference of depth up to which there is no edge
FEW = 16  # pixels that tell nothing
PLANAR_TOLERANCE = 1.0  # degrees between normals and those of the depth off edges, in the median
NEARER = 0.5  # of that angle: another reading of the depth that comes so close is the right one
OPENGL = (1.0, -1.0, -1.0, 1.0)  # signs of the axes of a view space that looks along -z with y up


class Geometry(Protocol):
    """The part of `gbufrt.GBuffer` that is checked; not imported, because its module imports this one."""

    @property
    def camera(self) -> Camera: ...
    @property
    def previous_camera(self) -> Camera | None: ...
    @property
    def depth(self) -> Tensor: ...
    @property
    def hit(self) -> Tensor: ...
    @property
    def normal(self) -> Tensor: ...
    @property
    def motion(self) -> Tensor | None: ...
    @property
    def motion_z(self) -> Tensor | None: ...
    @property
    def normal_geo(self) -> Tensor | None: ...
    @property
    def present(self) -> tuple[str, ...]: ...
    def points_view(self) -> Tensor: ...


def check_depth(g: Geometry, prefix: str) -> None:
    """Raise ValueError unless depth lies between the camera's near and far where hit, and is far elsewhere."""
    near, far = g.camera.near, g.camera.far
    wrong = g.hit & (g.depth <= 0)
    if bool(wrong.any()):
        raise ValueError(
            f"{prefix}depth must be positive planar view-space z where hit, but {count(wrong)} not positive, such as "
            f"{example(g.depth, wrong)}; negate it if your view space looks along -z"
        )
    wrong = g.hit & (g.depth < near * (1 - FAR_TOLERANCE))
    if bool(wrong.any()):
        raise ValueError(
            f"{prefix}depth must not be less than the camera's near ({near:g}) where hit, but {count(wrong)} nearer, "
            f"such as {example(g.depth, wrong)}; lower near, because rays end there and surfaces count as hidden"
        )
    wrong = g.hit & (g.depth > far * (1 + FAR_TOLERANCE))
    if bool(wrong.any()):
        raise ValueError(
            f"{prefix}depth must not pass the camera's far ({far:g}) where hit, but {count(wrong)} beyond it, such as "
            f"{example(g.depth, wrong)}; raise far or clear hit there"
        )
    wrong = ~g.hit & ((g.depth - far).abs() > far * FAR_TOLERANCE)
    if bool(wrong.any()):
        raise ValueError(
            f"{prefix}depth must be the camera's far ({far:g}) where hit is False, but {count(wrong)} another, such "
            f"as {example(g.depth, wrong)}; write far there, or set hit where there is a surface"
        )


def check_normal(g: Geometry, name: str, normal: Tensor) -> None:
    """Raise ValueError unless normals have unit length and face the camera; names the likely space or matrix."""
    check_unit(name, normal, g.hit)
    away = _away(g, g.camera, normal)
    if share(away, g.hit) <= WRONG_SHARE:
        return
    guesses = {
        "flip them": (g.camera, -normal),
        "they look like view space: rotate them with camera.rotate_to_world": (
            g.camera,
            g.camera.rotate_to_world(normal),
        ),
        "world_from_view looks like that of OpenGL or Blender, where the camera looks along -z with y up: multiply its "
        "columns by (1, -1, -1, 1)": (_opengl(g.camera), normal),
    }
    fits = {
        text: float(_angles(g, camera, g.depth, guess).mean())
        for text, (camera, guess) in guesses.items()
        if share(_away(g, camera, guess), g.hit) <= WRONG_SHARE
    }
    remedy = "flip them, or rotate them out of view space with camera.rotate_to_world"
    if fits:
        best = min(fits.values())
        remedy = ", or ".join(text for text, angle in fits.items() if angle <= best + PLANAR_TOLERANCE)
    raise ValueError(
        f"{name} must be in world space and face the camera, but {count(away, 'faces', 'face')} away "
        f"({share(away, g.hit):.0%} of those hit), such as at {place(away)}; {remedy}"
    )


def check_planar(g: Geometry, prefix: str) -> None:
    """Raise ValueError where depth agrees with the normals only if it is taken for the length of rays."""
    inside = flat(g)
    if g.camera.orthographic or min(g.camera.size) < 3 or int(inside.sum()) < FEW:
        return
    normal = g.normal if g.normal_geo is None else g.normal_geo
    length = g.camera.unproject(torch.ones_like(g.depth)).norm(dim=1, keepdim=True)
    depths = (g.depth, g.depth / length)
    planar, ray = (float(_angles(g, g.camera, depth, normal, inside).median()) for depth in depths)
    if planar > PLANAR_TOLERANCE and ray < NEARER * planar:
        raise ValueError(
            f"{prefix}depth must be planar view-space z, but looks like the length of rays: its surfaces are "
            f"{planar:.2g} degrees off the normals in the median, and as the length of rays {ray:.2g}; divide it by "
            "camera.unproject(torch.ones_like(depth)).norm(dim=1, keepdim=True)"
        )


def flat(g: Geometry) -> Tensor:
    """``(B, 1, H, W)`` pixels hit, as are those around them, without an edge of depth or of normals between."""
    inside = g.hit.clone()
    for dim in (2, 3):
        bend = g.depth.roll(1, dim) - 2 * g.depth + g.depth.roll(-1, dim)
        inside = inside & (bend.abs() < SMOOTH * g.depth)
        for step in (1, -1):
            same = (g.normal.roll(step, dim) * g.normal).sum(1, keepdim=True) > 0.99
            inside = inside & g.hit.roll(step, dim) & same
    inside[:, :, (0, -1)] = False
    inside[..., (0, -1)] = False
    return inside


def _away(g: Geometry, camera: Camera, normal: Tensor) -> Tensor:
    """The pixels hit whose normal faces away from the camera."""
    to_eye = camera.rotate_to_world(camera.to_eye(g.points_view()))
    return g.hit & ((normal * to_eye).sum(1, keepdim=True) < -FACING_TOLERANCE)


def _angles(g: Geometry, camera: Camera, depth: Tensor, normal: Tensor, where: Tensor | None = None) -> Tensor:
    """Angles between normals and those of the depth, by default at the pixels hit, degrees."""
    if min(camera.size) < 2:
        return depth.new_zeros(1)
    cosine = (camera.normals_from_depth(depth) * normal).sum(1, keepdim=True)[g.hit if where is None else where]
    return cosine.clamp(-1, 1).acos().rad2deg()


def _opengl(camera: Camera) -> Camera:
    signs = camera.world_from_view.new_tensor(OPENGL)
    return replace(camera, world_from_view=camera.world_from_view * signs)
