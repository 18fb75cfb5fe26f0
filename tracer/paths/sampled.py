"""Frames with light of one sample a pixel; the same samples again in a later scene; and a cache of it in the world."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from gbufrt import Frame
from gbufrt.compute.resident import sent
from gbufrt.luminance import luminance
from gbufrt.numeric import check_counts, check_kind
from tracer.cache.irradiance import IrradianceCache
from tracer.direct.lighting import ray_origins
from tracer.lights.samples import Lights
from tracer.paths.one_sample import brightest_a_stratum, one_a_stratum, sample
from tracer.scene.checks import check_frame_of
from tracer.scene.poses import known_still
from tracer.scene.scene import Scene


def sampled(scene: Scene, frame: Frame, *, before: Frame | None = None, seed: int = 0, bounces: int = 1) -> Frame:
    """A frame with its light by one sample a pixel, and what samples of the frame before bring in the scene as it is.

    Args:
        scene: as it is at the time of ``frame``; sun, sky and materials may differ from frame to frame.
        frame: with a G-buffer of the scene, as `tracer.render` gives it; ``light_samples=0`` of that will do.
        before: the frame before, with whose index and G-buffer one pixel of every 3x3 is replayed; None at first. It is
            the one whose ``diffuse`` and ``specular`` light was brightest, or, where the frame has none, each in turn.
        seed: see `sample_light`, as ``bounces``.
        bounces: see ``seed``.

    Returns:
        The frame with ``diffuse``, ``indirect``, ``specular``, ``reflection_distance`` and ``shadow``; after a frame
        before, also with ``replayed``, ``replayed_diffuse`` and ``replayed_specular``, at that frame's pixels. Where it
        has ``radiance``, that of surfaces becomes emission and diffuse light of sun and lamps by the same sample. Its
        layer behind has the same.

    Raises:
        ValueError: see `sample_light`.
    """
    check_frame_of(scene, frame, before)
    return _sampled(scene, frame, before, None, {"seed": seed, "bounces": bounces})[0]


def sampled_with_cache(
    scene: Scene,
    frame: Frame,
    cache: IrradianceCache | None = None,
    *,
    before: Frame | None = None,
    seed: int = 0,
    bounces: int = 1,
) -> tuple[Frame, IrradianceCache]:
    """As `sampled`, with light that the frames before have left in the world: ``frame, cache = ...(frame, cache)``.

    Where a path first hits a surface that the cache knows, it ends there with the light that arrives at that surface
    by any number of bounces. Paths of the pixels that the next frame replays, each of nine in turn, go on; so do those
    that meet what the cache does not know. What these and all first surfaces find goes into the cache.

    Args:
        scene: see `sampled`, as the rest.
        frame: see ``scene``.
        cache: what this function returned for the frame before; None at first. It may come from another camera.
        before: see ``scene``.
        seed: see ``scene``.
        bounces: see ``scene``; of paths that go on.

    Returns:
        The frame of `sampled`, with ``cached_diffuse``: diffuse light whose indirect part is the cache's where it
        knows the surface; and the cache for the next frame.

    Raises:
        ValueError: see `sample_light`.

    Source: Ward, Rubinstein and Clear 1988, for caches of irradiance; Binder, Fricke and Keller 2019, for hashed cells.
    """
    check_frame_of(scene, frame, before)
    check_counts(seed=seed)
    if cache is not None:
        check_kind(IrradianceCache, "cache", cache, "; this function returned the one for this frame")
    cache = IrradianceCache.empty(device=frame.gbuffer.camera.device) if cache is None else cache
    frame, samples = _sampled(scene, frame, before, cache, {"seed": seed, "bounces": bounces})
    cache = cache.update(*samples.split(3, dim=1))
    return _with_cached(scene, frame, cache), cache


def _with_cached(scene: Scene, frame: Frame, cache: IrradianceCache) -> Frame:
    g, behind = frame.gbuffer, frame.behind
    metallic = 0.0 if g.metallic is None else g.metallic
    even = (1 - metallic) * (1.0 if g.opacity is None else g.opacity)
    places, normals = (x.movedim(1, -1).reshape(-1, 3) for x in (ray_origins(scene, g), g.normal))
    light, known = cache.look_up(places, normals)
    light, known = (x.view(g.batch, *g.camera.size, -1).movedim(-1, 1) for x in (light, known[:, None]))
    diffuse = frame.read("diffuse")
    cached = torch.where(known & g.hit, diffuse + even * light - frame.read("indirect"), diffuse)
    return frame.replace(cached_diffuse=cached, behind=None if behind is None else _with_cached(scene, behind, cache))


def _sampled(
    scene: Scene,
    frame: Frame,
    before: Frame | None,
    cache: IrradianceCache | None,
    given: dict[str, Any],
    lights: tuple[Lights, Lights] | None = None,
) -> tuple[Frame, Tensor]:
    """See `sampled`; also the samples for a cache, see `sample`. For ``lights`` see `_lights`."""
    poses = sent(scene.poses([float(frame.time)]), frame.gbuffer.depth)
    then = poses if before is None else sent(scene.poses([float(before.time)]), poses)
    if lights is None:  # the same for both layers
        lights = _lights(scene, then, poses)
    now, again = ({**given, "lights": of} for of in lights)
    follows = None if cache is None else one_a_stratum(frame.gbuffer.hit, index=int(frame.index), seed=given["seed"])
    light, samples = sample(
        scene, frame.gbuffer, poses=poses, index=int(frame.index), cache=cache, follows=follows, **now
    )
    changes: dict[str, Tensor | Frame] = {
        "diffuse": light.diffuse,
        "indirect": light.indirect,
        "specular": light.specular,
    }
    changes |= {"reflection_distance": light.distance, "shadow": light.shadow}
    if frame.radiance is not None:
        changes["radiance"] = _of_sun_and_lamps(frame, light.direct, frame.radiance)
    if before is not None:
        chosen = _replayed(before, given["seed"], cached=cache is not None)
        moment: dict[str, Any] = {"poses": poses, "poses_then": then, "index": int(before.index)}
        found, _ = sample(scene, before.gbuffer, chosen=chosen, cache=cache, follows=chosen, **moment, **again)
        changes |= {"replayed": chosen.to(light.direct)}
        changes |= {"replayed_diffuse": found.diffuse, "replayed_specular": found.specular}
    if frame.behind is not None:
        last = None if before is None else before.behind
        changes["behind"], more = _sampled(scene, frame.behind, last, cache, given, lights)
        samples = torch.cat([samples, more])
    return frame.replace(emitters_sampled=True, **changes), samples


def _lights(scene: Scene, then: Tensor, poses: Tensor) -> tuple[Lights, Lights]:
    """The lights now; and those of the frame before, where they are now.

    Where a lamp moves, the chances of all lamps change. Samples taken again by other chances would bring other light
    where nothing has changed.
    """
    now = Lights.of(scene, poses[0])
    return now, now if known_still(then, poses) else Lights.of(scene, then[0]).at(scene, poses[0])


def _of_sun_and_lamps(frame: Frame, direct: Tensor, radiance: Tensor) -> Tensor:
    """``(B, 3, H, W)`` emission and ``direct`` light of surfaces, and the ``radiance`` of the sky elsewhere."""
    g, shown = frame.gbuffer, frame.read("albedo") * direct
    return torch.where(g.hit, shown if g.emission is None else shown + g.emission, radiance)


def _replayed(before: Frame, seed: int, *, cached: bool) -> Tensor:
    """``(B, 1, H, W)`` bool, the pixels of the frame before that are replayed: those whose paths did not read a cache,
    or else the brightest."""
    hit, diffuse, specular = before.gbuffer.hit, before.diffuse, before.specular
    if cached or diffuse is None or specular is None:
        return one_a_stratum(hit, index=int(before.index), seed=seed)
    return brightest_a_stratum(hit, luminance(diffuse * before.read("albedo") + specular))
