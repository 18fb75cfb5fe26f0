"""The compiled paths over many rays at a time, on CPU threads or on a GPU."""

from __future__ import annotations

from typing import Any
from weakref import WeakKeyDictionary

import torch
from numba import prange
from torch import Tensor

from gbufrt.compute.dispatch import simulated
from gbufrt.compute.each import Each
from gbufrt.compute.kernel import Kernel, array, driver, replaced, scalar, threads
from tracer.lights.samples import Lights
from tracer.paths import integrator_kernel, interaction_kernel, path_kernel
from tracer.paths.interaction import MOST_PASS, Vertices
from tracer.paths.on_screen import Picture
from tracer.paths.receivers import Receivers
from tracer.paths.tables import arrays_of, camera_of, picture_of, surfaces_of
from tracer.sampling.progressive import Values
from tracer.scene.scene import MASK_PRIMARY, Scene
from tracer.traversal.kernel import triple

_known: WeakKeyDictionary[Receivers, tuple[Any, ...]] = WeakKeyDictionary()  # paths from one picture come in many parts
ROWS = 64  # rays handed out at a time, to a helper that counts no references to what they share


@scalar
def _radiance_of(begin, end, arrays, camera, picture, rays, u, bounces, spreads, next_event, out):
    origins, directions, spans, known = rays
    tables = interaction_kernel.assembled(arrays)
    for i in range(begin, end):
        origin, direction, mask = triple(origins, i, 0), triple(directions, i, 0), MASK_PRIMARY
        t0, t1, detail = triple(spans, i, 0)
        isect = interaction_kernel.intersect(
            tables, origin, direction, u[0, i], False, mask, t0, t1, MOST_PASS, detail, spreads
        )
        light, onscreen = path_kernel.arriving(
            tables, camera, picture, isect, known[i], direction, u, i, 1, bounces, next_event, True, True
        )
        out[i, 0], out[i, 1], out[i, 2] = light
        out[i, 3], out[i, 4], out[i, 5] = onscreen


@scalar
def radiance_path(i, arrays, camera, picture, rays, u, bounces, spreads, next_event, out):
    _radiance_of(i, i + 1, arrays, camera, picture, rays, u, bounces, spreads, next_event, out)


@driver
def radiance_all(arrays, camera, picture, rays, u, bounces, spreads, next_event, lanes, out):
    count = len(rays[0])
    for lane in prange(lanes):
        for begin in range(lane * ROWS, count, lanes * ROWS):
            _radiance_of(
                begin, min(begin + ROWS, count), arrays, camera, picture, rays, u, bounces, spreads, next_event, out
            )


@scalar
def _occlusion_of(begin, end, arrays, camera, picture, surfaces, u, radius, out):
    tables = interaction_kernel.assembled(arrays)
    for i in range(begin, end):
        at = interaction_kernel.surface_of(surfaces, i % len(surfaces))
        ao, bent, known = integrator_kernel.occlusion(tables, camera, picture, at, u, i, radius)
        out[i, 0], out[i, 4] = ao, known
        out[i, 1], out[i, 2], out[i, 3] = bent


@scalar
def occlusion_path(i, arrays, camera, picture, surfaces, u, radius, out):
    _occlusion_of(i, i + 1, arrays, camera, picture, surfaces, u, radius, out)


@driver
def occlusion_all(arrays, camera, picture, surfaces, u, radius, lanes, out):
    count = len(out)
    for lane in prange(lanes):
        for begin in range(lane * ROWS, count, lanes * ROWS):
            _occlusion_of(begin, min(begin + ROWS, count), arrays, camera, picture, surfaces, u, radius, out)


@scalar
def _indirect_of(begin, end, arrays, camera, picture, surfaces, u, bounces, out):
    tables = interaction_kernel.assembled(arrays)
    for i in range(begin, end):
        at = interaction_kernel.surface_of(surfaces, i % len(surfaces))
        gi, onscreen, above, visible = integrator_kernel.indirect(tables, camera, picture, at, u, i, bounces)
        out[i, 0], out[i, 1], out[i, 2] = gi
        out[i, 3], out[i, 4], out[i, 5] = onscreen
        out[i, 6], out[i, 7], out[i, 8] = above
        out[i, 9] = visible


@scalar
def indirect_path(i, arrays, camera, picture, surfaces, u, bounces, out):
    _indirect_of(i, i + 1, arrays, camera, picture, surfaces, u, bounces, out)


@driver
def indirect_all(arrays, camera, picture, surfaces, u, bounces, lanes, out):
    count = len(out)
    for lane in prange(lanes):
        for begin in range(lane * ROWS, count, lanes * ROWS):
            _indirect_of(begin, min(begin + ROWS, count), arrays, camera, picture, surfaces, u, bounces, out)


@scalar
def _lit_of(begin, end, arrays, surfaces, u, out):
    tables = interaction_kernel.assembled(arrays)
    for i in range(begin, end):
        at = interaction_kernel.surface_of(surfaces, i % len(surfaces))
        light, out[i, 3], out[i, 4] = integrator_kernel.lit(tables, at, u, i)
        out[i, 0], out[i, 1], out[i, 2] = light


@scalar
def lit_path(i, arrays, surfaces, u, out):
    _lit_of(i, i + 1, arrays, surfaces, u, out)


@driver
def lit_all(arrays, surfaces, u, lanes, out):
    count = len(out)
    for lane in prange(lanes):
        for begin in range(lane * ROWS, count, lanes * ROWS):
            _lit_of(begin, min(begin + ROWS, count), arrays, surfaces, u, out)


@scalar
def _reflected_of(begin, end, arrays, camera, picture, surfaces, u, sharp, out):
    tables = interaction_kernel.assembled(arrays)
    for i in range(begin, end):
        at = interaction_kernel.surface_of(surfaces, i % len(surfaces))
        light, onscreen, counts = integrator_kernel.reflected(tables, camera, picture, at, u, i, sharp)
        out[i, 0], out[i, 1], out[i, 2] = light
        out[i, 3], out[i, 4], out[i, 5] = onscreen
        out[i, 6], out[i, 7], out[i, 8], out[i, 9] = counts


@scalar
def reflected_path(i, arrays, camera, picture, surfaces, u, sharp, out):
    _reflected_of(i, i + 1, arrays, camera, picture, surfaces, u, sharp, out)


@driver
def reflected_all(arrays, camera, picture, surfaces, u, sharp, lanes, out):
    count = len(out)
    for lane in prange(lanes):
        for begin in range(lane * ROWS, count, lanes * ROWS):
            _reflected_of(begin, min(begin + ROWS, count), arrays, camera, picture, surfaces, u, sharp, out)


@scalar
def _lobes_of(begin, end, arrays, camera, picture, surfaces, u, bounces, out):
    tables = interaction_kernel.assembled(arrays)
    for i in range(begin, end):
        at = interaction_kernel.surface_of(surfaces, i % len(surfaces))
        even, light, counts = integrator_kernel.lobes(tables, camera, picture, at, u, i, bounces)
        out[i, 0], out[i, 1], out[i, 2] = even
        out[i, 3], out[i, 4], out[i, 5] = light
        out[i, 6], out[i, 7], out[i, 8] = counts


@scalar
def lobes_path(i, arrays, camera, picture, surfaces, u, bounces, out):
    _lobes_of(i, i + 1, arrays, camera, picture, surfaces, u, bounces, out)


@driver
def lobes_all(arrays, camera, picture, surfaces, u, bounces, lanes, out):
    count = len(out)
    for lane in prange(lanes):
        for begin in range(lane * ROWS, count, lanes * ROWS):
            _lobes_of(begin, min(begin + ROWS, count), arrays, camera, picture, surfaces, u, bounces, out)


occlusion_each, indirect_each, lit_each = Each(occlusion_path), Each(indirect_path), Each(lit_path)
reflected_each, lobes_each, radiance_each = Each(reflected_path), Each(lobes_path), Each(radiance_path)


def radiance(
    scene: Scene,
    lights: Lights,
    origins: Tensor,
    directions: Tensor,
    u: Tensor,
    *,
    bounces: int,
    poses: Tensor,
    t_min: Tensor | float,
    t_max: Tensor | float,
    detail: Tensor | float,
    spreads: bool,
    next_event: bool,
    picture: Picture | None,
    known: Tensor | None,
) -> tuple[Tensor, Tensor]:
    """See `tracer.paths.radiance.radiance`."""
    out = u.new_empty(len(origins), 6)
    spans = [
        torch.as_tensor(x, dtype=torch.float32, device=u.device).expand(len(origins)) for x in (t_min, t_max, detail)
    ]
    begin = u.new_zeros(len(origins)) if picture is None else u.new_ones(len(origins)) if known is None else known
    rays = origins.float(), directions.float(), torch.stack(spans, dim=1), begin.float()
    sees = camera_of(picture, u.device), picture_of(picture, u.device)
    _run(
        radiance_all, radiance_each, arrays_of(scene, poses, lights), *sees, rays, u, bounces, spreads, next_event, out
    )
    return out[:, :3], out[:, 3:]


def occlusion(scene: Scene, at: Receivers, start: Vertices, u: Tensor, radius: float) -> Values:
    """See `tracer.paths.integrators.occlusion`."""
    out = u.new_empty(u.shape[1], 5)
    _run(occlusion_all, occlusion_each, *_given(scene, at, start), u, float(radius), out)
    return {"ao": out[:, :1], "bent_normal": out[:, 1:4], "ao_onscreen": out[:, 4:]}


def indirect(scene: Scene, at: Receivers, start: Vertices, u: Tensor, bounces: int) -> Values:
    """See `tracer.paths.integrators.indirect`."""
    out = u.new_empty(u.shape[1], 10)
    _run(indirect_all, indirect_each, *_given(scene, at, start), u, bounces, out)
    return {"gi": out[:, :3], "gi_onscreen": out[:, 3:6], "sky": out[:, 6:9], "sky_visibility": out[:, 9:]}


def lit(scene: Scene, at: Receivers, start: Vertices, u: Tensor) -> Values:
    """See `tracer.paths.integrators.lit`."""
    out = u.new_empty(u.shape[1], 5)
    arrays, _, _, surfaces = _given(scene, at, start)
    _run(lit_all, lit_each, arrays, surfaces, u, out)
    return {"direct": out[:, :3], "shadow": out[:, 3:]}


def reflected(scene: Scene, at: Receivers, start: Vertices, u: Tensor, sharp: float) -> Values:
    """See `tracer.paths.integrators.reflected`."""
    out = u.new_empty(u.shape[1], 10)
    _run(reflected_all, reflected_each, *_given(scene, at, start), u, float(sharp), out)
    counts = {name: out[:, 6 + k : 7 + k] for k, name in enumerate(("onscreen", "distance", "flies", "ends"))}
    return {"reflection": out[:, :3], "reflection_onscreen": out[:, 3:6], **counts}


def lobes(scene: Scene, at: Receivers, start: Vertices, u: Tensor, bounces: int) -> Values:
    """See `tracer.paths.integrators.lobes`."""
    out = u.new_empty(u.shape[1], 9)
    _run(lobes_all, lobes_each, *_given(scene, at, start), u, bounces, out)
    counts = {name: out[:, 6 + k : 7 + k] for k, name in enumerate(("distance", "flies", "ends"))}
    return {"indirect": out[:, :3], "specular": out[:, 3:6], **counts}


def _run(on_cpu: Kernel, each: Each, *given: Any) -> None:
    """Fill the last of the arguments, a path for each of its rows, on CPU threads or on a GPU."""
    *inputs, out = given
    if simulated() or out.is_cuda:
        each(len(out), *given)
    else:
        on_cpu(*replaced(inputs, array), threads(), array(out))


def _given(scene: Scene, at: Receivers, start: Vertices) -> tuple[Any, ...]:
    if at not in _known:
        device = at.poses.device
        sees = camera_of(at.picture, device), picture_of(at.picture, device)
        _known[at] = arrays_of(scene, at.poses, at.lights), *sees
    return *_known[at], surfaces_of(start)
