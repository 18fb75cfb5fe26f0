"""The compiled paths over many rays at a time: on CPU threads, or one in each thread of a GPU."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from weakref import WeakKeyDictionary

import numba.cuda
import numpy as np
import torch
from numba import prange
from torch import Tensor

from gbufrt.compute.dispatch import simulated
from gbufrt.compute.each import Each
from gbufrt.compute.kernel import CPU, Kernel, array, driver, replaced, scalar, specialized, threads
from tracer.lights.samples import Lights
from tracer.paths import integrator_kernel, interaction_kernel, path_kernel, waiting_kernel
from tracer.paths.batch_kernel import ROWS, Paths, draw, new_paths
from tracer.paths.integrators import MOST_DIMS
from tracer.paths.interaction import MOST_PASS
from tracer.paths.memory import SAMPLE, Memory
from tracer.paths.on_screen import Picture
from tracer.paths.receivers import Receivers
from tracer.paths.surfaces.vertices import Vertices
from tracer.paths.tables import arrays_of, camera_of, picture_of, surfaces_of
from tracer.paths.waiting_kernel import new_waiting
from tracer.sampling.progressive import Values
from tracer.sampling.sequence import Sequence
from tracer.scene.scene import MASK_PRIMARY, Scene
from tracer.traversal.kernel import triple
from tracer.traversal.lane_kernel import BATCH

cuda: Any = numba.cuda
_known: WeakKeyDictionary[Receivers, tuple[Any, ...]] = WeakKeyDictionary()  # paths from one picture come in many parts
_packed: WeakKeyDictionary[Vertices, Any] = WeakKeyDictionary()
NO_SURFACE = -1  # in place of a pixel of the tile
CHUNK = 64  # rays handed out at a time, to a helper that counts no references to what they share


@scalar
def _radiance_of(waiting, begin, end, arrays, camera, picture, rays, u, bounces, spreads, next_event, out):
    origins, directions, spans, known = rays
    tables = interaction_kernel.assembled(arrays)
    for i in range(begin, end):
        origin, direction, mask = triple(origins, i, 0), triple(directions, i, 0), MASK_PRIMARY
        t0, t1, detail = triple(spans, i, 0)
        isect = interaction_kernel.intersect(
            tables, origin, direction, u[0, i], False, mask, t0, t1, MOST_PASS, detail, spreads
        )
        sight, numbers, counts = (camera, picture, known[i]), (u, i, 1), (waiting, (i, 0, 3), out)
        path_kernel.arriving(tables, isect, direction, sight, numbers, bounces, next_event, (True, True), counts)


@scalar
def _finish(waiting, arrays, out):
    waiting_kernel.finish(waiting, interaction_kernel.assembled(arrays), out)


@scalar
def radiance_path(i, arrays, camera, picture, rays, u, bounces, spreads, next_event, out):
    _radiance_of(None, i, i + 1, arrays, camera, picture, rays, u, bounces, spreads, next_event, out)


radiance_each = Each(radiance_path)


@driver
def radiance_all(arrays, camera, picture, rays, u, bounces, spreads, next_event, lanes, out):
    count = len(rays[0])
    for lane in prange(lanes):
        waiting = new_waiting()
        for begin in range(lane * CHUNK, count, lanes * CHUNK):
            end = min(begin + CHUNK, count)
            _radiance_of(waiting, begin, end, arrays, camera, picture, rays, u, bounces, spreads, next_event, out)
        _finish(waiting, arrays, out)


def item(paths: Any, *arguments: Any) -> None:
    """Placeholder for the body in the loop below."""


@scalar
def _add_paths(paths, begin, end, arrays, camera, picture, surfaces, points, rotation, pixels, setting, out):
    tables = interaction_kernel.assembled(arrays)
    draw(paths, points, rotation, pixels[begin:end])
    item(paths, tables, camera, picture, surfaces, begin, end, len(points), setting, out)


def _sums(arrays, camera, picture, surfaces, points, rotation, pixels, setting, lanes, out):
    step = max(1, BATCH // len(points))
    for lane in prange(lanes):
        paths = new_paths(len(rotation))
        for begin in range(lane * step, len(pixels), lanes * step):
            end = min(begin + step, len(pixels))
            for first in range(0, len(points), BATCH):
                some = points[first : first + BATCH]
                _add_paths(paths, begin, end, arrays, camera, picture, surfaces, some, rotation, pixels, setting, out)


@scalar
def paths(i, arrays, camera, picture, surfaces, points, rotation, pixels, setting, out):
    """As `_sums`, all paths from one surface, one after the other."""
    if pixels[i] == NO_SURFACE:
        return
    u, rows = cuda.local.array((MOST_DIMS, 1), np.float32), cuda.local.array(ROWS, np.float64)
    origins, directions = cuda.local.array((1, 3), np.float64), cuda.local.array((1, 3), np.float64)
    spans, weights = cuda.local.array((1, 2), np.float64), cuda.local.array((1, 2), np.float64)
    numbers, ids = cuda.local.array((1, 4), np.float64), cuda.local.array((1, 7), np.int32)
    found = cuda.local.array((3, 1), np.float64)
    one = Paths(None, u[: len(rotation)], rows, origins, directions, spans, weights, 0, numbers, ids, found)
    tables = interaction_kernel.assembled(arrays)
    for k in range(len(points)):
        draw(one, points[k : k + 1], rotation, pixels[i : i + 1])
        item(one, tables, camera, picture, surfaces, i, i + 1, 1, setting, out)


def _forms(integrator: Callable[..., None]) -> tuple[Kernel, Each]:
    """An integrator for CPU threads, and for those of a GPU."""
    return Kernel(_sums, CPU, item=integrator), Each(specialized(paths, integrator))


occlusion_sums, indirect_sums, lit_sums, reflected_sums, lobes_sums = map(
    _forms,
    (
        integrator_kernel.occlusion,
        integrator_kernel.indirect,
        integrator_kernel.lit,
        integrator_kernel.reflected,
        integrator_kernel.lobes,
    ),
)


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
    out = u.new_zeros(6, len(origins))
    spans = [
        torch.as_tensor(x, dtype=torch.float32, device=u.device).expand(len(origins)) for x in (t_min, t_max, detail)
    ]
    begin = u.new_zeros(len(origins)) if picture is None else u.new_ones(len(origins)) if known is None else known
    rays = origins.float(), directions.float(), torch.stack(spans, dim=1), begin.float()
    sees = camera_of(picture, u.device), picture_of(picture, u.device)
    given = arrays_of(scene, poses, lights), *sees, rays, u, bounces, spreads, next_event
    if simulated() or out.is_cuda:
        radiance_each(len(origins), *given, out)
    else:
        radiance_all(*replaced(given, array), threads(), array(out))
    return out[:3].T, out[3:].T


def occlusion(scene: Scene, at: Receivers, sequence: Sequence, radius: float) -> Values:
    """See `tracer.paths.op.occlusion`."""
    out = _summed(occlusion_sums, scene, at, at.places.T, sequence, float(radius), 5)
    return {"ao": out[:1], "bent_normal": out[1:4], "ao_onscreen": out[4:]}


def indirect(scene: Scene, at: Receivers, start: Vertices, sequence: Sequence, bounces: int) -> Values:
    """See `tracer.paths.op.indirect`."""
    out = _summed(indirect_sums, scene, at, _surfaces(start), sequence, bounces, 10)
    return {"gi": out[:3], "gi_onscreen": out[3:6], "sky": out[6:9], "sky_visibility": out[9:]}


def lit(scene: Scene, at: Receivers, start: Vertices, sequence: Sequence) -> Values:
    """See `tracer.paths.op.lit`."""
    out = _summed(lit_sums, scene, at, _surfaces(start), sequence, 0, 5)
    return {"direct": out[:3], "shadow": out[3:]}


def reflected(scene: Scene, at: Receivers, start: Vertices, sequence: Sequence, sharp: float) -> Values:
    """See `tracer.paths.op.reflected`."""
    out = _summed(reflected_sums, scene, at, _surfaces(start), sequence, float(sharp), 10)
    counts = {name: out[6 + k : 7 + k] for k, name in enumerate(("onscreen", "distance", "flies", "ends"))}
    return {"reflection": out[:3], "reflection_onscreen": out[3:6], **counts}


def lobes(
    scene: Scene, at: Receivers, start: Vertices, sequence: Sequence, bounces: int, memory: Memory | None = None
) -> Values:
    """See `tracer.paths.op.lobes`."""
    surfaces = _surfaces(start)
    if memory is None:
        keys, values = surfaces.new_zeros(0, dtype=torch.int64), surfaces.new_zeros(0, 4)
        cached = keys, values, surfaces.new_zeros(0, dtype=torch.bool)
    else:
        cache = memory.cache
        cached = cache.keys, torch.cat([cache.radiance, cache.weight[:, None]], dim=1), memory.follows
    rows = integrator_kernel.COLUMNS if memory is None else integrator_kernel.COLUMNS + SAMPLE
    out = _summed(lobes_sums, scene, at, surfaces, sequence, (bounces, *cached), rows)
    counts = {name: out[6 + k : 7 + k] for k, name in enumerate(("distance", "flies", "ends"))}
    samples = {} if memory is None else {"met": out[integrator_kernel.COLUMNS :]}
    return {"indirect": out[:3], "specular": out[3:6], **counts, **samples}


def _surfaces(start: Vertices) -> Tensor:
    if start not in _packed:
        _packed[start] = surfaces_of(start)
    return _packed[start]


def _summed(
    forms: tuple[Kernel, Each],
    scene: Scene,
    at: Receivers,
    surfaces: Tensor,
    sequence: Sequence,
    setting: Any,
    rows: int,
) -> Tensor:
    """``(rows, M)`` sums over the paths from each of M ``surfaces``, rows of `surfaces_of` or the first of them."""
    if at not in _known:
        device = at.poses.device
        _known[at] = (
            arrays_of(scene, at.poses, at.lights),
            camera_of(at.picture, device),
            picture_of(at.picture, device),
        )
    out, (on_cpu, each) = surfaces.new_zeros(rows, len(at.pixels)), forms
    places = sequence.places[at.pixels]
    if at.shows is not None:
        places = torch.where(at.shows, places, NO_SURFACE)
    given = *_known[at], surfaces, sequence.points, sequence.rotation, places, setting
    if simulated() or out.is_cuda:
        each(len(at.pixels), *given, out)
    else:
        on_cpu(*replaced(given, array), threads(), array(out))
    return at.found(out)
