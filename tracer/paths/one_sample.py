"""The light of a picture at one sample a pixel, as separate signals."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt import GBuffer
from gbufrt.channels import check_like
from gbufrt.noise.noise import SLICES
from gbufrt.numeric import check_counts
from tracer.cache.irradiance import IrradianceCache
from tracer.direct.lighting import batched
from tracer.lights.samples import Lights
from tracer.paths.hazy import in_haze
from tracer.paths.integrators import DIRECT_DIMS, lobe_dims, specular_dims
from tracer.paths.memory import Memory
from tracer.paths.op import lit, lobes
from tracer.paths.receivers import Receivers, Sums, placed, receivers_of
from tracer.sampling.progressive import Values
from tracer.sampling.sequence import Sequence
from tracer.scene.checks import check_mask, check_shown
from tracer.scene.poses import between, known_still
from tracer.scene.scene import Scene

STRATUM = 3  # pixels: side of the squares of which one pixel is replayed


@dataclass(frozen=True, eq=False, kw_only=True)
class SampledLight:
    """Light by one sample a pixel; all of it 0 where there is no surface, or where none was asked for.

    Args:
        direct: ``(B, 3, H, W)`` diffuse light of sun and lamps, albedo divided out, linear radiance.
        indirect: ``(B, 3, H, W)`` diffuse light of other surfaces and the sky, likewise.
        specular: ``(B, 3, H, W)`` specular light, Fresnel included, linear radiance.
        distance: ``(B, 1, H, W)`` world units to what the specular ray hit, the camera's ``far`` for the sky, 0 for a
            ray into the surface itself.
        shadow: ``(B, 2, H, W)`` share of light that came along the shadow rays to the sun and to a lamp, 0 where
            there was none to come.
    """

    direct: Tensor
    indirect: Tensor
    specular: Tensor
    distance: Tensor
    shadow: Tensor

    @property
    def diffuse(self) -> Tensor:
        """``(B, 3, H, W)`` all diffuse light, albedo divided out."""
        return self.direct + self.indirect


def sample_light(
    scene: Scene,
    gbuffer: GBuffer,
    *,
    poses: Tensor | None = None,
    index: int = 0,
    seed: int = 0,
    bounces: int = 1,
    chosen: Tensor | None = None,
    poses_then: Tensor | None = None,
) -> SampledLight:
    """Light that leaves every pixel's surface toward the camera, by one path a pixel for each signal.

    One shadow ray goes to the sun and one to a lamp, and one path begins with a diffuse and one with a specular bounce;
    they go on as those of `tracer.path_trace`. Of sun and lamps, rough surfaces reflect what shadow rays bring.
    Emission of the surfaces themselves is not part of it: outgoing light is emission + albedo x diffuse + specular.
    Light that waves reflect and fog are not either; haze is before what is reflected. Of diffuse light,
    `post.Composite` takes off what a dielectric reflects.

    The numbers of a pixel depend on the pixel, ``index`` and ``seed`` alone: blue noise over the picture, an
    Owen-scrambled Sobol sequence over 128 frames. So samples can be replayed: given the G-buffer of an earlier frame
    and its index, the same paths start again from the same surfaces, moved with their instances, in the scene as it is
    now. Directions to the eye stay those of the earlier frame.

    Args:
        scene: what is there, and its lights.
        gbuffer: what the cameras show of it, with albedo, and with roughness and metallic where they differ from 1 and
            0.
        poses: ``(B, I, 4, 4)`` or ``(I, 4, 4)`` of the instances; may be left out where there are none.
        index: frame number of the G-buffer, from which the noise comes.
        seed: another seed, another noise.
        bounces: most surfaces between the first one and a light, as in `tracer.path_trace`.
        chosen: ``(B, 1, H, W)`` bool, the pixels to sample; by default all.
        poses_then: as ``poses``, when the G-buffer was made, if the instances have moved since.

    Returns:
        See `SampledLight`; the mean over many seeds is what `light_truth` returns, which has no haze.

    Raises:
        ValueError: bounces is below 1, there is no albedo, or the poses do not fit.

    Source: Schied, Peters and Dachsbacher 2018 (A-SVGF), 4.1, for replayed samples.
    """
    given: dict[str, Any] = {"poses": poses, "index": index, "seed": seed, "bounces": bounces}
    return sample(scene, gbuffer, chosen=chosen, poses_then=poses_then, **given)[0]


def sample(
    scene: Scene,
    gbuffer: GBuffer,
    *,
    poses: Tensor | None,
    index: int,
    seed: int,
    bounces: int,
    chosen: Tensor | None = None,
    poses_then: Tensor | None = None,
    cache: IrradianceCache | None = None,
    follows: Tensor | None = None,
    lights: Lights | None = None,
) -> tuple[SampledLight, Tensor]:
    """See `sample_light`; also the samples for a cache that the paths bring, ``(N, 9)``. Paths from the pixels that
    ``follows`` ``(B, 1, H, W)`` do not read it. For ``lights`` see `receivers_of`."""
    check_shown(scene, gbuffer)
    check_counts(index=index, seed=seed)
    if chosen is not None:
        check_mask("chosen", chosen, gbuffer.hit)
    size = gbuffer.camera.size
    asked = gbuffer if chosen is None else gbuffer.replace(hit=gbuffer.hit & chosen)
    receivers = receivers_of(scene, asked, poses, lights)
    if poses_then is not None:
        then = batched(poses_then, gbuffer.batch, len(scene.instances))
        receivers = [_moved(at, then[b]) for b, at in enumerate(receivers)]
    number, found, brought = index % SLICES, list[Values](), [gbuffer.normal.new_zeros(0, 9)]
    for b, at in enumerate(receivers):
        memory = None
        if cache is not None and follows is not None:
            memory = Memory(cache=cache, follows=follows[b].flatten()[at.pixels])
        sums, dims = light_sums(scene, bounces, memory)
        sequence = Sequence.of(SLICES, dims, size, seed=seed, device=gbuffer.camera.device)
        sequence = sequence.part(range(number, number + 1))
        rows = sums(at, sequence)
        if scene.haze is not None:
            u = sequence.dims(DIRECT_DIMS).dims(*specular_dims(bounces)).draw(at.pixels)
            eye = gbuffer.camera.position[b]
            rows["specular"] = in_haze(scene, at.vertices, u, rows["specular"], rows["distance"][0], eye)
        met = rows.pop("met", None)
        if met is not None:
            brought += [met[:9, met[9] > 0].T, _own_samples(at, rows["indirect"])]
        found.append(rows)
    whole = {name: torch.cat([f[name] for f in found], dim=1) for name in found[0]}
    light = sampled_light({name: placed(x, receivers, size) for name, x in whole.items()}, gbuffer)
    return light, torch.cat(brought)


def _own_samples(at: Receivers, indirect: Tensor) -> Tensor:
    """``(N, 9)`` samples for a cache at the surfaces themselves, of their ``indirect`` light ``(3, M)``."""
    even = (1 - at.vertices.metallic) * at.vertices.opacity
    rows = even > 0
    return torch.cat([at.places.T[rows], (indirect.T[rows] / even[rows, None])], dim=1)


def light_sums(scene: Scene, bounces: int, memory: Memory | None = None) -> tuple[Sums, int]:
    """One path of each kind from each surface for each point of a sequence, and how many numbers they take.

    With a ``memory`` of one picture they are for that picture and one point, and find samples, see `lobes`.

    Raises:
        ValueError: bounces is below 1.
    """
    check_counts(bounces=bounces)
    if bounces < 1:
        raise ValueError(f"bounces must be at least 1, got {bounces}")

    def sums(at: Receivers, sequence: Sequence) -> Values:
        start = at.vertices
        white = replace(start, albedo=torch.ones_like(start.albedo))
        found = lobes(scene, at, start, sequence.dims(DIRECT_DIMS), bounces, memory)
        return {**lit(scene, at, white, sequence.dims(0, DIRECT_DIMS)), **found}

    return sums, DIRECT_DIMS + lobe_dims(bounces)


def sampled_light(found: Mapping[str, Tensor], gbuffer: GBuffer) -> SampledLight:
    """Means of what `light_sums` finds as light, ``(B, C, H, W)`` each."""
    away = torch.where(found["flies"] > 0, gbuffer.camera.far, 0.0)
    mean = found["distance"] / found["ends"].clamp_min(1e-6)
    distance = torch.where(found["ends"] > 0, mean, away)
    names = ("direct", "indirect", "specular", "shadow")
    return SampledLight(distance=distance, **{name: found[name] for name in names})


def one_a_stratum(hit: Tensor, *, index: int = 0, seed: int = 0) -> Tensor:
    """One pixel of every 3x3 square, the same in all of them, if it hit anything: each is chosen once in nine frames.

    Args:
        hit: ``(B, 1, H, W)`` bool.
        index: frame number, from which the choice comes.
        seed: another seed, another choice.

    Returns:
        ``(B, 1, H, W)`` bool.
    """
    check_mask("hit", hit)
    check_counts(index=index, seed=seed)
    row, column = divmod((4 * index + seed) % STRATUM**2, STRATUM)  # neighbours in time lie apart
    height, width = hit.shape[-2:]
    chosen = torch.zeros_like(hit)
    chosen[..., min(row, height - 1) :: STRATUM, min(column, width - 1) :: STRATUM] = True
    return chosen & hit


def brightest_a_stratum(hit: Tensor, luminance: Tensor) -> Tensor:
    """The brightest pixel of every 3x3 square, if any of them hit anything.

    Light that goes out, or that mirrors show in few pixels, is in the brightest samples; others may hold none of it.

    Args:
        hit: ``(B, 1, H, W)`` bool.
        luminance: ``(B, 1, H, W)`` of the samples that are chosen from.

    Returns:
        ``(B, 1, H, W)`` bool.

    Source: Schied, Peters and Dachsbacher 2018 (A-SVGF), 4.1.
    """
    check_mask("hit", hit)
    check_like("luminance", luminance, "hit", hit, (1,))
    height, width = hit.shape[-2:]
    margin = (0, -width % STRATUM, 0, -height % STRATUM)
    bright = F.pad(torch.where(hit, luminance.clamp_min(0.0) + 1, 0.0), margin)
    squares = bright.unflatten(3, (-1, STRATUM)).unflatten(2, (-1, STRATUM)).permute(0, 1, 2, 4, 3, 5)
    flat = squares.flatten(4)
    chosen = torch.zeros_like(flat).scatter(4, flat.argmax(dim=4, keepdim=True), 1.0).view(squares.shape)
    return (chosen.permute(0, 1, 2, 4, 3, 5).reshape(bright.shape)[..., :height, :width] > 0) & hit


def _moved(at: Receivers, then: Tensor) -> Receivers:
    """Surfaces of instances that were at poses ``then`` ``(I, 4, 4)``, carried to where they are now."""
    if known_still(then, at.poses):
        return at
    forward = between(then, at.poses)[at.vertices.instances.long()]
    v = at.vertices
    turned = forward[..., :3] @ torch.stack([v.points, v.normals, v.toward], dim=-1)
    points, normals, toward = turned.unbind(dim=-1)
    moved = replace(v, points=points + forward[..., 3], normals=normals, toward=toward)
    return replace(at, places=torch.cat([moved.points, normals], dim=1).T, surfaces=lambda: moved)
