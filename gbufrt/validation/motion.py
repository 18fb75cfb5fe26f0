"""Checks of motion: against the camera's own movement, and against the frame before."""

from __future__ import annotations

from torch import Tensor

from gbufrt.camera import Camera
from gbufrt.sampling import gather
from gbufrt.validation.geometry import Geometry
from gbufrt.validation.pixels import count, place, share

MOTION_TOLERANCE = 0.5  # pixels, and
MOTION_RELATIVE = 0.1  # of the expected length
SAME_DEPTH = 0.03  # relative difference of depth, and
SAME_NORMAL = 0.9  # cosine between normals, up to which two pixels show one surface
SAME_PLACE = 1e-3  # radians, and of the distance from the origin: cameras closer than this are one
BETTER = 0.1  # share of the pixels by which another sign must fit better to be told


def check_motion(g: Geometry, motion: Tensor, prefix: str) -> None:
    """Raise ValueError unless the motion of most pixels is that of a static world before the moving camera."""
    assert g.previous_camera is not None
    expected, _ = g.camera.static_motion(g.previous_camera, g.depth, g.hit)
    visible = g.depth > g.camera.near
    error = _median_error(motion, expected, visible)
    length = float(expected.norm(dim=1, keepdim=True)[visible].median()) if bool(visible.any()) else 0.0
    limit = max(MOTION_TOLERANCE, MOTION_RELATIVE * length)
    if error <= limit:
        return
    errors = {text: _median_error(guess, expected, visible) for text, guess in _readings(motion).items()}
    best = min(errors, key=lambda text: errors[text])
    remedy = best if errors[best] <= limit else "check its sign, unit and jitter, and both cameras"
    wrong = visible & ((motion - expected).norm(dim=1, keepdim=True) > limit)
    raise ValueError(
        f"{prefix}motion must be pixels, previous - current: it differs from the camera's own movement by a median of "
        f"{error:.3g} px, and {count(wrong)} off by more than {limit:.3g} px, such as at {place(wrong)}; {remedy}"
    )


def check_previous(previous: Camera, before: Camera, prefix: str) -> None:
    """Raise ValueError unless the camera that motion leads to is that of the frame before."""
    apart = float((previous.position - before.position).norm(dim=1).max())
    turned = float((previous.forward - before.forward).norm(dim=1).max())
    if apart > SAME_PLACE * (1 + float(before.position.norm(dim=1).max())) or turned > SAME_PLACE:
        raise ValueError(
            f"{prefix}previous_camera must be the camera of the frame before, but is {apart:.3g} world units from it "
            f"and turned by {turned:.3g} radians: motion leads to where it stands; tracer.render takes previous_camera="
        )


def check_movers(g: Geometry, motion: Tensor, before: Geometry, prefix: str) -> None:
    """Raise ValueError where another sign or unit of motion leads from what moves by itself to the same surface.

    Under a camera that stands still this alone tells the sign.
    """
    expected, _ = g.camera.static_motion(before.camera, g.depth, g.hit)
    moves = g.hit & ((motion - expected).norm(dim=1, keepdim=True) > MOTION_TOLERANCE)
    fit = found_again(g, motion, before, moves)
    fits = {text: found_again(g, reading, before, moves) for text, reading in _readings(motion).items()}
    best = max(fits, key=lambda text: fits[text])
    if fits[best] > fit + BETTER:
        raise ValueError(
            f"{prefix}motion must lead to the same surface in the frame before; it does for {fit:.0%} of the pixels "
            f"that move by themselves, such as at {place(moves)}, and would for {fits[best]:.0%}: {best}"
        )


def found_again(g: Geometry, motion: Tensor, before: Geometry, moves: Tensor) -> float:
    """The share of the pixels that move where the frame before shows the same surface at px + motion."""
    px = (g.camera.pixel_centers(dtype=motion.dtype) + motion).floor()
    inside = (px >= 0).all(1, keepdim=True) & (px[:, :1] < g.camera.width) & (px[:, 1:] < g.camera.height)
    depth, normal, hit = (gather(t, px[:, 0], px[:, 1]) for t in (before.depth, before.normal, before.hit))
    shift = 0.0 if g.motion_z is None else g.motion_z
    near = (depth - g.depth - shift).abs() <= SAME_DEPTH * g.depth
    same = inside & hit & near & ((normal * g.normal).sum(1, keepdim=True) >= SAME_NORMAL)
    return share(same & moves, moves)


def _readings(motion: Tensor) -> dict[str, Tensor]:
    """Motion as other conventions would mean it, by what a message says of them."""
    height, width = motion.shape[-2:]
    size = motion.new_tensor([width, height])[None, :, None, None]
    flip_y = motion.new_tensor([1.0, -1.0])[None, :, None, None]
    return {
        "it looks negated: motion is previous - current": -motion,
        "its y looks flipped: px counts down": motion * flip_y,
        "it looks negated in x: motion is previous - current": -motion * flip_y,
        "it looks like UV units: multiply by (W, H)": motion * size,
        "it looks like negated UV units: multiply by (-W, -H)": -motion * size,
        "it looks like NDC units: multiply by (W/2, -H/2)": motion * size * flip_y / 2,
        "it looks like negated NDC units: multiply by (-W/2, H/2)": -motion * size * flip_y / 2,
    }


def _median_error(motion: Tensor, expected: Tensor, visible: Tensor) -> float:
    if not bool(visible.any()):
        return 0.0
    return float((motion - expected).norm(dim=1, keepdim=True)[visible].median())
