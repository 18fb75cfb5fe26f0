"""Whether a frame's channels agree with each other, and which setting of a profile would make them."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations, product

import torch
from torch import Tensor

from gbufrt.camera import Camera
from gbufrt.directions import length
from gbufrt.files.gbuffers.convert import their_axes
from gbufrt.files.gbuffers.flatness import BEND, NEARER, bend_of, normalised_line
from gbufrt.files.gbuffers.light import ended_line
from gbufrt.files.gbuffers.motion import depth_factor
from gbufrt.files.gbuffers.profile import Profile
from gbufrt.frame import Frame
from gbufrt.gbuffer import GBuffer
from gbufrt.validation.geometry import FEW, flat
from gbufrt.validation.motion import found_again

CLOSE = 5.0  # degrees between a normal and that of the depth, up to which they agree
TILT = 8.0  # degrees between the mean normal of a block and that of the depth, up to which they agree
BLOCKS = 6  # along the shorter side of the picture
AGREE = 0.5  # share of the flat pixels whose normals must be those of the depth
BETTER = 0.1  # share of the pixels by which another reading must fit better to be told
MENDED, BROKEN = 0.01, 0.1  # least share of the pixels that other axes mend, and most of those that they break for it
MOVES = 0.5  # pixels of motion apart from the cameras' own
RECIPROCAL = '"reciprocal" or "device"'
PLAIN = Profile(channels={})
PANORAMA = "; panoramas and fisheyes, which are not read, look so too"
CAMERA = "check the camera: another pose or lens, a picture cropped to a border and a panorama look so"


def disagreements(
    frame: Frame, before: Frame | None = None, depth_kind: str = "", *, profile: Profile = PLAIN, posed: bool = True
) -> list[str]:
    """What of a frame by `gbufrt.files.read_gbuffer` disagrees; each line names the profile's setting to change.

    Args:
        frame: its motion is tested against the cameras where it has the one before.
        before: the frame before, against which the motion of what moves by itself is tested.
        depth_kind: how the profile read depth, if not as ``profile`` says.
        profile: by which the file was read.
        posed: whether the cameras' poses are known. One that is only taken to stand still tells nothing of motion: a
            camera that moved would make a mover of everything.
    """
    g = frame.gbuffer
    profile = replace(profile, depth_kind=depth_kind or profile.depth_kind)
    readings = depth_readings(g, profile.depth_kind).values()
    lines = [normalised_line(g, profile.depth_kind, readings)] if min(g.camera.size) > 2 else []
    if lines == [""]:
        bent = _depth_line(g, profile.depth_kind)
        lines = [f"{bent}{PANORAMA * bool(bent and not posed)}", _normal_line(g, profile)]
    if g.motion is not None and posed:
        if g.previous_camera is not None:
            lines.append(_static_line(g, g.motion, g.previous_camera))
        if before is not None:
            lines.append(_mover_line(g, g.motion, before.gbuffer))
    return [line for line in dict.fromkeys([*lines, ended_line(frame)]) if line]


def depth_readings(g: GBuffer, kind: str = "planar") -> dict[str, Tensor]:
    """Planar depth if the file's kind of depth were another than ``kind``, by that kind."""
    ray = 1.0 if g.camera.orthographic else length(g.camera.unproject(torch.ones_like(g.depth)))
    if kind in ("reciprocal", "device"):
        return {'"planar"': 1 / g.depth, '"ray"': 1 / g.depth / ray}
    stored = g.depth * ray if kind == "ray" else g.depth
    readings = {'"ray"': stored / ray, '"planar"': stored, RECIPROCAL: 1 / stored}
    return {name: depth for name, depth in readings.items() if name != f'"{kind}"'}


def normal_readings(g: GBuffer) -> dict[str, Tensor]:
    """World normals if a setting were another, by that setting."""
    x, y, z = g.normal.unbind(1)
    total = g.normal.sum(1, keepdim=True)  # the length that makes 2 n - 1 a unit vector, lost when n was normalized
    size = (total + (total * total - 2).clamp_min(0).sqrt()) / 2
    view, turned = g.camera.rotate_to_view(g.normal), g.camera.rotate_to_world
    return {
        'up = "z"': torch.stack([x, z, -y], 1),
        'up = "y"': torch.stack([x, -z, y], 1),
        'the other of handed = "left" and "right"': torch.stack([x, y, -z], 1),
        "normal_scale with all signs changed": -g.normal,
        'normal_space = "opencv"': turned(g.normal),
        'normal_space = "opengl"': turned(torch.stack([x, -y, -z], 1)),
        'normal_space = "pbrt"': turned(torch.stack([x, -y, z], 1)),
        'normal_space = "world"': view,
        "normal_encoded = true": torch.nn.functional.normalize(2 * size * g.normal - 1, dim=1),
    }


def motion_readings(motion: Tensor) -> dict[str, Tensor]:
    """Motion if a setting were another, by that setting."""
    height, width = motion.shape[-2:]
    signs = {
        "": (1, 1),
        "motion_scale with both signs changed (or the other motion_target)": (-1, -1),
        "motion_scale with the sign of y changed": (1, -1),
        "motion_scale with the sign of x changed": (-1, 1),
    }
    units = {"": (1, 1), 'motion_unit = "uv"': (width, height), 'motion_unit = "pixels"': (1 / width, 1 / height)}
    return {
        " and ".join(filter(None, (unit, sign))): motion * motion.new_tensor([sx * ux, sy * uy]).view(1, 2, 1, 1)
        for unit, (ux, uy) in units.items()
        for sign, (sx, sy) in signs.items()
        if unit or sign
    }


def _depth_line(g: GBuffer, kind: str) -> str:
    """By planarity: on a plane 1 / z is linear over the picture, and so are no lengths of rays."""
    inside = flat(g)
    if int(inside.sum()) < FEW:
        return ""
    now = _agreeing(g, g.camera, g.depth, g.normal, inside)
    bend = bend_of(g.depth, inside, orthographic=g.camera.orthographic)
    readings = depth_readings(g, kind)
    bends = {text: bend_of(depth, inside, orthographic=g.camera.orthographic) for text, depth in readings.items()}
    best = min(bends, key=lambda text: bends[text])
    if bend <= BEND or bends[best] >= NEARER * bend:
        return ""
    told, fits = f"depth_kind = {best} fits better", _agreeing(g, g.camera, readings[best], g.normal, inside)
    if fits > now + BETTER:
        return f"{told}: normals agree with depth at {fits:.0%} of the pixels instead of {now:.0%}"
    return f"{told}: planes bend by {bends[best]:.2g} a step instead of {bend:.2g}"


def _normal_line(g: GBuffer, profile: Profile) -> str:
    inside = flat(g)
    if int(inside.sum()) < FEW:
        return ""
    now = _agreeing(g, g.camera, g.depth, g.normal, inside)
    fits = {text: _agreeing(g, g.camera, g.depth, normal, inside) for text, normal in normal_readings(g).items()}
    best = max(fits, key=lambda text: fits[text])
    if fits[best] <= max(now + BETTER, AGREE):
        mean = _agreeing_means(g, g.normal)
        if now >= AGREE or mean >= AGREE:
            return _axes_line(g, profile, inside)
        means = {text: _agreeing_means(g, normal) for text, normal in normal_readings(g).items()}
        best = max(means, key=lambda text: means[text])
        if means[best] >= AGREE:
            return (
                f"{best} fits better: mean normals agree with depth in {means[best]:.0%} of the blocks, not {mean:.0%}"
            )
        if line := _axes_line(g, profile, inside):
            return line
        most = float((1 / g.depth if profile.depth_kind == "reciprocal" else g.depth)[g.hit].max())
        hint = "depth lies within 0 and 1, and may be normalised: write it in world units" if most <= 1 else CAMERA
        return f"normals agree with depth at {now:.0%} of the pixels, and no setting makes them; {hint}"
    return f"{best} fits better: normals agree with depth at {fits[best]:.0%} of the pixels instead of {now:.0%}"


def _axes_line(g: GBuffer, profile: Profile, inside: Tensor) -> str:
    """By all orders and signs of the file's axes, where others mend many pixels and break next to none.

    Walls along the axes fit most of them, and only what is round or askew tells. Normals that faced away have been
    turned, so that neither side counts.
    """
    like = g.camera.normals_from_depth(g.depth)
    given, true = (their_axes(n, profile, g.camera)[0][:, inside[0, 0]].T for n in (g.normal, like))
    close, found = torch.tensor(CLOSE).deg2rad().cos(), dict[tuple[tuple[int, ...], tuple[int, ...]], Tensor]()
    for order, signs in product(permutations(range(3)), ((1, 1, 1), (-1, 1, 1), (1, -1, 1), (1, 1, -1))):
        found[order, signs] = (given[:, order] * given.new_tensor(signs) * true).sum(1)
    fits = {reading: cosine.abs() > close for reading, cosine in found.items()}
    now = fits[(0, 1, 2), (1, 1, 1)]
    order, signs = max(fits, key=lambda reading: int(fits[reading].sum()))
    best = fits[order, signs]
    mended, broken = int((best & ~now).sum()), int((now & ~best).sum())
    if mended < max(FEW, MENDED * len(now)) or broken > BROKEN * mended:
        return ""
    side = 1 if float(found[order, signs][best].sign().mean()) > 0 else -1
    signs = [side * sign for sign in signs]
    shares = f"at {float(best.float().mean()):.0%} of the pixels instead of {float(now.float().mean()):.0%}"
    if order == (0, 1, 2):
        scale = [sign * factor for sign, factor in zip(signs, profile.normal_scale, strict=True)]
        return f"normal_scale = {scale} fits better: normals agree with depth {shares}"
    axes = ", ".join(f"{'-' * (sign < 0)}{'XYZ'[axis]}" for axis, sign in zip(order, signs, strict=True))
    return f"axes of normals in the order {axes} fit better: they agree with depth {shares}; write them so"


def _agreeing_means(g: GBuffer, normal: Tensor) -> float:
    """The share of the blocks of the picture whose mean normal is within `TILT` of that of the depth.

    Normal maps tip normals this way and that, by more than `CLOSE`, and have the surface's own in the mean.
    """
    side, hit = max(min(g.depth.shape[-2:]) // BLOCKS, 1), g.hit.to(g.depth)
    pooled = lambda t: torch.nn.functional.avg_pool2d(t * hit, side, max(side // 2, 1))
    told = pooled(hit) > AGREE
    mean, like = (
        torch.nn.functional.normalize(pooled(n), dim=1) for n in (normal, g.camera.normals_from_depth(g.depth))
    )
    close = (mean * like).sum(1, keepdim=True)[told] > torch.tensor(TILT).deg2rad().cos()
    return float(close.float().mean()) if close.numel() else 0.0


def _static_line(g: GBuffer, motion: Tensor, previous: Camera) -> str:
    expected, _ = g.camera.static_motion(previous, g.depth, g.hit)
    length_px = expected.norm(dim=1, keepdim=True)
    told = g.hit & (length_px > MOVES)  # what hardly moves fits any sign
    if int(told.sum()) < FEW:
        return ""

    def share(reading: Tensor) -> float:
        off = (reading - expected).norm(dim=1, keepdim=True)
        return float((off < (0.1 * length_px).clamp_min(0.1))[told].float().mean())

    now = share(motion)
    line = _motion_line(now, {text: share(m) for text, m in motion_readings(motion).items()}, "the cameras")
    if line or now > BETTER:
        return line
    scale = depth_factor(motion, g.camera, previous, g.depth, told)
    still, _ = g.camera.static_motion(previous, g.depth * scale, g.hit)
    fits = float(((motion - still).norm(dim=1, keepdim=True) < 0.1)[told].float().mean())
    if fits > max(now + BETTER, AGREE):
        return f"depth_scale times {scale:.3g} fits better: motion agrees with the cameras at {fits:.0%} of the pixels"
    return (
        f"motion agrees with the cameras at {now:.0%} of the pixels, and no setting makes it fit; if not all of them "
        "move, take that of a still world: motion = [] under [channels] of a profile"
    )


def _mover_line(g: GBuffer, motion: Tensor, before: GBuffer) -> str:
    expected, _ = g.camera.static_motion(before.camera, g.depth, g.hit)
    moves = g.hit & ((motion - expected).norm(dim=1, keepdim=True) > 1e-3)
    if int(moves.sum()) < FEW:
        return ""
    readings = {text: m for text, m in motion_readings(motion).items() if _moved(m, moves)}
    fits = {text: found_again(g, m, before, moves) for text, m in readings.items()}
    return _motion_line(found_again(g, motion, before, moves), fits, "the frame before")


def _moved(motion: Tensor, moves: Tensor) -> bool:
    """Whether motion is long enough to tell: a step of a fraction of a pixel finds the same surface anyhow."""
    return float(motion.norm(dim=1, keepdim=True)[moves].median()) > MOVES


def _motion_line(now: float, fits: dict[str, float], what: str) -> str:
    best = max(fits, key=lambda text: fits[text])
    if fits[best] <= now + BETTER:
        return ""
    return f"{best} fits better: motion agrees with {what} at {fits[best]:.0%} of the pixels instead of {now:.0%}"


def _agreeing(g: GBuffer, camera: Camera, depth: Tensor, normal: Tensor, inside: Tensor) -> float:
    """The share of the pixels where the normal is within `CLOSE` of that of the depth."""
    cosine = (camera.normals_from_depth(depth.to(g.depth)) * normal).sum(1, keepdim=True)[inside]
    return float((cosine > torch.tensor(CLOSE).deg2rad().cos()).float().mean())
