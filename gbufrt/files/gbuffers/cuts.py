"""Where a sequence of another renderer begins another shot."""

from __future__ import annotations

from dataclasses import replace

import torch

from gbufrt.camera import Camera
from gbufrt.directions import length
from gbufrt.frame import Frame
from gbufrt.validation.motion import found_again

SEEN = 0.1  # share of the surfaces that the frame before shows too, below which a frame begins another shot
MOVED = 0.1  # of the picture's width, which still surfaces move by then: else things moved, and no camera
TURNED = 45.0  # degrees of turn in one frame, above which it does: whip pans stay below 30


def turn_between(before: Camera, camera: Camera) -> str:
    """How far a camera turns, where it is too far for one frame of a shot; empty where it is not."""
    along = (camera.forward * before.forward).sum(1).clamp(-1, 1)
    turned = float(along.acos().rad2deg().max())
    return f"the camera turns by {turned:.0f} degrees in one frame" if turned > TURNED else ""


def cut_between(before: Frame, frame: Frame) -> str:
    """Why a frame begins another shot than the one before it; empty where it does not."""
    g, b = frame.gbuffer, before.gbuffer
    if turns := turn_between(b.camera, g.camera):
        return turns
    if g.camera.size != b.camera.size or not bool(g.hit.any()):
        return ""
    motion, motion_z = g.camera.static_motion(b.camera, g.depth, g.hit)
    if float(length(motion)[g.hit].median()) < MOVED * g.camera.width:
        return ""
    seen = found_again(g.replace(motion_z=motion_z), motion, b, g.hit)
    return f"the frame before shows {seen:.0%} of what is in view" if seen < SEEN else ""


def cut_off(frame: Frame) -> Frame:
    """The frame as the first of a shot: without motion, which leads to a frame of another one."""
    gbuffer = replace(frame.gbuffer, previous_camera=None, motion=None, motion_z=None)
    return frame.replace(gbuffer=gbuffer, cut=torch.ones(1, dtype=torch.bool))
