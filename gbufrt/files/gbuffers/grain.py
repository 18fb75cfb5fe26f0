"""How noisy the light of a frame is, and whether some of it is that of lamps."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt.frame import Frame
from gbufrt.luminance import luminance

ALIKE = 0.02  # relative difference up to which depths and colours of neighbours are the same surface's
TURNED = 0.999  # cosine of their normals from which on
NOISY = 0.06  # of pictures whose albedo is known
TEXTURED = 0.15  # of others, where the difference may be that of a texture
LAMP = 10.0  # times as much light for their colour as half of the surfaces send: lamps, or what the sun shines on
FEW = 1e-3  # share of the surfaces that may be so bright


def grain(frame: Frame) -> float:
    """Mean difference of light between neighbours on one surface of one colour, over its mean there.

    Args:
        frame: with ``radiance``, or else the finished picture in ``color``.

    Returns:
        0 for even light, about 1.1 times the relative deviation of noise; 0 where no two pixels are alike.
    """
    g, light = frame.gbuffer, frame.radiance if frame.radiance is not None else frame.read("color")
    light = luminance(light)
    one, two = slice(None, -1), slice(1, None)
    alike = g.hit[..., one] & g.hit[..., two] & _close(g.depth)
    alike &= (g.normal[..., one] * g.normal[..., two]).sum(dim=1, keepdim=True) > TURNED
    if g.albedo is not None:
        alike &= _close(g.albedo).all(dim=1, keepdim=True)
    alike &= light.isfinite()[..., one] & light.isfinite()[..., two]
    a, b = light[..., one][alike].double(), light[..., two][alike].double()
    return float((a - b).abs().sum() / ((a + b).sum() / 2).clamp_min(1e-12))


def noisy(frame: Frame) -> float | None:
    """The `grain` of light that is noisy; None where it is not, or where it may be a texture's."""
    found = grain(frame)
    return None if found < (TEXTURED if frame.gbuffer.albedo is None else NOISY) else found


def lamps_told(frame: Frame) -> str:
    """What to say where direct light shows surfaces as bright as lamps, and no emission tells which of it is theirs."""
    g, light = frame.gbuffer, frame.radiance
    if light is None or g.emission is not None:
        return ""
    sent = luminance(light) if g.albedo is None else luminance(light) / luminance(g.albedo).clamp_min(TEXTURED)
    sent = sent[g.hit].nan_to_num(posinf=0.0)
    lit = sent[sent > 0]
    if not lit.numel() or float((sent > LAMP * lit.median()).float().mean()) <= FEW:
        return ""
    return (
        "direct light shows surfaces over ten times as bright as most, and no layer of emission; if they are lamps, "
        "indirect light and mirrors count their light twice: write emission too"
    )


def _close(channel: Tensor) -> Tensor:
    a, b = channel[..., :-1], channel[..., 1:]
    return (a - b).abs() <= ALIKE * torch.minimum(a, b) + 1e-4
