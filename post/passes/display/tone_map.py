"""Tone curves from scene light to a display, and the display's own encoding."""

from __future__ import annotations

import math
from typing import cast

from torch import Tensor

from gbufrt import Frame, Pass
from gbufrt.channels import check_picture
from gbufrt.compute.resident import number
from gbufrt.mending import finite
from gbufrt.noise.noise import dithered
from gbufrt.numeric import check_between, check_each, check_for_each, check_numbers
from post.display.ocio import CONFIGS, check_view, is_config, ocio_view
from post.display.op import encoded, tone_curve
from post.display.reference import OPERATORS, Operator


def tone_map(
    color: Tensor,
    *,
    operator: Operator | str = "agx",
    exposure: float | Tensor = 1.0,
    contrast: float = 1.2,
    saturation: float = 1.2,
    white: float = 4.0,
    view: str = "",
) -> Tensor:
    """Compress scene light into what a display can show.

    Args:
        color: ``(B, 3, H, W)`` linear; negative light counts as none, and so does NaN, infinite light as the brightest
            of the picture.
        operator: ``"agx"`` lets bright colours fade to white as film does; ``"aces"`` is contrasty; ``"pbr_neutral"``
            leaves colours alone up to 0.76, for products; ``"reinhard"`` compresses luminance alone; ``"linear"``
            clips. ``"aces-1.3"``, ``"aces-2.0"`` or the path of an OpenColorIO config (.ocio, .ocioz) shows its view:
            on the CPU and without a gradient.
        exposure: factor on ``color``; a float, ``(B,)`` or ``(B, 1, 1, 1)``.
        contrast: AgX only: exponent of its look; 1 is the flat base, 1.35 "punchy".
        saturation: AgX only: of its look; 1 is the base, 1.4 "punchy".
        white: Reinhard only: luminance that becomes white.
        view: of an OpenColorIO config: ``"VIEW"``, ``"DISPLAY/VIEW"``, or empty for its default.

    Returns:
        ``(B, 3, H, W)`` display-linear in [0, 1]; see `display_encode`.

    Raises:
        TypeError: ``color`` is no tensor of float32 or float64.
        ValueError: ``color`` is not ``(B, 3, H, W)``, unknown operator or view, a number is not positive
            (exposure and saturation may be 0), or OpenColorIO is wanted and not installed.

    Source: AgX by Sobotka 2022 in the polynomial fit of Wrensch 2023; ACES fit by Hill (BakingLab); Khronos PBR
    Neutral Tone Mapper specification 2024; Reinhard et al. 2002, eq. 4.
    """
    check_picture("color", color, "linear")
    check_each(0, exposure=exposure)
    if isinstance(exposure, Tensor) and exposure.shape[1:] != (1, *color.shape[2:]):  # which is one a pixel
        check_for_each(len(color), exposure=exposure)
        exposure = exposure.reshape(-1, 1, 1, 1)
    color = finite(color)  # NaN is the largest number to some kernels, which would show it as white
    _check(operator, view)
    if is_config(operator):
        return ocio_view(color * number(exposure, color), operator, view)
    check_between(0, math.inf, saturation=saturation)
    check_numbers(contrast=contrast, white=white)
    for name, tunable in (("contrast", contrast), ("white", white)):
        if not tunable > 0:
            raise ValueError(f"{name} must be positive, got {tunable}")
    gain, curve = number(exposure, color), cast(Operator, operator)
    return tone_curve(color, gain, curve, contrast, saturation, white)


def _check(operator: str, view: str) -> None:
    if not isinstance(operator, str) or not isinstance(view, str):
        raise TypeError(f"operator and view must be texts, got {operator!r} and {view!r}")
    if is_config(operator):
        check_view(operator, view)
    elif operator in OPERATORS and view:
        raise ValueError(f"view {view!r}: {operator} has none; set operator to {', '.join(CONFIGS)} or a .ocio file")
    elif operator not in OPERATORS:
        names = ", ".join((*OPERATORS, *CONFIGS))
        raise ValueError(f"operator must be one of {names}, or the path of a .ocio file, got {operator!r}")


def display_encode(image: Tensor, *, dither: bool = False, index: int | Tensor = 0, seed: int = 0) -> Tensor:
    """Encode display-linear light as sRGB.

    Args:
        image: ``(B, 3, H, W)`` display-linear in [0, 1]; what is beyond is clipped, and NaN is 0.
        dither: add blue noise of one 8-bit step, so that rounding to 8 bits makes no bands.
        index: frame number, for the noise.
        seed: another seed, another noise.

    Returns:
        ``(B, 3, H, W)`` in [0, 1].

    Raises:
        TypeError: ``image`` is no tensor of float32 or float64.
        ValueError: ``image`` is not ``(B, 3, H, W)``.

    Source: IEC 61966-2-1.
    """
    check_picture("image", image, "display-linear")
    shown = encoded(finite(image))
    return dithered(shown, index=index, seed=seed) if dither else shown


class ToneMap(Pass):
    """See `tone_map`. ``exposure`` multiplies the frame's automatic exposure, where it has one."""

    reads = frozenset({"color"})
    optional = frozenset({"exposure"})
    writes = frozenset({"image"})

    def __init__(
        self,
        *,
        operator: Operator | str = "agx",
        exposure: float = 1.0,
        contrast: float = 1.2,
        saturation: float = 1.2,
        white: float = 4.0,
        view: str = "",
    ) -> None:
        super().__init__()
        _check(operator, view)
        self.operator, self.view = operator, view
        self.exposure, self.contrast, self.saturation, self.white = exposure, contrast, saturation, white

    def forward(self, frame: Frame) -> Frame:
        gain = self.exposure if frame.exposure is None else self.exposure * frame.exposure
        tunables = {**self.tunables(), "exposure": gain}
        return frame.replace(image=tone_map(frame.read("color"), **tunables))


class DisplayEncode(Pass):
    """See `display_encode`: the last pass."""

    reads = frozenset({"image"})
    writes = frozenset({"image"})

    def __init__(self, *, dither: bool = False, seed: int = 0) -> None:
        super().__init__()
        self.dither, self.seed = dither, seed

    def forward(self, frame: Frame) -> Frame:
        return frame.replace(image=display_encode(frame.read("image"), index=frame.index, **self.tunables()))
