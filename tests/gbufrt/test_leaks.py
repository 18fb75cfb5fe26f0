"""Reflections stay on reflective surfaces: none of their light leaks onto what is in front."""

from __future__ import annotations

import torch
from voxels import DARK

from gbufrt import Camera, Frame, Pipeline
from post.presets import me1
from tracer.frames import render
from tracer.gbuffers import gbuffer
from tracer.scene.material import Material, MaterialTable
from tracer.scene.scene import Scene
from tracer.scene.world import World
from tracer.truth.truth import reflection


def posts_on_a_mirror() -> Scene:
    """A metal floor that reflects a red wall, and in front of it dull posts that face only the dark."""
    table = MaterialTable.of(
        [
            Material(name="mirror", albedo=(0.9, 0.9, 0.9), metallic=1.0, roughness=0.05, variation=0.0),
            Material(name="post", albedo=(0.0, 0.0, 0.0), roughness=0.4, variation=0.0),
            Material(name="red", emission=(1.0, 0.1, 0.05)),
        ]
    )
    voxels = torch.zeros(32, 16, 40, dtype=torch.int16)
    voxels[:, 0], voxels[:, 1:14, 0] = 1, 3
    for x, z in ((9, 22), (14, 28), (19, 24), (23, 18)):
        voxels[x, 1:9, z] = 2
    return Scene(world=World.from_dense(voxels, table), sun=None, sky=DARK)


def test_no_colour_leaks_over_depth_edges() -> None:
    scene = posts_on_a_mirror()
    stage = me1("high", tunables={"reflection.estimate.bounces": 1}).stages["reflection"]  # as the truth has
    pipeline = Pipeline(reflection=stage)  # pyright: ignore[reportArgumentType]

    def frames() -> list[Frame]:
        eyes = [(16.0 + 0.15 * i, 7.0, 44.0) for i in range(9)]
        cameras = [Camera.look_at(eye, (16, 2, 16), size=(72, 96), fov_y=50.0) for eye in eyes]
        pairs = zip(cameras, cameras[:1] + cameras, strict=False)
        return [render(scene, now, previous_camera=before, index=i) for i, (now, before) in enumerate(pairs)]

    found = list(pipeline.stream(frames()))[-1]
    g = gbuffer(scene, found.gbuffer.camera)
    true = reflection(scene, g, samples=64)["reflection"]
    assert g.metallic is not None
    floor, post = g.hit & (g.metallic > 0.5), g.hit & (g.metallic < 0.5) & (true.amax(1, keepdim=True) < 1e-4)
    lit = floor & (true[:, :1] > 0.5)
    beside = post & (torch.nn.functional.max_pool2d(lit.float(), 3, 1, 1) > 0)
    assert int(lit.sum()) > 500
    assert int(beside.sum()) > 100
    got = found.read("reflection")
    assert got[beside.expand_as(got)].max() < 0.01
    near = lit & (torch.nn.functional.max_pool2d(post.float(), 3, 1, 1) > 0)
    assert float(got[:, :1][near].mean() / true[:, :1][near].mean()) > 0.85
