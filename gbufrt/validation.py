"""Whether the numbers in a G-buffer mean what the conventions say they mean."""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch
from torch import Tensor

if TYPE_CHECKING:
    from gbufrt.gbuffer import GBuffer

UNIT_TOLERANCE = 1e-2
FACING_TOLERANCE = 1e-2  # shading normals may tip past the silhouette by this much
WRONG_SHARE = 1e-3  # of pixels: isolated ones at silhouettes are no broken convention
MOTION_TOLERANCE = 0.5  # pixels, and
MOTION_RELATIVE = 0.1  # of the expected length


def validate_gbuffer(g: GBuffer) -> None:
    """See `gbufrt.GBuffer.validate`."""
    _check_finite(g)
    _check_depth(g)
    for name in ("normal", "normal_geo"):
        _check_normal(g, name)
    for name in ("albedo", "roughness", "metallic", "opacity", "transmittance"):
        _check_range(g, name)
    if g.motion is not None and g.previous_camera is not None:
        _check_motion(g, g.motion)


def _check_finite(g: GBuffer) -> None:
    for name in g.present:
        tensor = getattr(g, name)
        bad = ~torch.isfinite(tensor) if tensor.is_floating_point() else torch.zeros_like(tensor, dtype=torch.bool)
        if bool(bad.any()):
            where = [int(i) for i in bad.nonzero()[0]]
            remedy = "; write the camera's far and hit = False where nothing was hit" if name == "depth" else ""
            raise ValueError(
                f"{name} must be finite, got {tensor[tuple(where)].item()} at (b, c, y, x) = {tuple(where)}{remedy}"
            )


def _check_depth(g: GBuffer) -> None:
    wrong = g.hit & (g.depth <= 0)
    if bool(wrong.any()):
        raise ValueError(
            f"depth must be positive planar view-space z where hit, got {float(g.depth[wrong].min()):.4g}; "
            "negate it if your view space looks along -z"
        )
    wrong = g.hit & (g.depth > g.camera.far * (1 + 1e-4))
    if bool(wrong.any()):
        raise ValueError(
            f"depth must not pass the camera's far ({g.camera.far:g}) where hit, got {float(g.depth[wrong].max()):.4g}"
            "; raise far or clear hit there"
        )


def _check_normal(g: GBuffer, name: str) -> None:
    normal = getattr(g, name)
    if normal is None or not bool(g.hit.any()):
        return
    length = normal.norm(dim=1, keepdim=True)
    if _share(g.hit & ((length - 1).abs() > UNIT_TOLERANCE), g.hit) > WRONG_SHARE:
        found = float(length[g.hit].median())
        encoded = bool((normal >= 0).all())
        remedy = "; it looks encoded into [0, 1]: use 2 * n - 1" if encoded else "; normalize it over dim 1"
        raise ValueError(f"{name} must have unit length where hit, got a median length of {found:.3g}{remedy}")
    to_eye = g.camera.rotate_to_world(g.camera.to_eye(g.points_view()))
    away = g.hit & ((normal * to_eye).sum(1, keepdim=True) < -FACING_TOLERANCE)
    if _share(away, g.hit) > WRONG_SHARE:
        raise ValueError(
            f"{name} must be in world space and face the camera, but {_share(away, g.hit):.0%} of the pixels face away"
            "; flip them, or rotate them out of view space with camera.rotate_to_world"
        )


def _check_range(g: GBuffer, name: str) -> None:
    tensor = getattr(g, name)
    if tensor is not None and (float(tensor.min()) < 0 or float(tensor.max()) > 1 + 1e-4):
        raise ValueError(f"{name} must lie in [0, 1], got {float(tensor.min()):.4g} to {float(tensor.max()):.4g}")


def _check_motion(g: GBuffer, motion: Tensor) -> None:
    """Most of a picture stands still: compare its motion with what the camera's own movement explains."""
    assert g.previous_camera is not None
    expected, _ = g.camera.static_motion(g.previous_camera, g.depth, g.hit)
    seen = g.depth > g.camera.near
    error = _median_error(motion, expected, seen)
    length = float(expected.norm(dim=1, keepdim=True)[seen].median()) if bool(seen.any()) else 0.0
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
    errors = {text: _median_error(guess, expected, seen) for text, guess in guesses.items()}
    best = min(errors, key=lambda text: errors[text])
    remedy = best if errors[best] <= limit else "check its sign, unit and jitter, and both cameras"
    raise ValueError(
        f"motion must be pixels, previous - current: it differs from the camera's own movement by a median of "
        f"{error:.3g} px; {remedy}"
    )


def _median_error(motion: Tensor, expected: Tensor, seen: Tensor) -> float:
    if not bool(seen.any()):
        return 0.0
    return float((motion - expected).norm(dim=1, keepdim=True)[seen].median())


def _share(part: Tensor, whole: Tensor) -> float:
    return float(part.sum()) / max(float(whole.sum()), 1.0)
