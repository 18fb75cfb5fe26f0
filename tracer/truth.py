"""Ray-traced truth: what screen-space passes should have found."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from gbufrt import GBuffer
from tracer.light_samples import DIMS, Lights
from tracer.paths import Vertices, direct, meet
from tracer.progressive import Progress, Truth, Values
from tracer.receivers import Receivers, at_each_pixel, receivers_of
from tracer.scatter import cosine_direction, dot
from tracer.scene import MASK_SECONDARY, Scene
from tracer.sky import sky_radiance
from tracer.traversal import transmission


def ambient_occlusion(
    scene: Scene,
    gbuffer: GBuffer,
    *,
    poses: Tensor | None = None,
    radius: float = 2.0,
    samples: int = 256,
    noise: float = 0.0,
    seed: int = 0,
    progress: Progress | None = None,
) -> Truth:
    """How open each pixel's hemisphere is within a radius, weighted by the cosine, and in which direction.

    Transmissive things block the share of light that they stop. See `Truth` and `tracer.progressive.converge`.

    Args:
        scene: what is there.
        gbuffer: what the cameras see of it.
        poses: ``(B, I, 4, 4)`` or ``(I, 4, 4)`` of the instances; may be left out where there are none.
        radius: how far away things still block, world units; may be inf.
        samples: at most so many rays a pixel.
        noise: stop once the mean standard error of ``ao`` is not above this; 0 takes all samples.
        seed: another seed, another noise.
        progress: called with samples done and their number.

    Returns:
        ``ao`` ``(B, 1, H, W)``, 1 open and where nothing was hit; ``bent_normal`` ``(B, 3, H, W)``, the mean open
        direction, world space, unit length, the normal where nothing is open, 0 where nothing was hit; and ``ao_seen``
        ``(B, 1, H, W)``, what ao would be if only those rays were blocked whose end the camera sees.

    Raises:
        ValueError: radius or samples are not positive, or the poses do not fit.
    """
    if not radius > 0:
        raise ValueError(f"radius must be positive, in world units, got {radius}")

    def shoot(at: Receivers, start: Vertices, u: Tensor) -> Values:
        directions = cosine_direction(start.normals, u[:2])
        given = {"poses": at.poses, "t_max": radius, "inside": start.inside, "most": 1.0}
        met = meet(scene, start.points, directions, u[2], **given)
        open_ = (~met.hit).to(directions)[:, None]
        known = torch.ones_like(open_)
        known[met.rows, 0] = 1 - at.picture.sees(met.surface.points, met.surface.normals).to(known)
        return {"ao": open_, "bent_normal": directions * open_, "ao_seen": known}

    receivers = receivers_of(scene, gbuffer, poses)
    found = at_each_pixel(gbuffer, receivers, shoot, dims=3, samples=samples, noise=noise, seed=seed, progress=progress)
    bent, normal = found["bent_normal"], gbuffer.normal
    length = bent.norm(dim=1, keepdim=True)
    bent = torch.where(length > 1e-6, bent / length.clamp_min(1e-6), normal)
    error = {**found.error, "bent_normal": found.error["bent_normal"] / length.clamp_min(1e-3)}
    values = {
        "ao": torch.where(gbuffer.hit, found["ao"], 1.0),
        "bent_normal": torch.where(gbuffer.hit, bent, 0.0),
        "ao_seen": torch.where(gbuffer.hit, found["ao_seen"], 1.0),
    }
    return Truth(values=values, error=error, samples=found.samples)


def indirect_diffuse(
    scene: Scene,
    gbuffer: GBuffer,
    *,
    poses: Tensor | None = None,
    bounces: int = 1,
    samples: int = 256,
    noise: float = 0.0,
    seed: int = 0,
    progress: Progress | None = None,
) -> Truth:
    """Light that reaches each pixel's surface from other surfaces, and from the sky, and is scattered evenly there.

    Surfaces send what they scatter evenly of the light of sun, lamps and sky, shadows included: what `post.ssgi`
    gathers, ``radiance - emission + ambient x sky visibility``. Emission itself is not gathered, for lamps are sampled
    as direct light. Light is followed straight through transmissive surfaces.

    Args:
        scene: what is there, and its lights.
        gbuffer: what the cameras see of it, with albedo.
        poses: as for `ambient_occlusion`.
        bounces: surfaces between the pixel's and a light: 1 for one bounce.
        samples: at most so many paths a pixel.
        noise: stop once the mean standard error of ``gi`` is not above this; 0 takes all samples.
        seed: as for `ambient_occlusion`.
        progress: as for `ambient_occlusion`.

    Returns:
        ``gi`` ``(B, 3, H, W)``, outgoing linear radiance with albedo in it; ``gi_seen``, its part from surfaces the
        camera sees; ``sky`` ``(B, 3, H, W)``, the sky's light that really arrives, likewise outgoing, without the
        sun's disc; and ``sky_visibility`` ``(B, 1, H, W)``, the cosine-weighted share of the hemisphere that is sky, 1
        where nothing was hit.

    Raises:
        ValueError: bounces or samples are below 1, there is no albedo, or the poses do not fit.
    """
    if bounces < 1:
        raise ValueError(f"bounces must be at least 1, got {bounces}")
    receivers = receivers_of(scene, gbuffer, poses)
    lights = {id(at): Lights.of(scene, at.poses) for at in receivers}

    def shoot(at: Receivers, start: Vertices, u: Tensor) -> Values:
        directions = cosine_direction(start.normals, u[:2])
        met = meet(scene, start.points, directions, u[2], poses=at.poses, inside=start.inside)
        weight = start.diffuse * met.weight
        sent = gathered(scene, lights[id(at)], met.surface, u[3:, met.rows], bounces, at.poses)
        gi, seen, sky = (torch.zeros_like(weight) for _ in range(3))
        gi[met.rows] = weight[met.rows] * sent
        seen[met.rows] = gi[met.rows] * at.picture.sees(met.surface.points, met.surface.normals)[:, None]
        sky[~met.hit] = weight[~met.hit] * sky_radiance(scene, directions[~met.hit].T[None])[0].T
        open_ = met.weight.mean(dim=1, keepdim=True) * ~met.hit[:, None]
        return {"gi": gi, "gi_seen": seen, "sky": sky, "sky_visibility": open_}

    found = at_each_pixel(
        gbuffer,
        receivers,
        shoot,
        dims=3 + (DIMS + 3) * bounces,
        samples=samples,
        noise=noise,
        seed=seed,
        progress=progress,
    )
    visibility = torch.where(gbuffer.hit, found["sky_visibility"], 1.0)
    return Truth(values={**found.values, "sky_visibility": visibility}, error=found.error, samples=found.samples)


def gathered(scene: Scene, lights: Lights, start: Vertices, u: Tensor, bounces: int, poses: Tensor) -> Tensor:
    """What surfaces send of the light of sun, lamps and sky, after at most ``bounces`` of even scattering.

    Args:
        scene: what is there.
        lights: of the scene.
        start: N surfaces.
        u: ``(8 * bounces, N)`` in [0, 1).
        bounces: 1 for what reaches the surfaces themselves.
        poses: ``(I, 4, 4)``.

    Returns:
        ``(N, 3)`` outgoing linear radiance.
    """
    total, rows, at = torch.zeros_like(start.points), torch.arange(len(start), device=u.device), start
    through = torch.ones_like(total)
    for bounce in range(bounces):
        numbers, u = u[: DIMS + 3], u[DIMS + 3 :]
        through = through * at.diffuse

        def even(directions: Tensor, at: Vertices = at) -> Tensor:
            return (dot(at.normals, directions).clamp_min(0) / math.pi)[:, None]

        total[rows] += through * direct(scene, lights, at.points, numbers[:DIMS], even, poses=poses)
        directions = cosine_direction(at.normals, numbers[DIMS : DIMS + 2])
        if bounce == bounces - 1:
            passed = transmission(scene, at.points, directions, poses=poses, mask=MASK_SECONDARY)
            total[rows] += through * passed * sky_radiance(scene, directions.T[None])[0].T
            break
        met = meet(scene, at.points, directions, numbers[DIMS + 2], poses=poses, inside=at.inside)
        through = through * met.weight
        away = ~met.hit
        total[rows[away]] += through[away] * sky_radiance(scene, directions[away].T[None])[0].T
        rows, through, u, at = rows[met.rows], through[met.rows], u[:, met.rows], met.surface
    return total
