"""Checks that the values of a G-buffer and of light follow the conventions.

Every message names the channel, how many pixels are wrong, one of them, and a remedy.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import torch
from torch import Tensor

from gbufrt.camera import Camera

UNIT_TOLERANCE = 1e-2
FACING_TOLERANCE = 1e-2  # shading normals may tip past the silhouette by this much
WRONG_SHARE = 1e-3  # of pixels: a few at silhouettes do not break a convention
FAR_TOLERANCE = 1e-4  # of the camera's far
RANGE_TOLERANCE = 1e-4
MOTION_TOLERANCE = 0.5  # pixels, and
MOTION_RELATIVE = 0.1  # of the expected length
UNIT_RANGE = ("albedo", "roughness", "metallic", "opacity", "transmittance")
SHARES = ("ao", "sky_visibility", "reflection_confidence")
LIGHTS = ("radiance", "ambient", "environment", "gi", "reflection", "composite", "color")


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
    def motion(self) -> Tensor | None: ...
    @property
    def present(self) -> tuple[str, ...]: ...
    def points_view(self) -> Tensor: ...


def validate_gbuffer(g: Geometry, prefix: str = "") -> None:
    """See `gbufrt.GBuffer.validate`; ``prefix`` goes before the names of channels in messages."""
    channels: dict[str, Tensor] = {name: getattr(g, name) for name in g.present}
    for name, tensor in channels.items():
        remedy = "; write the camera's far and hit = False where nothing was hit" if name == "depth" else ""
        check_finite(prefix + name, tensor, remedy)
    _check_depth(g, prefix)
    for name in ("normal", "normal_geo"):
        if name in channels:
            _check_normal(g, prefix + name, channels[name])
    for name in UNIT_RANGE:
        if name in channels:
            _check_range(prefix + name, channels[name])
    for name in ("emission", "thickness"):
        if name in channels:
            _check_not_negative(prefix + name, channels[name])
    if g.motion is not None and g.previous_camera is not None:
        _check_motion(g, g.motion, prefix)


def validate_signals(signals: Mapping[str, Tensor], hit: Tensor, prefix: str = "") -> None:
    """See `gbufrt.Frame.validate`.

    Args:
        signals: light and signals by name.
        hit: ``(B, 1, H, W)`` bool.
        prefix: goes before the names in messages.

    Raises:
        ValueError: names the first signal that breaks a rule.
    """
    for name, tensor in signals.items():
        remedy = "; gbufrt.mending.mended mends light" if name in LIGHTS else ""
        check_finite(prefix + name, tensor, remedy)
        if name in LIGHTS:
            _check_not_negative(prefix + name, tensor)
        if name in (*SHARES, "image"):
            _check_range(prefix + name, tensor)
        if name == "bent_normal":
            _check_unit(prefix + name, tensor, hit)


def check_finite(name: str, tensor: Tensor, remedy: str = "") -> None:
    """Raise ValueError that counts the pixels of ``tensor`` that are NaN or infinite, if there are any."""
    if not tensor.is_floating_point() or all_finite(tensor):
        return
    bad = ~torch.isfinite(tensor)
    if bool(bad.any()):
        raise ValueError(f"{name} must be finite, but {_count(bad)} not, such as {_example(tensor, bad)}{remedy}")


def all_finite(tensor: Tensor) -> bool:
    """Whether a float tensor holds neither NaN nor infinity, in one pass; also False where the sum overflows."""
    return bool(torch.isfinite(tensor.detach().sum()))


def _check_depth(g: Geometry, prefix: str) -> None:
    far = g.camera.far
    wrong = g.hit & (g.depth <= 0)
    if bool(wrong.any()):
        raise ValueError(
            f"{prefix}depth must be positive planar view-space z where hit, but {_count(wrong)} not positive, such as "
            f"{_example(g.depth, wrong)}; negate it if your view space looks along -z"
        )
    wrong = g.hit & (g.depth > far * (1 + FAR_TOLERANCE))
    if bool(wrong.any()):
        raise ValueError(
            f"{prefix}depth must not pass the camera's far ({far:g}) where hit, but {_count(wrong)} beyond it, such as "
            f"{_example(g.depth, wrong)}; raise far or clear hit there"
        )
    wrong = ~g.hit & ((g.depth - far).abs() > far * FAR_TOLERANCE)
    if bool(wrong.any()):
        raise ValueError(
            f"{prefix}depth must be the camera's far ({far:g}) where hit is False, but {_count(wrong)} another, such "
            f"as {_example(g.depth, wrong)}; write far there, or set hit where there is a surface"
        )


def _check_normal(g: Geometry, name: str, normal: Tensor) -> None:
    _check_unit(name, normal, g.hit)
    to_eye = g.camera.rotate_to_world(g.camera.to_eye(g.points_view()))
    away = g.hit & ((normal * to_eye).sum(1, keepdim=True) < -FACING_TOLERANCE)
    if _share(away, g.hit) > WRONG_SHARE:
        raise ValueError(
            f"{name} must be in world space and face the camera, but {_count(away, 'faces', 'face')} away "
            f"({_share(away, g.hit):.0%} of those hit), such as at {_place(away)}"
            "; flip them, or rotate them out of view space with camera.rotate_to_world"
        )


def _check_unit(name: str, vector: Tensor, hit: Tensor) -> None:
    length = vector.norm(dim=1, keepdim=True)
    wrong = hit & ((length - 1).abs() > UNIT_TOLERANCE)
    if _share(wrong, hit) <= WRONG_SHARE:
        return
    encoded = bool((vector >= 0).all())
    remedy = "; it looks encoded into [0, 1]: use 2 * n - 1" if encoded else "; normalize it over dim 1"
    raise ValueError(
        f"{name} must have unit length where hit, but {_count(wrong)} of another length, such as "
        f"{_example(length, wrong)}{remedy}"
    )


def _check_range(name: str, tensor: Tensor) -> None:
    wrong = (tensor < 0) | (tensor > 1 + RANGE_TOLERANCE)
    if bool(wrong.any()):
        raise ValueError(
            f"{name} must lie in [0, 1], but {_count(wrong)} outside ({float(tensor.min()):.4g} to "
            f"{float(tensor.max()):.4g}), such as {_example(tensor, wrong)}; scale or clamp it"
        )


def _check_not_negative(name: str, tensor: Tensor) -> None:
    wrong = tensor < 0
    if bool(wrong.any()):
        raise ValueError(
            f"{name} must not be negative, but {_count(wrong)} so (down to {float(tensor.min()):.4g}), such as "
            f"{_example(tensor, wrong)}; clamp it at 0"
        )


def _check_motion(g: Geometry, motion: Tensor, prefix: str) -> None:
    """Most of a picture is static: compare its motion with the motion that the camera's own movement causes."""
    assert g.previous_camera is not None
    expected, _ = g.camera.static_motion(g.previous_camera, g.depth, g.hit)
    visible = g.depth > g.camera.near
    error = _median_error(motion, expected, visible)
    length = float(expected.norm(dim=1, keepdim=True)[visible].median()) if bool(visible.any()) else 0.0
    limit = max(MOTION_TOLERANCE, MOTION_RELATIVE * length)
    if error <= limit:
        return
    size = motion.new_tensor([g.camera.width, g.camera.height])[None, :, None, None]
    flip_y = motion.new_tensor([1.0, -1.0])[None, :, None, None]
    guesses = {
        "it looks negated: motion is previous - current": -motion,
        "its y looks flipped: px counts down": motion * flip_y,
        "it looks negated in x: motion is previous - current": -motion * flip_y,
        "it looks like UV units: multiply by (W, H)": motion * size,
        "it looks like negated UV units: multiply by (-W, -H)": -motion * size,
        "it looks like NDC units: multiply by (W/2, -H/2)": motion * size * flip_y / 2,
        "it looks like negated NDC units: multiply by (-W/2, H/2)": -motion * size * flip_y / 2,
    }
    errors = {text: _median_error(guess, expected, visible) for text, guess in guesses.items()}
    best = min(errors, key=lambda text: errors[text])
    remedy = best if errors[best] <= limit else "check its sign, unit and jitter, and both cameras"
    wrong = visible & ((motion - expected).norm(dim=1, keepdim=True) > limit)
    raise ValueError(
        f"{prefix}motion must be pixels, previous - current: it differs from the camera's own movement by a median of "
        f"{error:.3g} px, and {_count(wrong)} off by more than {limit:.3g} px, such as at {_place(wrong)}; {remedy}"
    )


def _median_error(motion: Tensor, expected: Tensor, visible: Tensor) -> float:
    if not bool(visible.any()):
        return 0.0
    return float((motion - expected).norm(dim=1, keepdim=True)[visible].median())


def _share(part: Tensor, whole: Tensor) -> float:
    return float(part.sum()) / max(float(whole.sum()), 1.0)


def pixels(wrong: Tensor) -> int:
    """How many pixels ``wrong`` ``(B, C, H, W)`` bool marks, in any of their components."""
    return int(wrong.any(dim=1).sum())


def _count(wrong: Tensor, one: str = "is", many: str = "are") -> str:
    number = pixels(wrong)
    return f"1 pixel {one}" if number == 1 else f"{number} pixels {many}"


def _place(wrong: Tensor) -> str:
    return f"(b, c, y, x) = {tuple(_first(wrong))}"


def _example(tensor: Tensor, wrong: Tensor) -> str:
    place: Any = tuple(_first(wrong))
    return f"{tensor[place].item():.4g} at {_place(wrong)}"


def _first(wrong: Tensor) -> list[int]:
    """Indices of the first True."""
    return [int(i) for i in wrong.nonzero()[0]]
