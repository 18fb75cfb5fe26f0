"""The air between a camera and what it sees."""

from __future__ import annotations

from collections.abc import Sequence

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt.atmosphere.medium import Atmosphere
from gbufrt.atmosphere.rays import marched
from gbufrt.atmosphere.scattering import tables_of
from gbufrt.atmosphere.sky import unit_direction
from gbufrt.atmosphere.tables import DTYPE
from gbufrt.sampling import sample_volume

GRID = (18, 32)  # directions of a picture: the light of air changes slowly between them
SLICES = 24  # distances, closer together near the camera


def air_before(
    atmosphere: Atmosphere,
    direction: Sequence[float],
    directions: Tensor,
    distance: Tensor,
    *,
    height: float = 0.05,
) -> tuple[Tensor, Tensor]:
    """Light that air adds before surfaces, for a sun of unit irradiance, and the share of theirs that it lets through.

    Args:
        atmosphere: the air.
        direction: toward the sun, world space, y up, of any length.
        directions: ``(B, 3, H, W)`` of the picture's rays, world space, unit length.
        distance: ``(B, 1, H, W)`` to the surfaces, kilometres.
        height: of the camera above the ground, kilometres, within the air.

    Returns:
        ``(B, 3, H, W)`` each: radiance and transmittance; differentiable in ``distance``.

    Raises:
        ValueError: ``direction`` has no length, or ``height`` is not within the air.

    Source: Hillaire 2020, 5.4 (aerial perspective volume).
    """
    if not 0 <= height <= atmosphere.thickness:
        raise ValueError(f"height must lie in 0..{atmosphere.thickness:g} kilometres, got {height}")
    sun = unit_direction(direction).to(directions.device)
    tables = tables_of(atmosphere, directions.device)
    few = F.interpolate(directions.to(DTYPE), size=GRID, mode="bilinear", align_corners=True)
    few = F.normalize(few, dim=1)
    up, between = few[:, 1], torch.einsum("i,bihw->bhw", sun, few)
    farthest = distance.detach().amax(dim=(2, 3)).to(DTYPE).clamp_min(1e-9)
    farthest = farthest.log2().ceil().exp2()  # (B, 1): a power of two, so that slices stay where they are over frames
    stop, start = farthest[..., None].expand_as(up), torch.full_like(up, height)  # under the ground, as on it
    light, clear = marched(tables, start, up, sun[1].expand_as(up), between, stop, SLICES, slices=SLICES)
    slices = torch.cat([light, clear], dim=-1)
    nothing = torch.cat([torch.zeros_like(light[..., :1, :]), torch.ones_like(light[..., :1, :])], dim=-1)
    volume = torch.cat([nothing, slices], dim=-2).permute(0, 4, 3, 1, 2).to(distance.dtype)  # (B, 6, SLICES + 1, h, w)
    reach = (distance[:, 0] / farthest[..., None].to(distance.dtype)).clamp_min(1e-12).sqrt().clamp(max=1.0)
    rows, columns = (torch.linspace(0, 1, n, dtype=distance.dtype, device=distance.device) for n in distance.shape[2:])
    y, x = torch.meshgrid(rows, columns, indexing="ij")
    found = sample_volume(volume, torch.stack([x.expand_as(reach), y.expand_as(reach), reach], dim=1))
    return found[:, :3], found[:, 3:]
