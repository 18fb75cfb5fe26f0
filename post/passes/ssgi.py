"""Screen-space global illumination: one sweep finds the occluders of each pixel's sky and the light they send."""

from __future__ import annotations

from functools import partial
from typing import Any

import torch
from torch import Tensor

from gbufrt import Frame, Pass
from gbufrt.camera import Camera
from gbufrt.compute.dispatch import Form, form_of
from gbufrt.compute.fusion import fusible
from gbufrt.mending import finite, held
from gbufrt.noise.noise import blue_noise
from post.filters.upsample import upsample
from post.shading.sent_light import all_bounces, nothing_before, sent_light
from post.sweep import arcs, slices
from post.sweep.bitmask import blocked, overlap, own_solid, start
from post.sweep.chords import known_thickness, thickness_from_depth
from post.sweep.constants import ALIKE, FLATNESS, GROUPS, LEDGE
from post.sweep.layout import PaddedView, Receivers, Tap
from post.sweep.op import sweep
from post.sweep.open_sky import Sky, leaves_hit, open_share, sky_beyond
from post.sweep.sectors import cover, no_cover, share, slice_sums
from post.sweep.thickness import planar_thickness

SWEEP = ("directions", "steps", "distance", "resolution", "seed")  # tunables passed to the function unchanged


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
    index: int = 0,
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
        ValueError: directions, steps or distance are not positive, or resolution is neither 1 nor 2, or a
                kernel is requested for tensors that it does not take.

    Source: Therrien et al. 2023, "Screen Space Indirect Lighting with Visibility Bitmask".
    """
    slices.check_sweep(
        camera, directions, steps, distance, depth=depth, normal=normal, hit=hit, light=light, albedo=albedo
    )
    if resolution not in (1, 2):
        raise ValueError(f"resolution must be 1 (every pixel) or 2 (every second), got {resolution}")
    hit = torch.ones_like(depth, dtype=torch.bool) if hit is None else hit
    depth, hit, normal = held(depth, hit, normal, camera.far)
    thickness = thickness_from_depth(depth, normal, camera, hit=hit) if thickness is None else thickness
    solid = planar_thickness(camera, depth, hit, thickness)
    sent = torch.where(hit, finite(light).to(depth.dtype), 0.0)
    around = slices.scene(camera, depth, normal, hit, solid, light=sent)
    corner = (min(index // 2 % 2, camera.height - 1), min(index % 2, camera.width - 1)) if resolution == 2 else (0, 0)
    part = (..., slice(corner[0], None, resolution), slice(corner[1], None, resolution))
    at = slices.receivers(camera, depth, normal, stride=resolution, offset=corner)
    noise = blue_noise(*camera.size, index=index, dims=3, seed=seed, device=depth.device).to(depth.dtype)[part]
    sky = sky_beyond(camera, hit, normal) if distance is None else None
    radii = () if distance is None else (torch.as_tensor(distance).to(depth),)
    sizes: dict[str, Any] = {"directions": directions, "steps": steps, "parallel": camera.orthographic}
    soft = torch.is_grad_enabled() and any(t.requires_grad for t in (at.z, solid, *radii))
    lit = torch.is_grad_enabled() and not soft and light.requires_grad
    with torch.set_grad_enabled(soft):  # a gradient in the light alone uses the kernel's numbers
        form = form_of(around.picture, around.origin_x, at.x, at.nx, compiled=compiled, fuses=True)
    by_reference = form is Form.REFERENCE
    sums = _sweep(around, at, noise, radii, sky, **sizes, soft=soft) if by_reference or lit else at.z.new_empty(0)
    if not by_reference:
        asked = hit[part] | (resolution == 2)  # upsampling may read the sky where a surface has nothing else beside it
        with torch.no_grad():
            found = sweep(around, at, asked, noise, radii, sky, **sizes, gathers=True)[0]
        sums = sums + (found - sums).detach() if lit else found  # the same numbers, and the light's gradient
    visibility, bent = arcs.finish(at, camera, hit[part], sums[:8], normal[part])
    found = torch.cat([(sums[8:] / sums[0]).movedim(0, 1), visibility, bent], dim=1)
    if resolution == 2:
        found = upsample(found, depth, normal, camera, hit=hit, stride=2, offset=corner)
        bent = torch.nn.functional.normalize(found[:, 4:], dim=1)
        found = torch.cat([found[:, :4], bent], dim=1)
    gathered, visibility, bent = found.split([3, 1, 3], dim=1)
    return (
        torch.where(hit, albedo * gathered, 0.0),
        torch.where(hit, visibility, 1.0),
        torch.where(hit, bent, 0.0),
    )


def _sweep(
    around: PaddedView,
    at: Receivers,
    noise: Tensor,
    radii: tuple[Tensor, ...],
    sky: Sky | None,
    *,
    directions: int,
    steps: int,
    parallel: bool,
    soft: bool,
) -> Tensor:
    """``(11, B, h, w)``: the sums of `arcs.finish`, and the light of all slices."""
    rows = []
    for cut, band in slices.bands(at):
        sums = torch.zeros(11, *band.z.shape, dtype=at.z.dtype, device=at.z.device)
        for which in range(directions):
            random = slices.slice_noise(noise[:, cut], which, directions)
            sums = sums + _slice(around, band, *random, radii, sky, steps, parallel, soft)
        rows.append(sums)
    return torch.cat(rows, dim=2)


@fusible
def _slice(
    around: PaddedView,
    at: Receivers,
    cos_psi: Tensor,
    sin_psi: Tensor,
    jitter: Tensor,
    dither: Tensor,
    radii: tuple[Tensor, ...],
    sky: Sky | None,
    steps: int,
    parallel: bool,
    soft: bool,
) -> Tensor:
    """What one slice adds to the sums."""
    cut = slices.cut_slice(at, cos_psi, sin_psi)
    covered, own = no_cover(at.z, soft), own_solid(around, at)
    gathered = at.z.new_zeros(3, *at.z.shape)
    right, left = arcs.sides(around, at, cut)
    for side in (right, left):
        farthest = torch.minimum(side.frame, radii[0] * side.length) if radii else side.frame
        before, plane = start(at, side, own), (at.x, at.y, at.z, at.nx, at.ny, at.nz)
        for i in range(steps):
            px = slices.tap_pixels(farthest.detach(), i, jitter, steps, slices.BEYOND)
            tap = arcs.look(around, at, side, px, parallel)
            next_plane = _plane(tap, parallel)
            ledge = LEDGE * arcs.step(overlap(tap, before)) * _edge_on(next_plane, plane, at)
            (found,), before = blocked(tap, before, side, radii, soft, _flat(next_plane, plane))
            plane = next_plane
            if side is right:
                ends = left.whole + found.low, left.whole + found.high
            else:
                ends = left.whole - found.high, left.whole - found.low
            covered, fresh = cover(covered, *ends, found.near, dither)
            lit = share(fresh) * torch.maximum(_facing(plane, at), ledge)
            gathered = gathered + lit * tap.rest[:, :3].movedim(1, 0)
    openness: Tensor | float = 1.0
    if sky is not None:
        hits = leaves_hit(around, at, right), leaves_hit(around, at, left)
        openness = open_share(sky, cut, GROUPS, left.whole, hits)
    return torch.cat([slice_sums(cut, covered, openness), gathered * cut.weight])


def _plane(tap: Tap, parallel: bool) -> tuple[Tensor, ...]:
    """Point and normal of a tap in view space, six planes."""
    x, y = (tap.x, tap.y) if parallel else (tap.x * tap.z, tap.y * tap.z)
    return x, y, tap.z, *tap.rest[:, 3:].unbind(1)


def _flat(one: tuple[Tensor, ...], other: tuple[Tensor, ...]) -> Tensor:
    """1 where two points lie in each other's planes, else 0."""
    dx, dy, dz = one[0] - other[0], one[1] - other[1], one[2] - other[2]
    off = torch.maximum(
        (dx * one[3] + dy * one[4] + dz * one[5]).abs(), (dx * other[3] + dy * other[4] + dz * other[5]).abs()
    )
    alike = arcs.step(one[3] * other[3] + one[4] * other[4] + one[5] * other[5] - 0.5)
    return arcs.step(FLATNESS * (dx * dx + dy * dy + dz * dz + 1e-20).sqrt() - off) * alike


def _edge_on(plane: tuple[Tensor, ...], before: tuple[Tensor, ...], at: Receivers) -> Tensor:
    """1 where a tap and the one before are parallel to the receiver, and what joins tap and receiver faces the eye."""
    parallel = arcs.step(_cosine(plane[3:], at) - ALIKE) * arcs.step(_cosine(before[3:], at) - ALIKE)
    dx, dy, dz = at.x - plane[0], at.y - plane[1], at.z - plane[2]
    toward_eye = dx * at.vx + dy * at.vy + dz * at.vz
    off_plane = (dx * at.nx + dy * at.ny + dz * at.nz) * (at.nx * at.vx + at.ny * at.vy + at.nz * at.vz)
    return parallel * arcs.step(toward_eye - off_plane)


def _cosine(normal: tuple[Tensor, ...], at: Receivers) -> Tensor:
    return normal[0] * at.nx + normal[1] * at.ny + normal[2] * at.nz


def _facing(plane: tuple[Tensor, ...], at: Receivers) -> Tensor:
    """1 where the receiver lies above a tap's plane, else 0."""
    x, y, z, nx, ny, nz = plane
    return arcs.step((at.x - x) * nx + (at.y - y) * ny + (at.z - z) * nz)


class SSGI(Pass):
    """Diffuse light from on-screen surfaces, and the visibility of the sky. See `ssgi` and `sent_light`.

    A frame with none before it is swept once for each of ``bounces``. The rest of the series is extrapolated from the
    last two, so that a single picture is as bright as one with a history. Later frames are swept once and take further
    bounces from the frame before.
    """

    reads = frozenset({"depth", "hit", "normal", "albedo", "radiance"})
    optional = frozenset({"metallic", "emission", "ambient", "ao", "thickness", "motion", "motion_z", "object_id"})
    writes = frozenset({"gi", "sky_visibility"})

    def __init__(
        self,
        *,
        directions: int = 4,
        steps: int = 24,
        distance: float | None = None,
        thickness: float | None = None,
        bounces: int = 2,
        bounce_loss: float = 1.0,
        resolution: int = 1,
        seed: int = 0,
    ) -> None:
        super().__init__()
        self.directions, self.steps, self.distance, self.thickness = directions, steps, distance, thickness
        self.bounces, self.bounce_loss, self.resolution, self.seed = bounces, bounce_loss, resolution, seed

    def forward(self, frame: Frame) -> Frame:
        g, sweep = frame.gbuffer, {name: getattr(self, name) for name in SWEEP}
        thickness = known_thickness(g, self.thickness)
        bounces = {"bounces": self.bounces, "bounce_loss": self.bounce_loss}
        light = sent_light(frame, distance=self.distance, thickness=thickness, steps=self.steps, **bounces)
        albedo = frame.read("albedo") * (1.0 if g.metallic is None else 1 - g.metallic)
        sweep |= {"hit": g.hit, "thickness": thickness, "index": frame.index}
        gather = partial(ssgi, g.depth, g.normal, g.camera, albedo=albedo, **sweep)
        gi, sky, _ = gather(light=light)
        if self.bounces > 1 and bool((new := nothing_before(frame)).any()):
            every = all_bounces(gi, lambda found: gather(light=light + self.bounce_loss * found)[0], self.bounces)
            gi = torch.where(new, every, gi)
        return frame.replace(gi=gi, sky_visibility=sky)
