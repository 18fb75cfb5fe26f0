"""How noisy the light of a frame is."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt.frame import Frame
from gbufrt.luminance import luminance

ALIKE = 0.02  # relative difference up to which depths and colours of neighbours are the same surface's
TURNED = 0.999  # cosine of their normals from which on
NOISY = 0.06  # of pictures whose albedo is known
TEXTURED = 0.15  # of others, where the difference may be that of a texture


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


def _close(channel: Tensor) -> Tensor:
    a, b = channel[..., :-1], channel[..., 1:]
    return (a - b).abs() <= ALIKE * torch.minimum(a, b) + 1e-4
