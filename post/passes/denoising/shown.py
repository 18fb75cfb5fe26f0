"""What each pixel of path-traced light shows: a surface, what lies behind a clear one, or a mirror's image."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from gbufrt import Camera, GBuffer
from gbufrt.luminance import luminance
from post.filters.signals import MIN_ALBEDO
from post.history.reproject import motion_of
from post.mirrors.image import METAL, SMOOTH, mirror_image
from post.shading.composite_op import specular_albedo

CLEAR = 0.05  # transmittance above which a pixel is taken to show what lies behind the surface
MOST = 2.0  # times as much light by reflection as otherwise, for equal light all around, makes a mirror
GEOMETRY = ("depth", "normal", "normal_geo", "motion", "motion_z", "object_id")


class Shown(NamedTuple):
    """What each pixel shows: a surface, seen directly, through a clear one, or in a mirror."""

    gbuffer: GBuffer
    divisor: Tensor
    """``(B, 3, H, W)``: albedo, never quite black; 1 where nothing was hit."""
    emission: Tensor
    """``(B, 3, H, W)`` linear radiance."""
    mirrors: Tensor | None = None
    """``(B, 1, H, W)`` bool: where the surface is seen in a mirror; None where there is no mirror."""
    glossy: Tensor | None = None
    """``(B, 1, H, W)`` in [0, 1]: share of the divisor by which the surface reflects a narrow lobe; None where it is
    not told apart. Light from there is unlike that from all around, so that what is left after division is unlike too,
    and shows the texture again."""
    facing: Tensor | None = None
    """``(B, 3, H, W)`` normals of the mirrors themselves; None where there is no mirror."""


def completed(g: GBuffer, previous: Camera | None) -> GBuffer:
    """The G-buffer, with what files of renderers leave out and `denoise` needs.

    Motion is that of a world that stands still, from the cameras, because images in mirrors move unlike their
    surfaces. Metals whose albedo is black are white: many renderers write that of diffuse light alone, and light
    divided by black would outshine all around.

    Args:
        g: of the frame, or of what lies behind the first surface.
        previous: camera of the frame before; None leaves motion as it is.
    """
    changes = dict[str, Tensor]()
    if previous is not None and (g.motion is None or g.motion_z is None):
        changes["motion"], changes["motion_z"] = motion_of(g, previous)
    if g.metallic is not None and g.albedo is not None:
        black = (g.metallic > METAL) & (g.albedo.amax(1, keepdim=True) <= MIN_ALBEDO)
        changes["albedo"] = torch.where(black, 1.0, g.albedo)
    return g.replace(**changes) if changes else g


def reflectance_of(g: GBuffer, *, specular: bool) -> Tensor | None:
    """`specular_albedo`, where light by that way or through what transmits is to be told apart; else None."""
    needed = g.transmittance is not None or (specular and g.roughness is not None)
    return specular_albedo(g) if needed else None


def visible_layer(g: GBuffer, behind: GBuffer | None, reflected: Tensor | None, *, specular: bool = False) -> Shown:
    """What each pixel shows, mirrors being surfaces as others.

    Args:
        g: of the frame.
        behind: of what lies straight behind the first transmissive surface; used where that surface is clear enough.
        reflected: what `reflectance_of` finds for ``g``.
        specular: add the specular albedo of dielectrics to theirs, if roughness is known: most light of polished dark
            stone comes by it, and divided by albedo alone that light would not compare with that of pale stone.
    """
    one, none = torch.ones_like(g.normal), torch.zeros_like(g.normal)
    albedo = diffuse = one if g.albedo is None else g.albedo
    emission = none if g.emission is None else g.emission
    shown, glossy = g, None
    if specular and g.roughness is not None and reflected is not None:
        share = reflected * (1 if g.metallic is None else 1 - g.metallic)
        albedo = share + (1 - share) * albedo
        glossy = (1 - g.roughness) * share / luminance(albedo).clamp_min(MIN_ALBEDO)
    if behind is not None and g.transmittance is not None and reflected is not None:
        own = one[:, :1] if g.opacity is None else g.opacity
        far_albedo = one if behind.albedo is None else behind.albedo
        far_emission = none if behind.emission is None else behind.emission
        through = g.transmittance * far_albedo
        clear = behind.hit & (g.transmittance.amax(1, keepdim=True) > CLEAR)
        albedo = torch.where(clear, reflected + (1 - reflected) * (own * diffuse + through), albedo)
        emission = torch.where(clear, emission + (1 - reflected) * g.transmittance * far_emission, emission)
        shown = _merged(clear, behind, g)
    return Shown(shown, _divisor(g.hit, albedo), emission, glossy=glossy)


def in_mirrors(
    g: GBuffer,
    shown: Shown,
    previous: Camera | None,
    reflected: Tensor | None = None,
    before: Tensor | None = None,
    tight: Tensor | None = None,
) -> Shown:
    """What each pixel shows, with the virtual images of what mirrors reflect in place of the mirrors.

    Water and polished stone that mirror more than they scatter or let through count as mirrors: edges of what they
    show are those of the image.

    Args:
        g: of the frame.
        shown: what `visible_layer` found.
        previous: camera of the frame before, see `post.mirrors.image.mirror_image`.
        reflected: `specular_albedo` of ``g``, where the light holds what dielectrics reflect; without it metals
            alone are mirrors.
        before: `Shown.facing` of the frame before.
        tight: see `post.mirrors.image.mirror_image`.
    """
    polished = None if reflected is None else _polished(g, shown, reflected)
    image = mirror_image(g, previous, polished, before, tight)
    if image is None:
        return shown
    divisor = torch.where(image.mask, _divisor(g.hit, image.albedo), shown.divisor)
    if polished is not None:  # the rest of their light is still that of the surface, or of what lies behind it
        divisor = torch.where(polished, _divisor(g.hit, shown.divisor + image.albedo - image.reflectance), divisor)
    return Shown(
        _merged(image.follows, image.gbuffer, shown.gbuffer),
        divisor,
        torch.where(image.mask, shown.emission + image.emission, shown.emission),
        image.mask,
        None if shown.glossy is None else torch.where(image.mask, 0.0, shown.glossy),
        image.facing,
    )


def _polished(g: GBuffer, shown: Shown, reflected: Tensor) -> Tensor | None:
    """``(B, 1, H, W)`` bool: smooth surfaces, no metals, whose reflectance is most of the divisor."""
    if g.roughness is None or g.metallic is None or g.albedo is None:
        return None
    rest = (shown.divisor - reflected).mean(1, keepdim=True)
    return g.hit & (g.roughness < SMOOTH) & (g.metallic <= METAL) & (reflected > MOST * rest)


def _divisor(hit: Tensor, albedo: Tensor) -> Tensor:
    return torch.where(hit, albedo.clamp_min(MIN_ALBEDO), 1.0)


def _merged(mask: Tensor, far: GBuffer, near: GBuffer) -> GBuffer:
    """``near``, with the geometry of ``far`` where ``mask`` ``(B, 1, H, W)`` is True."""
    pairs = {name: (getattr(far, name), getattr(near, name)) for name in GEOMETRY}
    both = {name: pair for name, pair in pairs.items() if pair[0] is not None and pair[1] is not None}
    return near.replace(**{name: torch.where(mask, *pair) for name, pair in both.items()})
