"""The sum of all light, and what surfaces reflect as dielectrics, as torch operators: kernels on the CPU
and on CUDA.

The torch references run elsewhere and for gradients.
"""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt import GBuffer
from gbufrt.compute.dispatch import Form, form_of
from gbufrt.compute.operators import operator
from gbufrt.compute.resident import resident
from gbufrt.specular import directional_albedo_table
from post.shading.composite_reference import specular_reference, sum_reference


@operator("gbufrt::sum_light")
def sum_cpu(light: list[Tensor], physical: bool, of_gi: float, of_reflection: float) -> Tensor:
    """``(B, 3, H, W)``. See `sum_light`; ``light`` in the order of its arguments, without planes where absent."""
    from gbufrt.compute.kernel import array, threads
    from post.shading.composite_drivers import sum_each, sum_rows

    out, factors = torch.empty_like(light[0], memory_format=torch.contiguous_format), (of_gi, of_reflection)
    if form_of(out, cuda=True) is Form.CUDA:
        sum_each(out[:, 0].numel(), out, tuple(light), physical, *factors)
    else:
        sum_rows(array(out), tuple(map(array, light)), physical, *factors, threads())
    return out


@sum_cpu.register_fake
def _(light, physical, of_gi, of_reflection):
    return torch.empty_like(light[0], memory_format=torch.contiguous_format)


def sum_light(
    radiance: Tensor,
    ambient: Tensor | None,
    emission: Tensor | None,
    visibility: Tensor | None,
    gi: Tensor | None,
    reflection: Tensor | None,
    behind: Tensor | None,
    specular: Tensor | None,
    *,
    physical: bool,
    intensities: tuple[float, float, float],
    compiled: bool | None = None,
) -> Tensor:
    """Add up a surface's light: see `post.composite`, whose arguments these are.

    Args:
        radiance: ``(B, 3, H, W)``, as the other light; visibility and specular are ``(B, 1, H, W)``.
        ambient: see ``radiance``, as the rest.
        emission: see ``radiance``.
        visibility: see ``radiance``.
        gi: see ``radiance``.
        reflection: see ``radiance``.
        behind: see ``radiance``.
        specular: see ``radiance``.
        physical: which formula.
        intensities: of AO, GI and reflections; there is a kernel only for an AO of 1.
        compiled: see `gbufrt.compute.dispatch.form_of`.

    Returns:
        ``(B, 3, H, W)``.
    """
    given = (radiance, ambient, emission, visibility, gi, reflection, behind, specular)
    (batch, colors, *size), none = radiance.shape, radiance.new_empty(radiance.shape[0], 0, 0, 0)
    planes = (colors, colors, colors, 1, colors, colors, colors, 1)
    fits = all(t is None or t.shape == (batch, n, *size) for t, n in zip(given, planes, strict=True))
    form = form_of(*given, *intensities, compiled=compiled, cuda=True)
    if form is Form.REFERENCE or not fits or intensities[0] != 1:
        return sum_reference(*given, physical, intensities)
    return sum_cpu([none if t is None else t for t in given], physical, *map(float, intensities[1:]))


@operator("gbufrt::specular_albedo")
def specular_cpu(
    normal: Tensor, hit: Tensor, roughness: Tensor, lens: Tensor, pose: Tensor, table: Tensor, parallel: bool
) -> Tensor:
    """``(B, 1, H, W)``. See `specular_albedo`; an absent roughness has no planes, ``pose`` is ``(B, 3, 3)``."""
    from gbufrt.compute.kernel import array, threads
    from post.shading.composite_drivers import specular_each, specular_rows

    out = normal.new_empty(normal.shape[0], 1, *normal.shape[2:])
    given = (out[:, 0], normal, hit[:, 0], roughness, lens, pose, table)
    if form_of(out, cuda=True) is Form.CUDA:
        specular_each(out.numel(), *given, parallel)
    else:
        specular_rows(*map(array, given), parallel, threads())
    return out


@specular_cpu.register_fake
def _(normal, hit, roughness, lens, pose, table, parallel):
    return normal.new_empty(normal.shape[0], 1, *normal.shape[2:])


def specular_albedo(gbuffer: GBuffer, *, compiled: bool | None = None) -> Tensor:
    """Directional albedo of surfaces' specular lobe as dielectrics, 0 where nothing was hit.

    Args:
        gbuffer: surfaces; without ``roughness`` they are taken to be smooth.
        compiled: see `gbufrt.compute.dispatch.form_of`.

    Returns:
        ``(B, 1, H, W)`` in [0, 1]; differentiable.

    Source: see `gbufrt.specular.directional_albedo`.
    """
    g = gbuffer
    lens, pose = g.camera.lens.to(g.depth), g.camera.world_from_view[:, :3, :3].to(g.depth)
    if form_of(g.depth, g.normal, g.roughness, lens, pose, compiled=compiled, cuda=True) is Form.REFERENCE:
        return specular_reference(g)
    rough, table = g.depth[:, :0] if g.roughness is None else g.roughness, resident(directional_albedo_table, g.depth)
    return specular_cpu(g.normal, g.hit, rough, lens, pose, table, g.camera.orthographic)
