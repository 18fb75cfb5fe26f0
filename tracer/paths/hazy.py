"""Haze before what surfaces reflect, as the camera sees it before the surfaces themselves."""

from __future__ import annotations

import torch
from torch import Tensor

from tracer.lights.haze import haze_beyond, sky_behind
from tracer.paths.surfaces.vertices import Vertices
from tracer.sampling.scatter import fresnel, sample_specular
from tracer.scene.scene import Scene


def in_haze(scene: Scene, at: Vertices, u: Tensor, specular: Tensor, distance: Tensor, eye: Tensor) -> Tensor:
    """Specular light by one path a surface, of which haze on the reflected ray takes a part and puts in its own.

    Haze goes on where that before the surface ends, as if what is reflected lay behind it. Light of shadow rays counts
    as light of the reflected ray.

    Args:
        scene: with haze.
        at: M surfaces.
        u: ``(2, M)`` from which their reflected rays were drawn.
        specular: ``(3, M)`` linear radiance without haze, Fresnel included.
        distance: ``(M,)`` world units along the reflected rays to what they hit, 0 where that is nothing.
        eye: ``(3,)`` of the camera.

    Returns:
        ``(3, M)``.
    """
    assert scene.haze is not None
    directions, weight, cosine = sample_specular(at.normals, at.toward, at.alpha, u)
    share = haze_beyond(scene.haze, at.points - eye, directions * distance[:, None])
    air = sky_behind(scene, directions.T[None])[0]
    return torch.lerp(specular, air * weight * fresnel(at.f0, cosine).T, share)
