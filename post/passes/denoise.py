"""Denoise path-traced light: everything between one noisy sample a pixel and a clean picture, in one pass."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt import Frame, GBuffer, History, TemporalPass
from post.filters.signals import MIN_ALBEDO
from post.filters.surfaces import surface
from post.history.antilag import into_shadow
from post.history.reproject import history_for
from post.passes.atrous import atrous
from post.passes.temporal import temporal
from post.shading.ggx import specular_albedo

CLEAR = 0.05  # transmittance above which a pixel is taken to show what lies behind the surface
MIRRORS = 0.1  # specular albedo above which the reflected image is back-projected
FAR = 1000.0  # world units: assumed distance of an unknown reflected surface, farther than most
GEOMETRY = ("depth", "normal", "normal_geo", "motion", "motion_z", "object_id")
UNSURE = 15.0  # frames: the shorter the history, the less certain its variance and the wider the blur


def denoise(
    light: Tensor,
    gbuffer: GBuffer,
    history: History | None = None,
    *,
    behind: GBuffer | None = None,
    blend: float = 0.97,
    clamp: float = 4.0,
    firefly: float = 6.0,
    motion_response: float = 0.0,
    iterations: int = 4,
    phi_color: float = 0.6,
    shadows: bool = True,
) -> tuple[Tensor, History]:
    """Turn light with one sample a pixel into a clean picture.

    Emission is set aside and albedo divided out; the rest is accumulated over time with a sharp history, filtered by
    wavelets as its variance requires, and recombined. Where a surface transmits, what lies ``behind`` is the guide: it
    gives edges and albedo, and history follows it or the reflected image, whichever agrees better.

    Args:
        light: ``(B, 3, H, W)`` outgoing linear radiance of all light, emission included or not.
        gbuffer: of this frame; ``albedo``, ``emission`` and ``motion`` are used where present.
        history: what this function returned for the frame before; None at first.
        behind: of what lies straight behind the first transmissive surface.
        blend: largest share of history, see `temporal`.
        clamp: see `temporal`; 0 for a world whose light never changes.
        firefly: see `temporal`.
        motion_response: see `temporal`.
        iterations: see `atrous`.
        phi_color: see `atrous`, for a long history; up to four times as much for a fresh one.
        shadows: keep penumbrae by this frame's own samples.

    Returns:
        The light ``(B, 3, H, W)``, pixels that hit nothing as they were, and the history for the next frame.

    Raises:
        ValueError: light is not ``(B, 3, H, W)``, or as for `temporal` and `atrous`.

    Source: Schied et al. 2017 (SVGF); Zhdan 2021 (ReLAX); the handling of penumbrae is our own.
    """
    if light.ndim != 4 or light.shape[1] != 3:
        raise ValueError(f"light must be (B,3,H,W) linear radiance, got {tuple(light.shape)}")
    shown, divisor, emission = visible_layer(gbuffer, behind)
    emission = torch.minimum(emission.to(light), light)
    noisy = (light - emission) / divisor
    mean, history = temporal(
        noisy,
        shown,
        history,
        blend=blend,
        clamp=clamp,
        firefly=firefly,
        motion_response=motion_response,
        sharp=True,
        distance=_image_distance(gbuffer),
    )
    variance = history.signals["variance"] * (1 + UNSURE / history.length.clamp_min(1.0))
    smooth, _ = atrous(
        mean, shown.depth, shown.normal, hit=shown.hit, camera=shown.camera,
        iterations=iterations, phi_color=phi_color, variance=variance,
    )  # fmt: skip
    if shadows:
        smooth = into_shadow(smooth, noisy, surface(shown.depth, shown.normal, shown.hit, shown.camera))
    return torch.where(gbuffer.hit, smooth * divisor + emission, light), history


def visible_layer(g: GBuffer, behind: GBuffer | None) -> tuple[GBuffer, Tensor, Tensor]:
    """What each pixel shows: its G-buffer, the divisor of its light, and its emission.

    Args:
        g: of the frame.
        behind: of what lies straight behind the first transmissive surface; used where that surface is clear enough.

    Returns:
        The G-buffer; ``(B, 3, H, W)`` albedo, never quite black, and 1 where nothing was hit; emission.
    """
    one, none = torch.ones_like(g.normal), torch.zeros_like(g.normal)
    albedo = one if g.albedo is None else g.albedo
    emission = none if g.emission is None else g.emission
    if behind is not None and g.transmittance is not None:
        specular = specular_albedo(g)
        own = one[:, :1] if g.opacity is None else g.opacity
        far_albedo = one if behind.albedo is None else behind.albedo
        far_emission = none if behind.emission is None else behind.emission
        through = g.transmittance * far_albedo
        clear = behind.hit & (g.transmittance.amax(1, keepdim=True) > CLEAR)
        albedo = torch.where(clear, specular + (1 - specular) * (own * albedo + through), albedo)
        emission = torch.where(clear, emission + (1 - specular) * g.transmittance * far_emission, emission)
        pairs = {name: (getattr(behind, name), getattr(g, name)) for name in GEOMETRY}
        both = {name: pair for name, pair in pairs.items() if pair[0] is not None and pair[1] is not None}
        g = g.replace(**{name: torch.where(clear, far, near) for name, (far, near) in both.items()})
    return g, torch.where(g.hit, albedo.clamp_min(MIN_ALBEDO), 1.0), emission


def _image_distance(g: GBuffer) -> Tensor | None:
    """Assumed distance of what clear surfaces reflect, to back-project it; zero where they reflect little."""
    if g.transmittance is None:
        return None
    mirrors = (g.transmittance.amax(1, keepdim=True) > 0) & (specular_albedo(g) > MIRRORS)
    return torch.where(g.hit & mirrors, FAR, 0.0).to(g.depth)


class Denoise(TemporalPass):
    """Denoise a signal of path-traced light. See `denoise`.

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
        clamp: float = 4.0,
        firefly: float = 6.0,
        motion_response: float = 0.0,
        iterations: int = 4,
        phi_color: float = 0.6,
        shadows: bool = True,
    ) -> None:
        super().__init__()
        self.signal = signal
        self.blend = blend
        self.clamp = clamp
        self.firefly = firefly
        self.motion_response = motion_response
        self.iterations = iterations
        self.phi_color = phi_color
        self.shadows = shadows
        self.reads = frozenset({"depth", "normal", "hit", signal})
        self.optional = frozenset(
            {
                *("motion", "motion_z", "normal_geo", "object_id"),
                *("albedo", "roughness", "emission", "opacity", "transmittance"),
            }
        )
        self.writes = frozenset({signal, f"{signal}_history"})

    def forward(self, frame: Frame, state: History | None = None) -> tuple[Frame, History]:
        light, state = denoise(
            frame.read(self.signal), frame.gbuffer, history_for(state, frame.cut),
            behind=None if frame.behind is None else frame.behind.gbuffer,
            blend=self.blend, clamp=self.clamp, firefly=self.firefly, motion_response=self.motion_response,
            iterations=self.iterations, phi_color=self.phi_color, shadows=self.shadows,
        )  # fmt: skip
        return frame.write(self.signal, light).write(f"{self.signal}_history", state.length), state
