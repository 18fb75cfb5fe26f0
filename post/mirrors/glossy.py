"""Glossy metals: how long what they show stays the same while the eye moves."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt import Camera, GBuffer
from gbufrt.compute.resident import waits
from gbufrt.directions import length
from post.history.reproject import motion_of
from post.mirrors.image import METAL, SMOOTH

LASTING = 1.0  # widths of the lobe that the eye may turn round a surface while its reflection counts as the same
FOLLOWED = 1.25  # pixels by which an image may move over a mirror that curves tightly while it counts as the same
LEAST = 2.0  # frames: a single sample is worse than a lag of one frame
SHARP, SMALL = 0.25, 0.5  # roughness below which images have strong contrasts; and where surfaces curve tightly
TRUSTED = 0.1  # least share of a variance that such contrasts leave


def glossy_metals(g: GBuffer, tight: Tensor) -> Tensor | None:
    """``(B, 1, H, W)`` bool: metals that show highlights, or images too small for a filter of pixels.

    None where the G-buffer does not tell. ``tight``: what `post.mirrors.image.tight_metals` finds.
    """
    if g.roughness is None or g.metallic is None:
        return None
    return g.hit & (g.metallic > METAL) & ((g.roughness >= SMOOTH) | tight)


def contrasting(g: GBuffer, tight: Tensor) -> Tensor | None:
    """Share of the variance, ``(B, 1, H, W)`` in [0, 1], by which wavelets are to tell contrasts from noise in metals.

    What smooth metals show has edges that the geometry does not tell. There a filter that takes contrasts for noise
    costs more than noise; the more so where a surface curves tightly, and shows all around it in a few pixels. Other
    surfaces have 1.

    None where the G-buffer does not tell. ``tight``: see `glossy_metals`.
    """
    if g.roughness is None or g.metallic is None:
        return None
    roughness = g.roughness.detach()  # it chooses a blur, which has no gradient
    broad = (roughness / torch.where(tight, SMALL, torch.full_like(roughness, SHARP))).square().clamp(TRUSTED, 1.0)
    return torch.where(g.hit & (g.metallic > METAL), broad, 1.0)


def frames_lasting(g: GBuffer, previous: Camera, tight: Tensor, image: GBuffer) -> Tensor | None:
    """How many frames a history of what metals reflect may hold, where they show too much of it to be matt.

    A highlight stays where it is on a surface as long as the eye turns round it by less than the lobe is wide. Further
    frames show light that is no longer there. Smooth metals are left to `post.mirrors.image`: their histories follow
    what they show. Where they curve tightly they can do so to the first order alone, and lamps as small as a pixel
    would become streaks.

    Args:
        g: of the frame.
        previous: camera of the frame before.
        tight: see `glossy_metals`.
        image: as ``g``, with the motion of what mirrors show.

    Returns:
        ``(B, 1, H, W)``, infinite where nothing limits it; None where nothing does, or the G-buffer does not tell.
    """
    if g.roughness is None or g.metallic is None:
        return None
    glossy, curved = g.hit & (g.metallic > METAL) & (g.roughness >= SMOOTH) & ~tight, tight & (g.roughness < SMOOTH)
    if not (waits(glossy) or bool((glossy | curved).any())):
        return None
    points = g.camera.to_world(g.points_view())
    now, was = (camera.rotate_to_world(camera.to_eye(camera.to_view(points))) for camera in (g.camera, previous))
    turned = length(now - was)  # radians, as it is small
    moved = length(motion_of(image, previous)[0] - motion_of(g, previous)[0])
    by_lobe, by_image = LASTING * g.roughness.square() / turned.clamp_min(1e-9), FOLLOWED / moved.clamp_min(1e-9)
    frames = torch.where(curved, by_image, by_lobe).clamp_min(LEAST)
    return torch.where(glossy | curved, frames, torch.inf)
