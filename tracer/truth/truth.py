"""Ray-traced truth: what screen-space passes should have found."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt import GBuffer
from gbufrt.directions import length
from gbufrt.numeric import check_counts, check_numbers
from gbufrt.specular import LAMP_ROUGHNESS
from tracer.lens import focus_distance
from tracer.paths.integrators import OCCLUSION_DIMS, REFLECTION_DIMS, indirect_dims
from tracer.paths.one_sample import SampledLight, light_sums, sampled_light
from tracer.paths.op import indirect, occlusion, reflected
from tracer.paths.receivers import Receivers, at_each_pixel, receivers_of
from tracer.sampling.progressive import Progress, Truth, Values
from tracer.sampling.sequence import Sequence
from tracer.scene.checks import check_shown
from tracer.scene.scene import Scene
from tracer.truth.path_tracer import path_trace

__all__ = [
    "Truth",
    "ambient_occlusion",
    "focus_distance",
    "indirect_diffuse",
    "light_truth",
    "path_trace",
    "reflection",
]


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
    """Cosine-weighted openness of each pixel's hemisphere within a radius, and its mean open direction.

    Transmissive materials occlude by the share of light that they stop. See `Truth` and
    `tracer.sampling.progressive.converge`.

    Args:
        scene: what is there.
        gbuffer: what the cameras show of it.
        poses: ``(B, I, 4, 4)`` or ``(I, 4, 4)`` of the instances; may be left out where there are none.
        radius: how far away surfaces still occlude, world units; may be inf.
        samples: at most so many rays a pixel.
        noise: stop once the mean standard error of ``ao`` is not above this; 0 takes all samples.
        seed: another seed, another noise.
        progress: called with samples done and their number.

    Returns:
        A `Truth`, read by name: ``["ao"]`` ``(B, 1, H, W)``, 1 open and where nothing was hit; ``["bent_normal"]``
        ``(B, 3, H, W)``, the mean open direction, world space, unit length, the normal where nothing is open, 0 where
        nothing was hit; and ``["ao_onscreen"]`` ``(B, 1, H, W)``, what ao would be with on-screen occluders alone.

    Raises:
        ValueError: radius or samples are not positive, or the poses do not fit.
    """
    check_numbers(radius=radius)
    if not radius > 0:
        raise ValueError(f"radius must be positive, in world units, got {radius}")

    def sums(at: Receivers, sequence: Sequence) -> Values:
        return occlusion(scene, at, sequence, radius)

    receivers = receivers_of(scene, gbuffer, poses)
    dims = OCCLUSION_DIMS
    found = at_each_pixel(
        gbuffer, receivers, sums, dims=dims, samples=samples, noise=noise, seed=seed, progress=progress
    )
    bent, normal = found["bent_normal"], gbuffer.normal
    size = length(bent)
    bent = torch.where(size > 1e-6, bent / size.clamp_min(1e-6), normal)
    error = {**found.error, "bent_normal": found.error["bent_normal"] / size.clamp_min(1e-3)}
    values = {
        "ao": torch.where(gbuffer.hit, found["ao"], 1.0),
        "bent_normal": torch.where(gbuffer.hit, bent, 0.0),
        "ao_onscreen": torch.where(gbuffer.hit, found["ao_onscreen"], 1.0),
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
    """Light from other surfaces and from the sky that each pixel's surface reflects diffusely.

    Surfaces send their diffuse reflection of sun, lamps and sky, shadows included: what `post.ssgi` gathers,
    ``radiance - emission + ambient x sky visibility``. Emission itself is not gathered, as lamps are sampled as direct
    light. Paths go straight through transmissive surfaces.

    Args:
        scene: what is there, and its lights.
        gbuffer: what the cameras show of it, with albedo.
        poses: as for `ambient_occlusion`.
        bounces: surfaces between the pixel's and a light: 1 for one bounce.
        samples: at most so many paths a pixel.
        noise: stop once the mean standard error of ``gi`` is not above this; 0 takes all samples.
        seed: as for `ambient_occlusion`.
        progress: as for `ambient_occlusion`.

    Returns:
        A `Truth`, read by name: ``["gi"]`` ``(B, 3, H, W)``, outgoing linear radiance with albedo in it;
        ``["gi_onscreen"]``, its part from on-screen surfaces; ``["sky"]`` ``(B, 3, H, W)``, the sky's light after
        occlusion, likewise outgoing, without the sun's disc; and ``["sky_visibility"]`` ``(B, 1, H, W)``, the
        cosine-weighted share of the hemisphere that is sky, 1 where nothing was hit.

    Raises:
        ValueError: bounces or samples are below 1, there is no albedo, or the poses do not fit.
    """
    check_counts(bounces=bounces)
    if bounces < 1:
        raise ValueError(f"bounces must be at least 1, got {bounces}")
    receivers = receivers_of(scene, gbuffer, poses)

    def sums(at: Receivers, sequence: Sequence) -> Values:
        return indirect(scene, at, at.vertices, sequence, bounces)

    found = at_each_pixel(
        gbuffer,
        receivers,
        sums,
        dims=indirect_dims(bounces),
        samples=samples,
        noise=noise,
        seed=seed,
        progress=progress,
    )
    visibility = torch.where(gbuffer.hit, found["sky_visibility"], 1.0)
    return Truth(values={**found.values, "sky_visibility": visibility}, error=found.error, samples=found.samples)


def reflection(
    scene: Scene,
    gbuffer: GBuffer,
    *,
    poses: Tensor | None = None,
    samples: int = 64,
    noise: float = 0.0,
    seed: int = 0,
    progress: Progress | None = None,
) -> Truth:
    """Specular reflection of each pixel's surface, by GGX with Fresnel.

    Reflected surfaces show their emission and their diffuse reflection of sun, lamps and sky, shadows included: what
    `post.shading.sent_light.outgoing_light` holds, without further bounces. The sky is reflected without the sun's
    disc, as ``frame.environment`` holds it.

    Args:
        scene: what is there, and its lights.
        gbuffer: what the cameras show of it, with albedo, and with roughness and metallic where they differ from 1 and
            0.
        poses: as for `ambient_occlusion`.
        samples: at most so many paths a pixel.
        noise: stop once the mean standard error of ``reflection`` is not above this; 0 takes all samples.
        seed: as for `ambient_occlusion`.
        progress: as for `ambient_occlusion`.

    Returns:
        A `Truth`, read by name: ``["reflection"]`` ``(B, 3, H, W)``, linear radiance; ``["reflection_onscreen"]``, its
        part from on-screen surfaces; ``["onscreen"]`` ``(B, 1, H, W)``, the share of rays that end on such; and
        ``["distance"]`` ``(B, 1, H, W)``, the mean length of those that hit any, the camera's ``far`` where none does,
        0 where there is no surface.

    Raises:
        ValueError: samples is below 1, there is no albedo, or the poses do not fit.

    Source: Heitz 2018 (visible normals).
    """

    def sums(at: Receivers, sequence: Sequence) -> Values:
        return reflected(scene, at, at.vertices, sequence, LAMP_ROUGHNESS)

    receivers = receivers_of(scene, gbuffer, poses)
    dims = REFLECTION_DIMS
    found = at_each_pixel(
        gbuffer, receivers, sums, dims=dims, samples=samples, noise=noise, seed=seed, progress=progress
    )
    none = torch.where(gbuffer.hit, gbuffer.camera.far, 0.0)
    values, error = dict(found.values), dict(found.error)
    for name, share in (("onscreen", values.pop("flies")), ("distance", values.pop("ends"))):
        values[name], error[name] = (x[name] / share.clamp_min(1e-6) for x in (values, error))
        error.pop("flies" if name == "onscreen" else "ends")
        values[name] = torch.where(share > 0, values[name], none if name == "distance" else 0.0)
    return Truth(values=values, error=error, samples=found.samples)


def light_truth(
    scene: Scene,
    gbuffer: GBuffer,
    *,
    poses: Tensor | None = None,
    bounces: int = 1,
    samples: int = 256,
    seed: int = 0,
    progress: Progress | None = None,
) -> SampledLight:
    """Means of what `tracer.sample_light` takes one sample of.

    Args:
        scene: as for `tracer.sample_light`, as ``gbuffer`` and ``bounces``.
        gbuffer: see ``scene``.
        poses: as for `ambient_occlusion`.
        bounces: see ``scene``.
        samples: paths a pixel for each signal.
        seed: as for `ambient_occlusion`.
        progress: as for `ambient_occlusion`.

    Returns:
        See `tracer.SampledLight`; ``distance`` is the mean of rays that hit anything.

    Raises:
        ValueError: bounces or samples are below 1, there is no albedo, or the poses do not fit.
    """
    check_shown(scene, gbuffer)
    sums, dims = light_sums(scene, bounces)
    receivers = receivers_of(scene, gbuffer, poses)
    found = at_each_pixel(gbuffer, receivers, sums, dims=dims, samples=samples, noise=0.0, seed=seed, progress=progress)
    return sampled_light(found.values, gbuffer)
