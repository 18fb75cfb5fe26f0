"""What each pixel of path-traced light shows: a surface, what lies behind a clear one, or a mirror's image."""

from __future__ import annotations

from functools import reduce
from typing import NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt import Camera, GBuffer
from gbufrt.compute.resident import waits
from gbufrt.luminance import luminance
from post.filters.around import pooled
from post.filters.edges import padded, windows
from post.filters.signals import MIN_ALBEDO
from post.mirrors.image import METAL, SMOOTH, mirror_image
from post.shading.composite_op import specular_albedo

CLEAR = 0.05  # transmittance above which a pixel is taken to show what lies behind the surface
MOST = 2.0  # times as much light by reflection as otherwise, for equal light all around, makes a mirror
GLARING = 8.0  # times the median light: as much is a lamp's if it is even
EVEN = 0.02  # relative difference of a lamp's pixels
HOLE, CLEAN = 6, 7  # pixels around a dark one that, if they are alike, make it the noise of a penumbra; and the side of
# the square in which a lamp has no such noise
RIM = 0.25  # of a lamp's light: the least of a pixel that it covers in part
SPARSE = 4  # pixels of which one counts for the median, both ways
BESIDE = 15  # pixels: squares over which surfaces beside a lamp are averaged
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


def light_of_lamps(light: Tensor, divisor: Tensor, hit: Tensor) -> Tensor:
    """``(B, 3, H, W)``: a guess of emission, for frames that do not tell it; 0 where there is none.

    The lens sees lamps without noise, so that neighbours on them send the same light, and far more than most surfaces;
    what the sun lights is as even, but for dots in penumbras. Not told apart, a lamp in a ceiling shines into the light
    of the ceiling around it. Lamps smaller than 3x3 pixels are not found. What a lamp reflects besides is taken to be
    like that around it.

    Args:
        light: ``(B, 3, H, W)`` linear radiance.
        divisor: as ``light``, its albedo.
        hit: ``(B, 1, H, W)`` bool.
    """
    level = luminance(light.detach())
    some = torch.where(hit, level, torch.nan)[..., ::SPARSE, ::SPARSE]
    bright = hit & (level > GLARING * some.flatten(1).nanmedian(1).values.nan_to_num()[:, None, None, None])
    lit = torch.where(bright, level, 0.0)
    most = (1 - EVEN) * _highest(lit, 3)
    core = bright & (most <= -_highest(-lit, 3))
    if not (waits(core) or bool(core.any())):
        return torch.zeros_like(light)
    beside = [(other > most).to(level) for other in windows(padded(lit, 1), 1)]
    holes = (lit < most) & (reduce(torch.add, beside) >= HOLE)
    core = _highest(torch.where(core & (_highest(holes.to(level), CLEAN) == 0), level, 0.0), 5)
    lamp = bright & (core > 0) & (level > RIM * core)
    others = (hit & ~lamp).to(light)
    plain, every = light / divisor, others.sum((2, 3), keepdim=True).clamp_min(1)
    near = pooled(others, torch.ones_like(others), BESIDE) > 0
    around = torch.where(near, pooled(plain, others, BESIDE), (plain * others).sum((2, 3), keepdim=True) / every)
    return torch.where(lamp, (light - divisor * around).clamp_min(0.0), 0.0)


def _highest(value: Tensor, size: int) -> Tensor:
    """The highest value of the square of ``size`` pixels around each, within the picture."""
    across = F.max_pool2d(value, (1, size), 1, (0, size // 2))
    return F.max_pool2d(across, (size, 1), 1, (size // 2, 0))


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
