"""Screen-space global illumination: one sweep finds the occluders of each pixel's sky and the light they send."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import torch
from torch import Tensor

from gbufrt import Frame, Pass
from gbufrt.camera import Camera
from gbufrt.compute.resident import number
from gbufrt.mending import finite, held
from gbufrt.noise.noise import blue_noise
from gbufrt.numeric import check_counts, check_kind, check_numbers
from post.filters.surfaces import surface
from post.margin.op import scene
from post.passes.light.fresh import by_history, times
from post.shading.sent_light import all_bounces, nothing_before, sent_light, starts
from post.sweep import slices
from post.sweep.chords import known_thickness, thickness_from_depth
from post.sweep.layout import Receiving
from post.sweep.op import sweep
from post.sweep.open_sky import sky_beyond
from post.sweep.thickness import planar_thickness
from post.upsampling.op import upsample

SWEEP = ("steps", "distance", "resolution", "seed")  # tunables passed to the function unchanged


def ssgi(
    depth: Tensor,
    normal: Tensor,
    camera: Camera,
    light: Tensor,
    albedo: Tensor,
    *,
    hit: Tensor | None = None,
    thickness: Tensor | float | None = None,
    directions: int = 4,
    steps: int = 24,
    distance: float | Tensor | None = None,
    resolution: int = 1,
    index: int | Tensor = 0,
    seed: int = 0,
    compiled: bool | None = None,
) -> tuple[Tensor, Tensor, Tensor]:
    """One bounce of light between on-screen surfaces, and the sky visible past them.

    Each tap covers the sectors from its front to its back, as in `post.bitmask_ao`. The sectors that it is the first to
    cover receive the light it sends, if it faces the receiver. Where stairs are so fine that no pixel shows a tread,
    the tread sends about what its riser does. Sectors left open count as sky, as far as `post.sweep.open_sky` allows
    for directions that leave the picture. So open sky and gathered light share every hemisphere, and no direction
    counts twice.

    Differentiable in all tensors. Gradients in depth, normal, thickness and distance need fractional coverage of
    sectors in place of dithered edges: with them, the result is less noisy and on average the same. Gradients in light
    and albedo alone do not change the result.

    Args:
        depth: ``(B, 1, H, W)`` planar view z, world units.
        normal: ``(B, 3, H, W)`` world space, unit length.
        camera: of the picture.
        light: ``(B, 3, H, W)`` outgoing linear radiance that each pixel sends to others.
        albedo: ``(B, 3, H, W)`` diffuse albedo of receivers.
        hit: ``(B, 1, H, W)`` bool; by default every pixel.
        thickness: ``(B, 1, H, W)`` measured along the view ray, world units; or one assumed for everything; by default
            guessed, see `post.thickness_from_depth`. Taps that lie in one plane are one body whatever the thickness.
        directions: slices, each through the pixel to both sides.
        steps: taps on each side of a slice.
        distance: how far light is gathered, world units, a 0-dim tensor to get its gradient; None for the whole
            picture.
        resolution: 1, or 2 to sweep every second pixel in both directions and upsample the result along surfaces.
        index: frame number, for the noise.
        seed: another seed, another noise.
        compiled: whether to use the kernel; by default as `post.bitmask_ao` does.

    Returns:
        gi ``(B, 3, H, W)``, outgoing linear radiance with albedo included; sky_visibility ``(B, 1, H, W)``, 1 open
        (also where nothing was hit); bent_normal ``(B, 3, H, W)``, world space, unit length, 0 where nothing was hit.

    Raises:
        ValueError: directions, steps or distance are not positive, thickness is negative, resolution is neither 1 nor
            2, or is 2 where index is a tensor, or a kernel is requested for tensors that it does not take.

    Source: Therrien et al. 2023, "Screen Space Indirect Lighting with Visibility Bitmask".
    """
    check_kind(Tensor, "albedo", albedo)
    given = {"depth": depth, "normal": normal, "hit": hit, "light": light, "albedo": albedo, "thickness": thickness}
    check_numbers(distance=1.0 if distance is None else distance)
    slices.check_sweep(camera, directions, steps, distance, **given)
    check_counts(resolution=resolution, index=index)
    if resolution not in (1, 2):
        raise ValueError(f"resolution must be 1 (every pixel) or 2 (every second), got {resolution}")
    hit = torch.ones_like(depth, dtype=torch.bool) if hit is None else hit
    depth, hit, normal = held(depth, hit, normal, camera.far)
    thickness = thickness_from_depth(depth, normal, camera, hit=hit) if thickness is None else thickness
    solid = planar_thickness(camera, depth, hit, thickness)
    lit = finite(light).to(depth.dtype)
    around = scene(camera, depth, normal, hit, solid, light=lit, within=True, compiled=compiled)
    corner = (0, 0) if resolution == 1 else _corner(index, camera)
    pixels = Receiving(camera, depth, normal, hit, resolution, corner)
    noise = blue_noise(*camera.size, index=index, dims=3, seed=seed, device=depth.device).to(depth.dtype)
    sky = sky_beyond(camera, hit, normal) if distance is None else None
    radii = () if distance is None else (number(distance, depth),)
    soft = torch.is_grad_enabled() and any(t.requires_grad for t in (depth, solid, *radii))
    del lit, solid  # `around` holds them
    sizes: dict[str, Any] = {"directions": directions, "steps": steps, "soft": soft, "compiled": compiled}
    found = sweep(around, pixels, pixels.of(noise), radii, sky, **sizes, gathers=True)[0]
    del around, noise  # half of what a frame needs at once
    if resolution == 2:
        geometry, clear = surface(depth, normal, hit, camera), (1.0, *(0.0,) * 6)  # as the sweep's
        found = upsample(found, geometry, stride=2, offset=corner, clear=clear, compiled=compiled)
        bent = torch.nn.functional.normalize(found[:, 1:4], dim=1)
        found = torch.cat([found[:, :1], bent, found[:, 4:]], dim=1)
    visibility, bent, gathered = found.split([1, 3, 3], dim=1)
    return (albedo * gathered).masked_fill_(~hit, 0.0), visibility, bent


def _corner(index: int | Tensor, camera: Camera) -> tuple[int, int]:
    """Row and column of the first pixel of every second one, another in each of four frames."""
    if isinstance(index, Tensor):
        raise ValueError("index must be an int where resolution is 2: it chooses which pixels are computed")
    return min(index // 2 % 2, camera.height - 1), min(index % 2, camera.width - 1)


class SSGI(Pass):
    """Diffuse light from on-screen surfaces, and the visibility of the sky. See `ssgi` and `sent_light`.

    A frame with none before it is swept once for each of ``bounces``. The rest of the series is extrapolated from the
    last two, so that a single picture is as bright as one with a history; each of its sweeps takes ``fresh`` times as
    many directions. Later frames are swept once and take further bounces from the frame before.

    Args:
        fresh: factor on directions in a frame with none before it.
        directions: see `ssgi` and `sent_light`, as the rest.
    """

    reads = frozenset({"depth", "hit", "normal", "albedo", "radiance"})
    optional = frozenset(
        {"metallic", "emission", "ambient", "surface_sky", "ao", "thickness", "motion", "motion_z", "object_id"}
    )
    writes = recalls = frozenset({"gi", "sky_visibility"})

    def __init__(
        self,
        *,
        directions: int = 4,
        fresh: int = 1,
        steps: int = 24,
        distance: float | None = None,
        thickness: float | None = None,
        bounces: int = 2,
        bounce_loss: float = 1.0,
        resolution: int = 1,
        seed: int = 0,
    ) -> None:
        super().__init__()
        self.directions, self.fresh, self.steps = directions, fresh, steps
        self.distance, self.thickness = distance, thickness
        self.bounces, self.bounce_loss, self.resolution, self.seed = bounces, bounce_loss, resolution, seed

    def forward(self, frame: Frame) -> Frame:
        g, sweep = frame.gbuffer, {name: getattr(self, name) for name in SWEEP}
        sweep |= {"index": frame.index, "hit": g.hit, "thickness": known_thickness(g, thickness=self.thickness)}
        once = {"distance": self.distance, "thickness": sweep["thickness"], "steps": self.steps}
        light = sent_light(_lit_from_above(frame), **once, bounces=self.bounces, bounce_loss=self.bounce_loss)
        albedo = frame.read("albedo") * (1.0 if g.metallic is None else 1 - g.metallic)
        one = partial(ssgi, g.depth, g.normal, g.camera, albedo=albedo, **sweep)
        gather = partial(self._gathered, frame, one)
        gi, sky, _ = gather(light)
        if self.bounces > 1 and starts(frame):
            every = all_bounces(gi, lambda found: gather(light + self.bounce_loss * found)[0], self.bounces)
            gi = torch.where(nothing_before(frame), every, gi)
        return frame.replace(gi=gi, sky_visibility=sky * _open_above(frame))

    def _gathered(self, frame: Frame, sweep: Callable[..., tuple[Tensor, ...]], light: Tensor) -> tuple[Tensor, ...]:
        first = times(self.directions, self.fresh)
        return by_history(frame, lambda n: sweep(directions=n, light=light), first=first, later=self.directions)


def _open_above(frame: Frame) -> Tensor | float:
    """Openness to the sky of a surface above, see `post.passes.light.submerged.Submerged`."""
    share = frame.get("surface_sky")
    return 1.0 if share is None else share


def _lit_from_above(frame: Frame) -> Frame:
    """The frame with as much light of the sky as comes through the surface above."""
    if frame.ambient is None or frame.get("surface_sky") is None:
        return frame
    return frame.replace(ambient=frame.ambient * _open_above(frame))
