"""Whether the pictures that functions are given fit their camera, and one another."""

from __future__ import annotations

from typing import Any

from torch import Tensor

from gbufrt.camera import Camera
from gbufrt.channels import Channel, check_picture, check_tensor
from gbufrt.frame import SIGNALS
from gbufrt.gbuffer import CHANNELS
from gbufrt.numeric import check_numbers

ROWS = {
    **CHANNELS,
    **SIGNALS,
    "light": SIGNALS["radiance"],
    "visibility": SIGNALS["ao"],
    "f0": Channel(3, "reflectance at normal incidence, linear"),
}

SHARES = {"visibility": 1, "specular": 1}
"""Components of those that are no light."""


def check_pictures(camera: Any, *, thickness: Any = None, **pictures: Any) -> None:
    """Raise unless pictures, by the names of channels and signals, have their form at the size of a camera.

    Args:
        camera: of the pictures.
        thickness: a picture, or a number for every pixel, world units.
        pictures: None where absent; ``light`` is as ``radiance``, ``visibility`` as ``ao``.

    Raises:
        TypeError: not a camera, tensor or number, or a tensor of the wrong kind of number.
        ValueError: wrong shape or device.
    """
    check_camera(camera)
    if isinstance(thickness, Tensor) and thickness.ndim > 0:
        pictures["thickness"] = thickness
    else:
        check_numbers(thickness=thickness)
    for name, picture in pictures.items():
        if picture is not None:
            check_tensor(name, picture, ROWS[name], batch=camera.batch, size=camera.size, device=camera.device)


def check_camera(camera: Any, name: str = "camera", remedy: str = "") -> None:
    """Raise TypeError, with a remedy, unless what an argument called ``name`` holds is a camera."""
    if not isinstance(camera, Camera):
        raise TypeError(f"{name} must be a gbufrt.Camera, got {type(camera).__name__}{remedy}")


def check_beside(color: Any, **channels: Any) -> None:
    """Raise unless ``color`` is ``(B, C, H, W)`` of floats and channels of a G-buffer, by name, have its pixels.

    Raises:
        TypeError: not a tensor, or of whole numbers.
        ValueError: wrong shape.
    """
    for name, picture in {"color": color, **channels}.items():
        if not isinstance(picture, Tensor):
            raise TypeError(f"{name} must be a torch.Tensor, got {type(picture).__name__}")
        if not picture.is_floating_point():
            raise TypeError(f"{name} must be of floats, got {str(picture.dtype).removeprefix('torch.')}")
    if color.ndim != 4:
        raise ValueError(f"color must be (B,C,H,W), got {tuple(color.shape)}")
    batch, _, *size = color.shape
    for name, picture in channels.items():
        expected = (batch, ROWS[name].components, *size)
        if picture.shape != expected:
            last = picture.shape[2:] == color.shape[1:3]
            hint = "; if color is (B,H,W,C), use .permute(0, 3, 1, 2)" if last else ""
            raise ValueError(f"{name} must be {expected} like color, got {tuple(picture.shape)}{hint}")


def check_alike(first: str, **pictures: Any) -> None:
    """Raise unless pictures are of the batch and size of the one called ``first``, and of its components or one.

    Args:
        first: name of the picture that the others must be like, ``(B, 3, H, W)``.
        pictures: by name; None where absent.

    Raises:
        TypeError: not a tensor, or of whole numbers.
        ValueError: wrong shape.
    """
    like = pictures[first]
    check_picture(first, like, "linear radiance", components=3)
    for name, picture in pictures.items():
        if picture is None or name == first:
            continue
        if not isinstance(picture, Tensor):
            raise TypeError(f"{name} must be a torch.Tensor, got {type(picture).__name__}")
        shape = tuple(picture.shape)
        if len(shape) != 4 or shape[1] not in (1, 3) or (shape[0], *shape[2:]) != (like.shape[0], *like.shape[2:]):
            wanted = f"({like.shape[0]},{SHARES.get(name, 3)},{like.shape[2]},{like.shape[3]})"
            raise ValueError(f"{name} must be {wanted} like {first}, got {shape}")
        if picture.device != like.device:
            raise ValueError(f"{name} is on {picture.device} but {first} is on {like.device}; move one with .to()")
