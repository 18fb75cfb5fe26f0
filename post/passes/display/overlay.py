"""Overlay: a user interface, subtitles or a watermark over the finished picture."""

from __future__ import annotations

from torch import Tensor

from gbufrt import Frame, Pass
from gbufrt.channels import check_picture
from gbufrt.numeric import check_path


def overlay(image: Tensor, ui: Tensor) -> Tensor:
    """Lay a layer with alpha over a display-encoded picture.

    Both are blended as encoded values, as programs that draw user interfaces expect, so that a grey of 0.5 at half
    alpha over black is 0.25.

    Args:
        image: ``(B, 3, H, W)`` display-encoded, in [0, 1].
        ui: ``(B, 4, H, W)`` or ``(1, 4, H, W)`` colour, encoded as the picture, and alpha, in [0, 1]; colour is not
            multiplied by alpha.

    Returns:
        ``(B, 3, H, W)``.

    Raises:
        TypeError: one of them is no tensor of floats.
        ValueError: another number of channels, another size or batch.

    Source: Porter and Duff 1984, "over".
    """
    check_picture("image", image, "display-encoded")
    check_picture("ui", ui, "colour and alpha, display-encoded", components=4)
    batch, _, *size = image.shape
    if ui.shape[0] not in (1, batch) or list(ui.shape[2:]) != size:
        wanted = f"({batch},4,{size[0]},{size[1]}), colour and alpha at the picture's size"
        raise ValueError(f"ui must be {wanted}, got {tuple(ui.shape)}")
    color, alpha = ui.to(image).split((3, 1), dim=1)
    return image * (1 - alpha) + color * alpha


class Overlay(Pass):
    """Lay the signal ``ui`` or a picture file over the image. See `overlay`.

    The last pass: neither lens nor exposure, tone curve or anti-aliasing touch what it draws. Without signal and file
    it changes nothing.

    Args:
        picture: path of a picture with alpha (PNG) as large as the frame; empty for none. The signal comes before it.
    """

    reads = frozenset({"image"})
    optional = frozenset({"ui"})
    writes = frozenset({"image"})

    def __init__(self, *, picture: str = "") -> None:
        super().__init__()
        check_path("picture", picture)
        self.picture = picture

    def forward(self, frame: Frame) -> Frame:
        ui, image = frame.get("ui"), frame.read("image")
        if ui is None and self.picture:
            ui = read_overlay(self.picture, (image.shape[2], image.shape[3]))
        return frame if ui is None else frame.replace(image=overlay(image, ui))


def read_overlay(path: str, size: tuple[int, int]) -> Tensor:
    """The picture of a file, for frames of ``size`` ``(H, W)``.

    Returns:
        ``(1, 4, H, W)`` encoded values in [0, 1], alpha last.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is no picture with alpha, or of another size.
    """
    from gbufrt.files.png import read_rgba

    ui = read_rgba(path)
    if ui.shape[2:] != size:
        (h, w), (height, width) = ui.shape[2:], size
        raise ValueError(f"{path} has {w}x{h} pixels, the frame {width}x{height}: make them the same size")
    return ui
