"""Whether the pictures that functions are given fit their camera, and one another."""

from __future__ import annotations

import math
from typing import Any

from torch import Tensor

from gbufrt.camera import Camera
from gbufrt.channels import Channel, check_like, check_one_kind, check_picture, check_tensor
from gbufrt.frame import SIGNALS
from gbufrt.gbuffer import CHANNELS
from gbufrt.numeric import check_between

ROWS = {
    **CHANNELS,
    **SIGNALS,
    "light": SIGNALS["radiance"],
    "previous_depth": CHANNELS["depth"],
    "color": SIGNALS["composite"],  # which is no larger than its G-buffer
    "visibility": SIGNALS["ao"],
    "f0": Channel(3, "reflectance at normal incidence, linear"),
}

SHARES = ("visibility", "specular", "chosen", "distance", "reactive")
"""Those of one component, which are no light."""

NEEDED = ("depth", "normal", "light", "signal", "color")
"""Those that no function takes as absent."""


def check_pictures(camera: Any, *, thickness: Any = None, **pictures: Any) -> None:
    """Raise unless pictures, by the names of channels and signals, have their form at the size of a camera.

    Args:
        camera: of the pictures.
        thickness: a picture, or a number for every pixel, at least 0 world units.
        pictures: None where absent; ``light`` is as ``radiance``, ``visibility`` as ``ao``.

    Raises:
        TypeError: not a camera, tensor or number, a tensor of the wrong kind of number, or kinds of floats are mixed.
        ValueError: wrong shape or device, or a negative number.
    """
    check_camera(camera)
    _check_there(pictures)
    if isinstance(thickness, Tensor) and thickness.ndim > 0:
        pictures["thickness"] = thickness
    elif thickness is not None:
        check_between(0, math.inf, thickness=thickness)
    for name, picture in pictures.items():
        if picture is not None:
            check_tensor(name, picture, ROWS[name], batch=camera.batch, size=camera.size, device=camera.device)
    check_one_kind(**pictures)


def _check_there(pictures: dict[str, Any]) -> None:
    """Raise TypeError where one of `NEEDED` is None, which `check_pictures` and `check_sizes` pass over in others."""
    for name in NEEDED:
        if name in pictures and pictures[name] is None:
            raise TypeError(f"{name} must be a torch.Tensor, got None: this function cannot do without")


def check_camera(camera: Any, name: str = "camera", remedy: str = "") -> None:
    """Raise TypeError, with a remedy, unless what an argument called ``name`` holds is a camera."""
    if not isinstance(camera, Camera):
        raise TypeError(f"{name} must be a gbufrt.Camera, got {type(camera).__name__}{remedy}")


def check_sizes(camera: Any, **pictures: Any) -> None:
    """Raise unless pictures, by name, have the size and batch of their camera, and one kind of floats.

    Any number of components goes; `check_pictures` is for what has the form of a channel. None is passed over.

    Raises:
        TypeError: not a camera or tensor, or kinds of floats are mixed.
        ValueError: wrong size, batch or device: kernels would read beside the picture.
    """
    check_camera(camera)
    _check_there(pictures)
    fits = (camera.batch, *camera.size)
    for name, picture in pictures.items():
        if picture is None:
            continue
        if not isinstance(picture, Tensor):
            raise TypeError(f"{name} must be a torch.Tensor, got {type(picture).__name__}")
        if picture.is_complex():
            raise TypeError(f"{name} must hold real numbers, got {picture.dtype}")
        if picture.ndim != 4 or (len(picture), *picture.shape[-2:]) != fits or not picture.shape[1]:
            raise ValueError(
                f"{name} must be ({camera.batch},C,{camera.height},{camera.width}) like its camera, "
                f"got {tuple(picture.shape)}"
            )
        if picture.device != camera.device:
            raise ValueError(f"{name} is on {picture.device} but its camera is on {camera.device}; move one with .to()")
    check_one_kind(**pictures)


def check_beside(color: Any, **channels: Any) -> None:
    """Raise unless ``color`` is ``(B, C, H, W)`` of floats and channels of a G-buffer, by name, have its pixels.

    Raises:
        TypeError: not a tensor, of whole numbers, or kinds of floats are mixed.
        ValueError: wrong shape or device.
    """
    check_picture("color", color, "linear radiance", components=None)
    for name, picture in channels.items():
        check_like(name, picture, "color", color, (ROWS[name].components,))


def check_alike(first: str, **pictures: Any) -> None:
    """Raise unless pictures are of the batch and size of the one called ``first``, and of its components or one.

    Args:
        first: name of the picture that the others must be like, ``(B, 3, H, W)``.
        pictures: by name; None where absent.

    Raises:
        TypeError: not a tensor, of whole numbers, or kinds of floats are mixed.
        ValueError: wrong shape or device.
    """
    like = pictures[first]
    check_picture(first, like, "linear radiance", components=3)
    for name, picture in pictures.items():
        if picture is not None and name != first:
            check_like(name, picture, first, like, (1, 3) if name in SHARES else (3, 1))
