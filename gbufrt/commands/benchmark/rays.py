"""Rates of rays through worlds of hills, in millions a second."""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch

from gbufrt.commands.benchmark.process import MEGA, timed
from gbufrt.gbuffer import GBuffer

if TYPE_CHECKING:
    from tracer.scene.scene import Scene
    from tracer.scene.view import View

Size = tuple[int, int]
"""``(H, W)``."""
TRACE_SIZE: Size = (480, 854)
RADIUS, SAMPLES = 8.0, 4  # of ambient occlusion: world units, and rays a pixel
SIDE, TIMES = 256, 4  # of the large world: voxels of a part, and how often it stands along x and z


def time_rays(repeats: int, device: str = "cpu", size: Size = TRACE_SIZE) -> dict[str, float]:
    """Primary rays through 256x128x256 voxels of terrain, looking along it to the horizon."""
    from tracer.worlds import terrain

    scene = terrain()
    ms = _time_view(scene.to(device), scene.views["horizon"], repeats, device, size)
    return {"ms": ms, "mrays_per_s": size[0] * size[1] / ms * 1e3 / MEGA}


def time_other_rays(repeats: int) -> dict[str, float]:
    """Rates over the same terrain, on the CPU, of a ``grazing`` view and of ``occlusion`` rays."""
    from tracer.gbuffers import gbuffer
    from tracer.worlds import terrain

    scene = terrain()
    shown = gbuffer(scene, scene.views["horizon"].camera(0.0, size=TRACE_SIZE))
    return {
        "grazing": rate(scene, grazing(scene), repeats, TRACE_SIZE),
        "occlusion": occlusion_rate(scene, shown, repeats),
    }


def compare_worlds(repeats: int) -> dict[str, float]:
    """Rates of one view of hills, on the CPU: in a ``small`` world of 256 voxels a side, and in a ``large`` one."""
    from tracer.worlds import terrain

    small = terrain((SIDE, SIDE, SIDE))
    view = small.views["horizon"]
    return {"small": rate(small, view, repeats, TRACE_SIZE), "large": rate(tiled(small), view, repeats, TRACE_SIZE)}


def compare_octree(repeats: int) -> dict[str, dict[str, float]]:
    """The bricks of terrain beside its octree, on the CPU: rates of a ``horizon`` and a ``grazing`` view, and bytes of
    each form over the ``voxels`` that are not air.
    """
    from tracer.traversal.octree import Octree
    from tracer.worlds import terrain

    scene = terrain()
    tree, grid = Octree.of(scene.world), scene.world.grid
    found = {}
    for name, view in (("horizon", scene.views["horizon"]), ("grazing", grazing(scene))):
        rays = view.camera(0.0, size=TRACE_SIZE).rays()
        ms = timed(lambda: tree.trace(*rays), repeats)  # noqa: B023
        millions = TRACE_SIZE[0] * TRACE_SIZE[1] / MEGA
        found[name] = {"bricks": rate(scene, view, repeats, TRACE_SIZE), "octree": millions / ms * 1e3}
    solid = int((scene.world.bricks[scene.world.index.long()] > 0).sum())
    sizes = {"bricks": grid.bricks.nbytes + grid.index.nbytes, "octree": tree.nbytes}
    return {**found, "voxels": {form: size / solid for form, size in sizes.items()}}


def rate(scene: Scene, view: View, repeats: int, size: Size) -> float:
    """Primary rays of a view."""
    return size[0] * size[1] / _time_view(scene, view, repeats, "cpu", size) * 1e3 / MEGA


def occlusion_rate(scene: Scene, gbuffer: GBuffer, repeats: int) -> float:
    """Rays of `tracer.ambient_occlusion` with a radius of 8, everything that it computes included."""
    from tracer.truth.truth import ambient_occlusion

    ms = timed(lambda: ambient_occlusion(scene, gbuffer, radius=RADIUS, samples=SAMPLES), repeats)
    return float(gbuffer.hit.sum()) * SAMPLES / ms * 1e3 / MEGA


def grazing(scene: Scene) -> View:
    """From above the hills in a corner of the world to the far corner: rays meet them at a grazing angle."""
    from tracer.scene.view import View

    x, y, z = scene.world.bounds()[1]
    eye, target = (x / 16, 0.75 * y, z - z / 16), (0.8 * x, 0.5 * y, 0.2 * z)
    return View(eye=lambda _: eye, target=lambda _: target, fov_y=30.0)


def tiled(scene: Scene) -> Scene:
    """A world four times as long and as wide: its hills, and their mirror images in turn, each with its own voxels."""
    from dataclasses import replace

    world, bricks, rows = scene.world, [scene.world.bricks[:1]], []
    for i in range(TIMES):
        row = []
        for j in range(TIMES):
            axes = [axis for axis, odd in ((0, i % 2), (2, j % 2)) if odd]
            first = sum(len(part) for part in bricks) - 1
            index = world.index.flip(axes)
            row.append(torch.where(index > 0, index + first, 0))
            bricks.append(world.bricks[1:].flip([axis + 1 for axis in axes]))
        rows.append(torch.cat(row, dim=2))
    return replace(scene, world=replace(world, bricks=torch.cat(bricks), index=torch.cat(rows)))


def _time_view(scene: Scene, view: View, repeats: int, device: str, size: Size) -> float:
    from tracer.traversal.rays import trace

    origins, directions = (rays.to(device) for rays in view.camera(0.0, size=size).rays())
    return timed(lambda: trace(scene, origins, directions), repeats, device)
