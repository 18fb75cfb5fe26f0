"""Tone curves from scene light to a display, and the display's own encoding."""

from __future__ import annotations

from typing import Literal

import torch
from kornia.color import linear_rgb_to_rgb
from torch import Tensor

from gbufrt import Frame, Pass
from gbufrt.compute.fusion import fusible
from gbufrt.noise.noise import blue_noise
from post.filters.signals import luminance

Operator = Literal["agx", "aces", "pbr_neutral", "reinhard", "linear"]

AGX_INSET = (
    (0.842479062253094, 0.0784335999999992, 0.0792237451477643),
    (0.0423282422610123, 0.878468636469772, 0.0791661274605434),
    (0.0423756549057051, 0.0784336, 0.879142973793104),
)
AGX_MIN_EV, AGX_MAX_EV = -12.47393, 4.026069  # 10 stops below and 6.5 above middle grey, log2
AGX_CURVE = (-0.00232, 0.1191, 0.4298, -6.868, 31.96, -40.14, 15.5)  # by rising power
AGX_DISPLAY_GAMMA = 2.2

ACES_INPUT = ((0.59719, 0.35458, 0.04823), (0.07600, 0.90834, 0.01566), (0.02840, 0.13383, 0.83777))
ACES_OUTPUT = ((1.60475, -0.53108, -0.07367), (-0.10208, 1.10813, -0.00605), (-0.00327, -0.07276, 1.07602))

NEUTRAL_START = 0.8 - 0.04  # startCompression
NEUTRAL_DESATURATION = 0.15
NEUTRAL_F90 = 0.04
TINY = 1e-10


def tone_map(
    color: Tensor,
    *,
    operator: Operator = "agx",
    exposure: float | Tensor = 1.0,
    contrast: float = 1.2,
    saturation: float = 1.2,
    white: float = 4.0,
) -> Tensor:
    """Compress scene light into what a display can show.

    Args:
        color: ``(B, 3, H, W)`` linear; negative light counts as none.
        operator: ``"agx"`` lets bright colours fade to white as film does; ``"aces"`` is contrasty; ``"pbr_neutral"``
            leaves colours alone up to 0.76, for products; ``"reinhard"`` compresses luminance alone; ``"linear"``
            clips.
        exposure: factor on ``color``; a float or ``(B, 1, 1, 1)``.
        contrast: AgX only: exponent of its look; 1 is the flat base, 1.35 "punchy".
        saturation: AgX only: of its look; 1 is the base, 1.4 "punchy".
        white: Reinhard only: luminance that becomes white.

    Returns:
        ``(B, 3, H, W)`` display-linear in [0, 1]; see `display_encode`.

    Raises:
        ValueError: unknown operator, or a number is not positive.

    Source: AgX by Sobotka 2022 in the polynomial fit of Wrensch 2023; ACES fit by Hill (BakingLab); Khronos PBR
    Neutral Tone Mapper specification 2024; Reinhard et al. 2002, eq. 4.
    """
    if operator not in _OPERATORS:
        raise ValueError(f"operator must be one of {', '.join(_OPERATORS)}, got {operator!r}")
    for name, number in (("contrast", contrast), ("white", white)):
        if number <= 0:
            raise ValueError(f"{name} must be positive, got {number}")
    return _tone_map(color, torch.as_tensor(exposure, dtype=color.dtype), operator, contrast, saturation, white)


@fusible
def _tone_map(
    color: Tensor, exposure: Tensor, operator: Operator, contrast: float, saturation: float, white: float
) -> Tensor:
    light = (color * exposure.to(color)).clamp_min(0)
    if operator == "agx":
        return _agx(light, contrast, saturation)
    if operator == "reinhard":
        return _reinhard(light, white)
    return _OPERATORS[operator](light)


def _agx(light: Tensor, contrast: float, saturation: float) -> Tensor:
    inset = _matrix(AGX_INSET, light)
    stops = torch.einsum("ij,bjhw->bihw", inset, light).clamp_min(TINY).log2()
    x = ((stops - AGX_MIN_EV) / (AGX_MAX_EV - AGX_MIN_EV)).clamp(0, 1)
    curve = torch.zeros_like(x)
    for coefficient in reversed(AGX_CURVE):
        curve = curve * x + coefficient
    graded = curve.clamp_min(TINY) ** contrast
    grey = luminance(graded, 3)
    graded = grey + saturation * (graded - grey)
    shown = torch.einsum("ij,bjhw->bihw", torch.linalg.inv(inset), graded)
    return shown.clamp(TINY, 1) ** AGX_DISPLAY_GAMMA


def _aces(light: Tensor) -> Tensor:
    v = torch.einsum("ij,bjhw->bihw", _matrix(ACES_INPUT, light), light)
    v = (v * (v + 0.0245786) - 0.000090537) / (v * (0.983729 * v + 0.4329510) + 0.238081)
    return torch.einsum("ij,bjhw->bihw", _matrix(ACES_OUTPUT, light), v).clamp(0, 1)


def _pbr_neutral(light: Tensor) -> Tensor:
    least = light.amin(1, keepdim=True)
    offset = torch.where(least < 2 * NEUTRAL_F90, least - least.square() / (4 * NEUTRAL_F90), NEUTRAL_F90)
    light = light - offset
    peak = light.amax(1, keepdim=True)
    d = 1 - NEUTRAL_START
    over = peak.clamp_min(NEUTRAL_START)
    shown = 1 - d * d / (over + d - NEUTRAL_START)
    scaled = light * shown / over
    fade = 1 - 1 / (NEUTRAL_DESATURATION * (over - shown) + 1)
    return torch.where(peak < NEUTRAL_START, light, torch.lerp(scaled, shown.expand_as(scaled), fade)).clamp(0, 1)


def _reinhard(light: Tensor, white: float) -> Tensor:
    level = luminance(light, 3)
    return (light * (1 + level / white**2) / (1 + level)).clamp(0, 1)


def _linear(light: Tensor) -> Tensor:
    return light.clamp(0, 1)


_OPERATORS = {"agx": _agx, "aces": _aces, "pbr_neutral": _pbr_neutral, "reinhard": _reinhard, "linear": _linear}


def _matrix(rows: tuple[tuple[float, ...], ...], like: Tensor) -> Tensor:
    """Rows scaled to sum to one, so that the rounding of published digits does not tint grey."""
    matrix = torch.tensor(rows, dtype=like.dtype, device=like.device)
    return matrix / matrix.sum(1, keepdim=True)


def display_encode(image: Tensor, *, dither: bool = False, index: int = 0, seed: int = 0) -> Tensor:
    """Encode display-linear light as sRGB.

    Args:
        image: ``(B, 3, H, W)`` display-linear in [0, 1].
        dither: add blue noise of one 8-bit step, so that rounding to 8 bits makes no bands.
        index: frame number, for the noise.
        seed: another seed, another noise.

    Returns:
        ``(B, 3, H, W)`` in [0, 1].

    Source: IEC 61966-2-1.
    """
    encoded = linear_rgb_to_rgb(image.clamp(0, 1))
    if not dither:
        return encoded
    noise = blue_noise(*image.shape[-2:], index=index, dims=3, seed=seed, device=image.device).to(image.dtype)
    return (encoded + (noise - 0.5) / 255).clamp(0, 1)


class ToneMap(Pass):
    """See `tone_map`. ``exposure`` multiplies the frame's automatic exposure, where it has one."""

    reads = frozenset({"color"})
    optional = frozenset({"exposure"})
    writes = frozenset({"image"})

    def __init__(
        self,
        *,
        operator: Operator = "agx",
        exposure: float = 1.0,
        contrast: float = 1.2,
        saturation: float = 1.2,
        white: float = 4.0,
    ) -> None:
        super().__init__()
        self.operator: Operator = operator
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
