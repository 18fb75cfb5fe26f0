"""Places on surfaces, with what light meets there."""

from __future__ import annotations

from dataclasses import dataclass

from torch import Tensor

from gbufrt.specular import DIELECTRIC_F0, directional_albedo
from gbufrt.tree import map_tensors
from tracer.sampling.scatter import dot


@dataclass(frozen=True, eq=False, kw_only=True)
class Vertices:
    """N places on surfaces.

    Args:
        points: ``(N, 3)`` world space, a little above the surface.
        normals: ``(N, 3)`` unit length, world space, facing where the ray came from; of the texture, where it has any.
            A direction that goes below the surface itself hits it at once, as in a crevice.
        toward: ``(N, 3)`` unit length, back along the ray.
        albedo: ``(N, 3)`` linear.
        roughness: ``(N,)`` perceptual.
        metallic: ``(N,)``.
        opacity: ``(N,)``.
        emission: ``(N, 3)``.
        inside: ``(N,)`` bool: the place lies within a transmissive material.
        instances: ``(N,)`` integers, the instance that each is on, 0 for the world.
    """

    points: Tensor
    normals: Tensor
    toward: Tensor
    albedo: Tensor
    roughness: Tensor
    metallic: Tensor
    opacity: Tensor
    emission: Tensor
    inside: Tensor
    instances: Tensor

    def __len__(self) -> int:
        return len(self.points)

    def __getitem__(self, rows: Tensor | slice) -> Vertices:
        return map_tensors(lambda x: x[rows], self)

    def repeat(self, times: int) -> Vertices:
        """All of them, ``times`` times over."""
        return map_tensors(lambda x: x.repeat(times, *(1,) * (x.ndim - 1)), self) if times > 1 else self

    @property
    def alpha(self) -> Tensor:
        """``(N,)`` GGX width."""
        return self.roughness * self.roughness

    @property
    def f0(self) -> Tensor:
        """``(N, 3)`` reflectance at normal incidence: 0.04 for dielectrics, the albedo for metals."""
        return DIELECTRIC_F0 + (self.albedo - DIELECTRIC_F0) * self.metallic[:, None]

    @property
    def diffuse(self) -> Tensor:
        """``(N, 3)`` diffuse albedo; see `tracer.direct.lighting.light`."""
        return self.albedo * ((1 - self.metallic) * self.opacity)[:, None]

    @property
    def enters(self) -> Tensor:
        """``(N, 1)`` factor of a dielectric surface on its diffuse light: what it does not reflect toward the eye."""
        return 1 - directional_albedo(dot(self.normals, self.toward), self.roughness)[:, None]
