"""Fog: noisy light of a march, made smooth over time and space, and brought to full size where it is not."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt import Frame, GBuffer, History, TemporalPass
from gbufrt.channels import check_one_kind, check_picture
from gbufrt.demands.pictures import check_sizes
from gbufrt.history import check_history
from gbufrt.numeric import check_counts
from gbufrt.reduction import every_nth
from post.filters.surfaces import surface
from post.history.reproject import history_for
from post.passes.denoising.atrous import atrous
from post.passes.denoising.temporal import temporal
from post.passes.light.estimate import normals_from_depth
from post.upsampling.op import upsample

STRIDE = 2  # of light that comes at every second pixel both ways
LEAST = 1e-6  # share of light that counts as fog
THIN = 1e-2  # optical depth below which a series is exact enough
PHI_NORMAL, PHI_DEPTH = 1.0, 0.1  # fog has no surfaces: edges of its depth are mild guides
SIGNALS = ("fog_light", "fog_transmittance")


def fog(
    light: Tensor,
    transmittance: Tensor,
    gbuffer: GBuffer,
    history: History | None = None,
    *,
    blend: float = 0.97,
    clamp: float = 6.0,
    iterations: int = 5,
    phi_color: float = 2.0,
) -> tuple[Tensor, History]:
    """Light that fog adds before surfaces and sky, from a noisy march.

    The march gives the mean light of the share that fog takes. That has weaker edges than depth, so its history and
    its filter mix fog of different lengths but little: the share itself is known at every pixel. Behind an arch fog may
    be lit as it is nowhere before it, so light of every second pixel is an approximation at silhouettes.
    Fog stands still and counts as if it were where its light comes from in the mean, so history follows the camera.

    Args:
        light: ``(B, 3, H, W)`` mean radiance that fog scatters; or of every second pixel from the top left one on.
        transmittance: ``(B, 1, H, W)`` share of light that it lets through.
        gbuffer: of the frame.
        history: what this function returned for the frame before; None at first.
        blend: largest share of history.
        clamp: standard deviations of noise by which fast and slow history may differ; 0 switches the test off.
        iterations: of the wavelets, each twice as wide as the one before; 0 leaves the filter out.
        phi_color: difference of luminance, in standard deviations, at which a tap of theirs counts 1/e.

    Returns:
        ``(B, 3, H, W)`` linear radiance, and the history for the next frame. No gradient passes through geometry.

    Raises:
        TypeError: what must be a tensor is none, or kinds of floats are mixed.
        ValueError: sizes do not fit each other, or see `post.temporal` and `post.atrous`.

    Source: Schied et al. 2017 (SVGF) for the order of the steps.
    """
    check_history(gbuffer, history)
    check_picture("light", light, "mean radiance that fog scatters")
    check_picture("transmittance", transmittance, "share of light that fog lets through", components=1)
    check_counts(iterations=iterations)
    check_sizes(gbuffer.camera, depth=gbuffer.depth, transmittance=transmittance)
    check_one_kind(depth=gbuffer.depth, light=light)
    height, width = gbuffer.camera.size
    size = -(-height // STRIDE), -(-width // STRIDE)
    whole = body = _body(gbuffer, transmittance.detach())
    if light.shape[-2:] == size != (height, width):
        body = every_nth(Frame(gbuffer=whole), STRIDE).gbuffer
    elif light.shape[-2:] != (height, width):
        raise ValueError(
            f"light must be (B,3,{height},{width}), or of every second pixel (B,3,{size[0]},{size[1]}), "
            f"got {tuple(light.shape)}"
        )
    if len(light) != len(gbuffer.depth):
        raise ValueError(f"light must be of {len(gbuffer.depth)} pictures like its camera, got {tuple(light.shape)}")
    mean, history = temporal(light, body, history, blend=blend, clamp=clamp)
    if iterations:
        mean, _ = atrous(
            mean, body.depth, body.normal, hit=body.hit, camera=body.camera, iterations=iterations,
            variance=history.signals["variance"], phi_color=phi_color, phi_normal=PHI_NORMAL, phi_depth=PHI_DEPTH,
        )  # fmt: skip
    if body is not whole:
        mean = upsample(mean, surface(whole.depth, whole.normal, whole.hit, whole.camera), stride=STRIDE)
    return mean * (1 - transmittance), history


def _body(g: GBuffer, transmittance: Tensor) -> GBuffer:
    """Where the light of the fog comes from in the mean, as if it were a surface that stands still."""
    depth = torch.where(g.hit, g.depth, g.camera.far).detach()
    thick = -transmittance.clamp_min(1e-6).log()
    share = torch.where(
        thick < THIN, 0.5 - thick / 12, 1 / thick.clamp_min(THIN) - 1 / torch.expm1(thick.clamp_min(THIN))
    )
    place, hit = depth * share, transmittance < 1 - LEAST
    if min(g.camera.size) < 2:
        normal = torch.where(hit, g.camera.rotate_to_world(g.camera.to_eye(g.camera.unproject(place))), 0.0)
    else:
        normal = normals_from_depth(place, g.camera, hit=hit)
    before = g.camera if g.previous_camera is None else g.previous_camera
    motion, motion_z = g.camera.static_motion(before, place, hit)
    return GBuffer(
        camera=g.camera, previous_camera=before, depth=place, hit=hit, normal=normal, motion=motion, motion_z=motion_z
    )


class Fog(TemporalPass):
    """See `fog`. ``fog_reflection`` is what the march along mirrored rays gives, interpolated along surfaces."""

    reads = frozenset({"depth", "hit", "normal", *SIGNALS})
    optional = frozenset({"fog_mirrored"})
    writes = frozenset({"fog", "fog_reflection"})

    def __init__(self, *, blend: float = 0.97, clamp: float = 6.0, iterations: int = 5, phi_color: float = 2.0) -> None:
        super().__init__()
        self.blend, self.clamp, self.iterations, self.phi_color = blend, clamp, iterations, phi_color

    def forward(self, frame: Frame, state: History | None = None) -> tuple[Frame, History]:
        g, clear = frame.gbuffer, frame.read("fog_transmittance")
        light, state = fog(frame.read("fog_light"), clear, g, history_for(state, frame.cut), **self.tunables())
        frame = frame.replace(fog=light)
        if frame.fog_mirrored is not None:
            frame = frame.replace(fog_reflection=_mirrored(frame.fog_mirrored, g))
        return frame, state


def _mirrored(found: Tensor, g: GBuffer) -> Tensor:
    """``(B, 4, H, W)`` light that fog adds along mirrored rays, and its transmittance."""
    small = every_nth(Frame(gbuffer=g), STRIDE).gbuffer
    added = torch.cat([found[:, :3] * (1 - found[:, 3:]), found[:, 3:]], dim=1)
    smooth, _ = atrous(added, small.depth, small.normal, hit=small.hit, camera=small.camera, lead=3)
    one = surface(g.depth, g.normal, g.hit, g.camera)
    return upsample(smooth, one, stride=STRIDE, clear=(0.0, 0.0, 0.0, 1.0))
