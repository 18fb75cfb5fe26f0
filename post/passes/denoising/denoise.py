"""Denoise path-traced light: everything between one noisy sample a pixel and a clean picture, in one pass."""

from __future__ import annotations

from dataclasses import replace

import torch
from torch import Tensor

from gbufrt import Frame, GBuffer, History, TemporalPass
from gbufrt.demands.pictures import check_pictures, check_sizes
from gbufrt.history import check_history
from gbufrt.names import single
from gbufrt.numeric import check_kind
from post.filters.around import alike, most_beside
from post.filters.surfaces import surface
from post.history.antilag import grain_of, shared_at_first, tolerated, trusted
from post.history.fireflies import given_back
from post.history.inverse_variance import certain_mean
from post.history.reproject import history_for
from post.mirrors.glossy import contrasting, frames_lasting, glossy_metals
from post.mirrors.image import METAL, tight_metals
from post.passes.denoising.atrous import atrous
from post.passes.denoising.lamps import light_of_lamps
from post.passes.denoising.shadows import into_shadow, often_dark
from post.passes.denoising.shown import completed, in_mirrors, reflectance_of, visible_layer
from post.passes.denoising.temporal import temporal
from post.passes.denoising.turning import frames_lit

MIRRORS = 0.1  # specular albedo above which the reflected image is back-projected
TOLERANCE = 10.0  # share by which wavelets are told more variance than there is: their fits keep gradients
GROWTH = 1.6  # of the wavelets' tolerance from kernel to kernel
PHI_NORMAL = 16.0  # of the cosine between normals: more leaves curved surfaces without neighbours, less blurs metals
NOISELESS = 1e-12  # variance, square radiance: below it filters tell nothing of what they leave
FACING = "facing"  # in the history: normals of mirrors, by which those that turn are told
ALONE = 2  # pixels, itself and one more: the most of 3x3 that show a surface that cannot be filtered
LINE, AMONG = 3, 5  # pixels of 3x3: a body one pixel wide is alone still, and from AMONG on has neighbours enough


def denoise(
    light: Tensor,
    gbuffer: GBuffer,
    history: History | None = None,
    *,
    behind: GBuffer | None = None,
    blend: float = 0.97,
    clamp: float = 1.5,
    firefly: float = 2.5,
    motion_response: float = 0.0,
    iterations: int = 4,
    phi_color: float = 0.25,
    specular: bool = True,
) -> tuple[Tensor, History]:
    """Turn light with one sample a pixel into a clean picture.

    Emission, or where it is not told what lamps seem to send, is set aside and reflectance, that of dielectric
    surfaces included, divided out; the rest is accumulated over time with a sharp history, filtered by wavelets that
    fit planes to it as its variance requires, averaged with neighbours that keep less noise, and recombined. Pixels
    next to alone on their surface lean on like surfaces around; bodies thinner than a pixel, which show another side
    each frame, keep a short history of what lies as deep. Highlights do not take the texture of what they lie on, so
    pixels that owe unlike shares of their reflectance to a highlight are not averaged.
    Where a surface transmits, what lies ``behind`` is the guide: it gives edges and albedo, and history follows it or
    the reflected image, whichever agrees better. In smooth metals, and in water and polished surfaces that reflect most
    of their light, the guide is what they reflect, as far as it is on screen.

    Args:
        light: ``(B, 3, H, W)`` outgoing linear radiance of all light, emission included or not.
        gbuffer: of this frame; ``albedo``, ``roughness``, ``metallic``, ``emission`` and ``motion`` are used where
            present.
        history: what this function returned for the frame before; None at first.
        behind: of what lies straight behind the first transmissive surface.
        blend: largest share of history, see `temporal`.
        clamp: see `temporal`; 0 for a world whose light never changes.
        firefly: standard deviations above history, or above the surface around, at which a sample is cut; what is cut
            brightens all that lies around, if little.
        motion_response: see `temporal`.
        iterations: see `atrous`.
        phi_color: see `atrous`, for the first kernel and little noise; it grows with the noise's share of the light.
        specular: the light holds what dielectrics reflect by their surface, not the diffuse share alone.

    Returns:
        The light ``(B, 3, H, W)``, pixels that hit nothing as they were, and the history for the next frame.

    Raises:
        TypeError: light is no tensor, or of another kind of floats than the G-buffer.
        ValueError: light is not ``(B, 3, H, W)``, or as for `temporal` and `atrous`.

    Source: Schied et al. 2017 (SVGF); Zhdan 2021 (ReLAX); Bitterli et al. 2016 (fits); the handling of
    penumbrae and mirrors is our own.
    """
    check_history(gbuffer, history)
    check_pictures(gbuffer.camera, depth=gbuffer.depth, light=light)
    if behind is not None:
        check_kind(GBuffer, "behind", behind, "; frame.behind.gbuffer is one")
        check_sizes(gbuffer.camera, **{"behind.depth": behind.depth})
    before = None if history is None or history.gbuffer is None else history.gbuffer.camera
    faced = None if history is None else history.signals.get(FACING)
    gbuffer, behind = completed(gbuffer, before), None if behind is None else completed(behind, before)
    reflected, tight = reflectance_of(gbuffer, specular=specular), tight_metals(gbuffer)
    surfaces = visible_layer(gbuffer, behind, reflected, specular=specular)
    shown, divisor, emission, mirrors, glossy, facing = in_mirrors(
        gbuffer, surfaces, before, reflected if specular else None, faced, tight
    )
    emission = torch.minimum(emission.to(light), light)
    if gbuffer.emission is None:
        emission = emission + light_of_lamps(light - emission, divisor, shown.hit, gbuffer.albedo)
    noisy = (light - emission) / divisor
    longest = None if before is None else frames_lasting(gbuffer, before, tight, shown)
    if history is not None and history.gbuffer is not None:
        longest = _shorter(longest, frames_lit(noisy, shown, history.gbuffer), gbuffer)
    mean, history = temporal(
        noisy,
        shown,
        history,
        blend=blend,
        clamp=clamp,
        firefly=firefly,
        motion_response=motion_response,
        sharp=True,
        distance=_image_distance(gbuffer, reflected),
        excess=True,
        longest=longest,
        lenient=gbuffer.hit if mirrors is None else gbuffer.hit & ~mirrors,  # images in curved ones lie at any depth
    )
    variance, length = history.signals["variance"], history.length
    grain = grain_of(mean, variance, shown.hit)
    likely = shared_at_first(mean, variance, length, shown.hit)
    told = tolerated(likely, grain, length, shown.hit, least=TOLERANCE)
    told = told if (sharp := contrasting(gbuffer, tight)) is None else told * sharp
    smooth, left = atrous(
        mean, shown.depth, shown.normal, hit=shown.hit, camera=shown.camera, variance=told, linear=True,
        iterations=iterations, phi_color=phi_color, growth=GROWTH, phi_normal=PHI_NORMAL, unlike=glossy,
    )  # fmt: skip
    kept = torch.where(told > NOISELESS, left / told.clamp_min(NOISELESS), 1.0).clamp_max(1.0)
    geometry = surface(shown.depth, shown.normal, shown.hit, shown.camera, glossy)
    same, metals = alike(geometry), glossy_metals(gbuffer, tight)
    shiny = metals if mirrors is None else mirrors if metals is None else mirrors | metals
    metallic = None if gbuffer.metallic is None else gbuffer.metallic > METAL
    smooth = certain_mean(smooth, variance, kept, geometry, _lonely(same, shiny), metallic)
    sure = trusted(grain, length)
    sure = sure if metals is None else torch.where(metals, 0.0, sure)  # dark samples there are of a lobe's width
    smooth = into_shadow(smooth, noisy, same, sure, often_dark(mean, variance, length, shown.hit, same))
    smooth = given_back(smooth, mean, history.signals["excess"], geometry, length=length)
    clean = smooth * divisor + emission
    if mirrors is not None:
        clean = _despeckled(clean, same, mirrors)
    if facing is not None:
        history = replace(history, signals={**history.signals, FACING: facing})
    return torch.where(gbuffer.hit, clean, light), history


def _shorter(longest: Tensor | None, lit: Tensor | None, g: GBuffer) -> Tensor | None:
    """The fewer frames of the two; metals show no diffuse light, whose frames ``lit`` tells."""
    if lit is None:
        return longest
    lit = lit if g.metallic is None else torch.where(g.metallic > METAL, torch.inf, lit)
    return lit if longest is None else torch.minimum(longest, lit)


def _lonely(same: Tensor, shiny: Tensor | None) -> Tensor:
    """``(B, 1, H, W)`` in [0, 1]: how far next to none of the pixels around shows the same surface.

    What metals show has its edges elsewhere, and like metals side by side may show unlike light: they do not count.
    ``same`` is `alike`.
    """
    lonely = ((AMONG - same.sum(1, keepdim=True, dtype=torch.float32)) / (AMONG - LINE)).clamp(0.0, 1.0)
    return lonely if shiny is None else torch.where(shiny, 0.0, lonely)


def _despeckled(light: Tensor, same: Tensor, mirrors: Tensor) -> Tensor:
    """Light of mirrors, within the range of that around where next to none of the pixels around shows the same surface.

    Borders of a virtual image are ragged where rays pass close to edges, and a pixel left alone there keeps its noise.
    Where mirrors curve, all they show is so small that many pixels are alone, and a mean of those around would blur it.
    ``same`` is `alike`.
    """
    alone = mirrors & (same.sum(1, keepdim=True) <= ALONE)
    most, least = (way * most_beside(torch.where(mirrors, way * light, -torch.inf)) for way in (1, -1))
    clamped = torch.maximum(torch.minimum(light, most), least)
    return torch.where(alone & most.isfinite(), clamped, light)


def _image_distance(g: GBuffer, reflected: Tensor | None) -> Tensor | None:
    """The camera's far for what clear surfaces reflect, to back-project it; zero where they reflect little."""
    if g.transmittance is None or reflected is None:
        return None
    mirrors = (g.transmittance.amax(1, keepdim=True) > 0) & (reflected > MIRRORS)
    return torch.where(g.hit & mirrors, g.camera.far, 0.0).to(g.depth)


class Denoise(TemporalPass):
    """Denoise a signal of path-traced light. See `denoise`; ``gi`` is taken to be diffuse alone, others all light.

    Uses ``frame.behind`` where present, and writes ``<signal>_history``, the number of frames in each pixel's mean.

    Args:
        signal: name of the light, such as ``gi`` or ``radiance``.
        blend: see `denoise`, as the rest.
    """

    def __init__(
        self,
        *,
        signal: str = "gi",
        blend: float = 0.97,
        clamp: float = 1.5,
        firefly: float = 2.5,
        motion_response: float = 0.0,
        iterations: int = 4,
        phi_color: float = 0.25,
    ) -> None:
        super().__init__()
        self.signal = single("signal", signal, "radiance")
        self.blend = blend
        self.clamp = clamp
        self.firefly = firefly
        self.motion_response = motion_response
        self.iterations = iterations
        self.phi_color = phi_color
        self.reads = frozenset({"depth", "normal", "hit", signal})
        self.optional = frozenset(
            {
                *("motion", "motion_z", "normal_geo", "object_id"),
                *("albedo", "roughness", "metallic", "emission", "opacity", "transmittance", "behind"),
            }
        )
        self.writes = frozenset({signal, f"{signal}_history"})

    def forward(self, frame: Frame, state: History | None = None) -> tuple[Frame, History]:
        light, state = denoise(
            frame.read(self.signal), frame.gbuffer, history_for(state, frame.cut),
            behind=None if frame.behind is None else frame.behind.gbuffer,
            blend=self.blend, clamp=self.clamp, firefly=self.firefly, motion_response=self.motion_response,
            iterations=self.iterations, phi_color=self.phi_color,
            specular=self.signal != "gi",
        )  # fmt: skip
        return frame.write(self.signal, light).write(f"{self.signal}_history", state.length), state
