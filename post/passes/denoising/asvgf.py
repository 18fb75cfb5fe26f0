"""A-SVGF: samples that are taken again say how much of its history the light of a pixel has outlived."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import torch
from torch import Tensor

from gbufrt import Frame, GBuffer, History, TemporalPass
from gbufrt.demands.pictures import check_alike, check_pictures
from gbufrt.history import check_history
from gbufrt.luminance import luminance
from gbufrt.mending import finite
from gbufrt.names import single
from gbufrt.specular import VIRTUAL_ROUGHNESS
from post.filters.around import pooled
from post.filters.surfaces import surface
from post.history.antilag import grain_of, tolerated
from post.history.fireflies import given_back
from post.history.read import read_history
from post.history.reproject import history_for
from post.history.virtual import image_kept
from post.passes.denoising.atrous import atrous, reach_of
from post.passes.denoising.temporal import temporal
from post.upsampling.gradient import forgetting, temporal_gradient

CHROMA_PHI = 4.0  # standard deviations of the noise left in luminance at which a tap of chroma counts 1/e
FADING = 0.75  # share that a cache keeps in a frame of what it had in the one before
SHARED, NEAR = 5, 3  # pixels: squares whose pixels share their noise relative to the light, and whose light it is of
UNSURE = 60.0  # see `tolerated`: single samples of one kind of light vary more than all light together


class Lobe(NamedTuple):
    """What suits one kind of light; see `asvgf`."""

    blend: float
    firefly: float
    iterations: int
    phi_normal: float
    wide: int
    """Wavelets over which cut light is given back."""


DIFFUSE = Lobe(blend=0.95, firefly=4.0, iterations=7, phi_normal=128.0, wide=5)
# Replayed samples do not tell how images in mirrors move, what is cut there belongs to a narrower area, and normals 3
# degrees apart mirror different things.
SPECULAR = Lobe(blend=0.9, firefly=6.0, iterations=3, phi_normal=2048.0, wide=3)


def asvgf(
    light: Tensor,
    gbuffer: GBuffer,
    history: History | None = None,
    *,
    replayed: Tensor | None = None,
    chosen: Tensor | None = None,
    distance: Tensor | None = None,
    cached: Tensor | None = None,
    blend: float = DIFFUSE.blend,
    firefly: float = DIFFUSE.firefly,
    iterations: int = DIFFUSE.iterations,
    phi_color: float = 0.5,
) -> tuple[Tensor, History]:
    """Denoise light whose history follows changes of the scene, told by samples of the frame before taken again.

    The mean of N frames gives way to this frame with the weight lerp(1 / N, 1, 1 - (1 - g)^2), where g is the
    `temporal_gradient`. Weighted by g alone, a history ten times as bright as what is left of the light would still be
    half of the mean. Luminance is filtered by wavelets as its variance requires; chroma as the filtered luminance and
    what is left of that variance allow. What is cut of samples is given back to the surface around them.

    Args:
        light: ``(B, 3, H, W)`` of this frame, linear radiance, without albedo.
        gbuffer: of this frame.
        history: what this function returned for the frame before; None at first.
        replayed: ``(B, 3, H, W)`` light that the frame before's samples bring now, at its pixels; without it nothing
            is taken to change, as in plain SVGF.
        chosen: ``(B, 1, H, W)``, above 0 where ``replayed`` holds a sample: at most one pixel of each 3x3 square.
        distance: ``(B, 1, H, W)`` world units to the reflected hit, for specular light: it is also back-projected as
            its virtual image, roughness keeps mirrors sharp, and their history gives way where normals turn.
        cached: ``(B, 3, H, W)`` as ``light``, with less noise, of surfaces that a cache in the world knows: what pixels
            show at first that have no history. Its share falls by `FADING` a frame.
        blend: largest share of history, see `temporal`.
        firefly: see `temporal` and `post.history.fireflies.cut_outliers`.
        iterations: see `atrous`, for luminance; colour takes half as many.
        phi_color: see `atrous`, for luminance.

    Returns:
        The light ``(B, 3, H, W)``, pixels that hit nothing as they were, and the history for the next frame.

    Raises:
        TypeError: what must be a tensor is none, or kinds of floats are mixed.
        ValueError: a picture has another shape, or as for `temporal` and `atrous`.

    Source: Schied, Peters and Dachsbacher 2018 (A-SVGF); Schied et al. 2017 (SVGF).
    """
    check_history(gbuffer, history, "sample")
    check_pictures(gbuffer.camera, depth=gbuffer.depth, light=light)
    check_alike("light", light=light, replayed=replayed, chosen=chosen, distance=distance, cached=cached)
    light = finite(light)
    if history is not None and history.gbuffer is not None and replayed is not None and chosen is not None:
        gradient = temporal_gradient(history.signals["sample"], finite(replayed), chosen, history.gbuffer)
        history = forgetting(history, 1 - (1 - gradient).square())
    sample, new = light, None
    if cached is not None:
        new = _new(gbuffer, history)
        light = torch.lerp(light, finite(cached), new)
    roughness = longest = None
    if distance is not None:
        roughness = gbuffer.roughness
        if history is not None and history.gbuffer is not None:
            longest = 1 / (1 - blend * image_kept(gbuffer, history.gbuffer)).clamp_min(1e-9)
    mean, history = temporal(
        light, gbuffer, history,
        blend=blend, clamp=0.0, firefly=firefly, motion_response=0.0, sharp=True, distance=distance,
        longest=longest, excess=True, rare=distance is not None,
    )  # fmt: skip
    variance = _shared(history.signals["variance"], luminance(mean), gbuffer.hit)
    grain = grain_of(mean, variance, gbuffer.hit)
    variance = tolerated(variance, grain, history.length, gbuffer.hit, unsure=UNSURE)
    lobe = DIFFUSE if distance is None else SPECULAR
    smooth = _filtered(mean, gbuffer, variance, iterations, phi_color, lobe.phi_normal, roughness)
    geometry = surface(gbuffer.depth, gbuffer.normal, gbuffer.hit, gbuffer.camera, roughness)
    reach = reach_of(roughness, None)
    smooth = given_back(smooth, mean, history.signals["excess"], geometry, wide=lobe.wide, reach=reach)
    kept = {"sample": sample} if new is None else {"sample": sample, "new": new}
    history = replace(history, signals={**history.signals, **kept})
    return torch.where(gbuffer.hit, smooth, light), history


def _new(gbuffer: GBuffer, history: History | None) -> Tensor:
    """``(B, 1, H, W)`` how new a surface is in the picture: 1 at first, less by `FADING` a frame, and 0 in a history
    that began without a cache. Changes of its light do not make it new, since the cache learns of them later."""
    if history is None or history.gbuffer is None:
        return torch.ones_like(gbuffer.depth)
    before = history.signals.get("new", torch.zeros_like(history.length))
    found = read_history(gbuffer, history.gbuffer, before, length=history.length)
    return torch.where(found.valid, FADING * found.image, 1.0)


def _shared(variance: Tensor, light: Tensor, hit: Tensor) -> Tensor:
    """Variance of the mean, nowhere below what the pixels around have in relation to their light.

    That of a few frames is small where none of them met a rare bright path. Wavelets would trust such pixels, and leave
    them out where they average one that did meet it: dark dots, and rings round bright ones.
    """
    count = hit.to(light.dtype)
    noise, square = pooled(torch.cat([variance, light * light], dim=1), count, SHARED).split(1, dim=1)
    return torch.maximum(variance, noise / square.clamp_min(1e-8) * pooled(light, count, NEAR).square())


def _filtered(
    mean: Tensor,
    g: GBuffer,
    variance: Tensor,
    iterations: int,
    phi_color: float,
    phi_normal: float,
    roughness: Tensor | None,
) -> Tensor:
    """Luminance by itself; and its colour, that of light which is averaged farther.

    What is averaged is light of all three channels, and not how far they differ: that of lamps would colour their
    surroundings more than light as dark as those can be. So averaged, colour has little noise, and needs half of the
    wavelets.
    """
    light, left = atrous(
        luminance(mean), g.depth, g.normal, hit=g.hit, camera=g.camera,
        iterations=iterations, phi_color=phi_color, phi_normal=phi_normal, variance=variance, roughness=roughness,
    )  # fmt: skip
    wide, _ = atrous(
        torch.cat([light, mean], dim=1), g.depth, g.normal, hit=g.hit, camera=g.camera,
        iterations=(iterations + 1) // 2, phi_color=CHROMA_PHI, phi_normal=phi_normal, variance=left,
        roughness=roughness, lead=1,
    )  # fmt: skip
    color = wide[:, 1:].clamp_min(0.0)
    return color * (light / luminance(color).clamp_min(1e-12))


class ASVGF(TemporalPass):
    """Denoise diffuse or specular light of one sample a pixel, as `tracer.sampled` gives it. See `asvgf`.

    Uses ``replayed`` and ``replayed_<signal>`` where present, for diffuse light ``cached_diffuse`` too, and writes
    ``<signal>_history``, the number of frames in each pixel's mean. Every signal has samples and a history of its own.

    Args:
        signal: ``diffuse``, ``specular``, or another light of which the frame has a ``replayed_`` one.
        gradients: follow changes of light; False is plain SVGF.
        blend: see `asvgf`, as the rest; by default 0.9 for ``specular``, else 0.95.
        firefly: see `asvgf`; by default 6 for ``specular``, else 4.
        iterations: see `asvgf`; by default 3 for ``specular``, else 7.
    """

    def __init__(
        self,
        *,
        signal: str = "diffuse",
        gradients: bool = True,
        blend: float | None = None,
        firefly: float | None = None,
        iterations: int | None = None,
        phi_color: float = 0.5,
    ) -> None:
        super().__init__()
        self.signal = single("signal", signal, "diffuse")
        self.gradients = gradients
        lobe = SPECULAR if signal == "specular" else DIFFUSE
        self.blend = lobe.blend if blend is None else blend
        self.firefly = lobe.firefly if firefly is None else firefly
        self.iterations = lobe.iterations if iterations is None else iterations
        self.phi_color = phi_color
        self.reads = frozenset({"depth", "normal", "hit", signal})
        self.optional = frozenset({"motion", "motion_z", "normal_geo", "object_id"})
        if signal == "specular":
            self.optional |= {"roughness", "reflection_distance"}
        if gradients:
            self.optional |= {"replayed", f"replayed_{signal}"}
        if signal == "diffuse":
            self.optional |= {"cached_diffuse"}
        self.writes = frozenset({signal, f"{signal}_history"})

    def forward(self, frame: Frame, state: History | None = None) -> tuple[Frame, History]:
        light, state = asvgf(
            frame.read(self.signal), frame.gbuffer, history_for(state, frame.cut),
            replayed=frame.get(f"replayed_{self.signal}") if self.gradients else None, chosen=frame.replayed,
            distance=_image_distance(frame) if self.signal == "specular" else None,
            cached=frame.cached_diffuse if self.signal == "diffuse" else None,
            blend=self.blend, firefly=self.firefly, iterations=self.iterations, phi_color=self.phi_color,
        )  # fmt: skip
        return frame.write(self.signal, light).write(f"{self.signal}_history", state.length), state


def _image_distance(frame: Frame) -> Tensor | None:
    """Distance to the reflected hit, zero where the surface is too rough to hold an image."""
    distance, roughness = frame.reflection_distance, frame.gbuffer.roughness
    if distance is None:
        return None
    return distance if roughness is None else torch.where(roughness <= VIRTUAL_ROUGHNESS, distance, 0.0)
