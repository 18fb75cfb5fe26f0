"""Finished pictures as a video: H.264 in .mp4, ProRes 422 HQ in .mov, tagged as BT.709."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from gbufrt.files.output import MAX_PIXELS, atomic

BT709 = 1  # of colour space, primaries and transfer alike, in ISO/IEC 23091-2
LIMITED = 1  # range: black 16, white 235


@dataclass(frozen=True)
class Codec:
    """How a kind of file is encoded."""

    name: str
    pixels: str
    options: dict[str, str]


CODECS = {
    ".mp4": Codec("libx264", "yuv420p", {"crf": "16", "preset": "medium"}),
    ".mov": Codec("prores_ks", "yuv422p10le", {"profile": "3"}),
}


def check_video(path: Path) -> None:
    """Raise ValueError unless a video of this name can be made here."""
    if path.suffix.lower() not in CODECS:
        raise ValueError(f"a video must be .mp4 (H.264) or .mov (ProRes), got {path.name!r}")
    if find_spec("av") is None:
        raise ValueError("video needs PyAV: pip install 'gbufrt[video]'")


def write_video(path: str | Path, pictures: Sequence[Path], *, fps: float = 24.0) -> None:
    """Encode pictures, whole or not at all. An odd row or column is doubled at the border, as codecs want even sizes.

    Args:
        path: the video; its ending chooses the codec.
        pictures: sRGB-encoded PNG files of one size, in order, of 8 or 16 bits.
        fps: frames a second.

    Raises:
        FileNotFoundError: a picture is missing.
        ValueError: PyAV is not installed, another ending, no pictures, pictures of several sizes, or a damaged one.
    """
    path = Path(path)
    check_video(path)
    width, height = _common_size(pictures)
    import av

    codec, rate = CODECS[path.suffix.lower()], Fraction(fps).limit_denominator(1001)
    with atomic(path) as part, av.open(str(part), "w", format=path.suffix.lower()[1:]) as container:
        stream: Any = container.add_stream(codec.name, rate=rate, options=codec.options)
        stream.width, stream.height, stream.pix_fmt = width + width % 2, height + height % 2, codec.pixels
        context = stream.codec_context
        context.colorspace = context.color_primaries = context.color_trc = BT709
        context.color_range = LIMITED
        for number, picture in enumerate(pictures):
            frame = _converted(_decoded(picture), codec.pixels)
            frame.pts, frame.time_base = number, 1 / rate
            container.mux(stream.encode(frame))
        container.mux(stream.encode())


def _common_size(pictures: Sequence[Path]) -> tuple[int, int]:
    """Width and height of all pictures, from their headers."""
    if not pictures:
        raise ValueError("a video needs pictures, got none; give PNG files")
    size = None
    for picture in pictures:
        if not picture.is_file():
            raise FileNotFoundError(f"{picture} is missing; make it again (gbufrt render --resume), then the video")
        try:
            with Image.open(picture, formats=("PNG",)) as opened:
                found = opened.size
        except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
            raise ValueError(f"{picture} is no PNG, or damaged; make it again") from error
        if found[0] * found[1] > MAX_PIXELS:
            raise ValueError(f"{picture} has {found[0]}x{found[1]} pixels, more than the limit of {MAX_PIXELS}")
        size = size or found
        if found != size:
            raise ValueError(
                f"{picture} has {found[0]}x{found[1]} pixels, {pictures[0]} {size[0]}x{size[1]}; a video wants one size"
            )
    assert size is not None
    return size


def _decoded(picture: Path) -> np.ndarray:
    """``(H, W, 3)`` of 8 or 16 bits, of even sides."""
    import av
    from av.error import FFmpegError

    try:
        with av.open(str(picture), format="png_pipe") as file:
            frame = next(file.decode(video=0))
    except (FFmpegError, StopIteration) as error:
        raise ValueError(f"{picture} is damaged; make it again") from error
    deep = frame.format.components[0].bits == 16
    levels = frame.to_ndarray(format="rgb48le" if deep else "rgb24")
    return np.pad(levels, ((0, levels.shape[0] % 2), (0, levels.shape[1] % 2), (0, 0)), mode="edge")


def _converted(levels: np.ndarray, pixels: str) -> Any:
    """A video frame by the matrix of BT.709; libswscale takes BT.601's unless told."""
    import av
    from av.video.reformatter import ColorRange, Colorspace, Interpolation

    frame = av.VideoFrame.from_ndarray(levels, format="rgb48le" if levels.dtype == np.uint16 else "rgb24")
    return frame.reformat(
        format=pixels,
        dst_colorspace=Colorspace.ITU709,
        src_color_range=ColorRange.JPEG,
        dst_color_range=ColorRange.MPEG,
        interpolation=Interpolation.BICUBIC | Interpolation.ACCURATE_RND,
        dst_color_trc=BT709,
        dst_color_primaries=BT709,
    )
