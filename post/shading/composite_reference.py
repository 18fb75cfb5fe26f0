"""The definitions, in torch, of the sum of all light and of what surfaces reflect as dielectrics."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt import GBuffer
from gbufrt.specular import directional_albedo


def sum_reference(
    radiance: Tensor,
    ambient: Tensor | None,
    emission: Tensor | None,
    visibility: Tensor | None,
    gi: Tensor | None,
    reflection: Tensor | None,
    behind: Tensor | None,
    specular: Tensor | None,
    physical: bool,
    intensities: tuple[float, float, float],
) -> Tensor:
    """See `post.composite`; ``intensities`` are those of AO, GI and reflections."""
    of_ao, of_gi, of_reflection = intensities
    lit = torch.zeros_like(radiance) if ambient is None else ambient
    own = torch.zeros_like(radiance) if emission is None else emission
    if not physical:
        lit = lit + radiance - own
    if visibility is not None:
        lit = lit * visibility.clamp(0, 1) ** of_ao
    if physical:
        lit = lit + radiance - own
    if gi is not None:
        lit = lit + of_gi * gi
    if behind is not None:
        lit = lit + behind
    if reflection is None:
        return lit + own
    if specular is not None and physical:
        lit = lit * (1 - min(of_reflection, 1.0) * specular)
    return lit + own + of_reflection * reflection


def specular_reference(gbuffer: GBuffer) -> Tensor:
    """See `post.shading.composite_op.specular_albedo`."""
    g = gbuffer
    toward = g.camera.to_eye(g.camera.unproject(g.depth.detach()))  # the same at any depth
    eye = g.camera.rotate_to_world(toward)
    cosine = (eye * g.normal).sum(1, keepdim=True).clamp(0.0, 1.0)
    roughness = torch.zeros_like(cosine) if g.roughness is None else g.roughness
    return torch.where(g.hit, directional_albedo(cosine, roughness), 0.0)
