"""Wrong rays, poses, views and places are named in one line, before torch or a kernel fails over them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import torch
from voxels import STONE, world

import tracer
from gbufrt import Camera
from tracer.worlds.regions.stream import Stream

PLAIN = world((4, 2, 4), (STONE, (0, 0, 0), (4, 1, 4)))
SCENE: Any = tracer.Scene(world=PLAIN)
CAMERA = Camera.look_at((2.0, 5.0, 9.0), (2.0, 0.0, 2.0), size=(3, 4))
G = tracer.gbuffer(SCENE, CAMERA)
AT, WAY = torch.rand(2, 3, 3), torch.rand(2, 3, 3)
HITS = tracer.trace(SCENE, AT, WAY)
AHEAD: Any = {"eye": lambda _: (0.0, 0.0, 0.0), "target": lambda _: (0.0, 0.0, 1.0)}
X: Any = "x"
ORIGIN: Any = (0, 0, 0)
NONE: Any = None


def moving(pose: Any) -> tracer.Scene:
    return tracer.Scene(world=PLAIN, instances=(tracer.Instance(model=PLAIN, pose=lambda _: pose, name="cart"),))


TRANSPOSED = torch.eye(4)
TRANSPOSED[3, 0] = 5.0
MOVING = moving(torch.eye(4))

KINDS: list[tuple[Callable[[], Any], str]] = [
    (lambda: tracer.trace(X, AT, WAY), r"scene must be a tracer\.Scene, got str"),
    (lambda: tracer.trace(SCENE, AT.int(), WAY), r"origins must be float32 or float64, got int32; .* \.float\(\)$"),
    (lambda: tracer.trace(SCENE, AT, WAY.long()), r"directions must be float32 or float64, got int64; .* \.float\(\)$"),
    (lambda: tracer.transmission(SCENE, AT.int(), WAY), "origins must be float32 or float64, got int32"),
    (
        lambda: tracer.trace(SCENE, AT, WAY, beyond=X),
        r"beyond must be a tracer\.Hits, got str; tracer\.trace gave them",
    ),
    (lambda: tracer.load("terrain", pack=3), "pack must be a path, got 3$"),  # pyright: ignore
    (lambda: tracer.stream(3), "path must be a path, got 3$"),  # pyright: ignore
    (lambda: tracer.stream(".", pack=3), "pack must be a path, got 3$"),  # pyright: ignore
    (lambda: Stream(path=X, window=8).around(X), r"eye of a camera must be three numbers such as .*, got 'x'$"),
    (
        lambda: tracer.View(eye=ORIGIN, target=X),
        r"eye must be a function of the time .* eye=lambda time: .*, got tu",
    ),  # pyright: ignore
    (lambda: tracer.View(**AHEAD, fov_y=X), "fov_y must be a number"),
    (lambda: tracer.View(**{**AHEAD, "eye": lambda _: X}).camera(size=(3, 4)), "eye must be three numbers .*, got 'x'"),
    (lambda: moving(np.eye(4)).poses([0.0]), r"pose of instance 'cart' must return a \(4,4\) tensor, got ndarray; "),
    (lambda: MOVING.poses(X), "times must be seconds"),
    (lambda: tracer.Instance(model=PLAIN, pose=X), "pose must be a function of the time .*, got 'x'$"),
    (lambda: tracer.Instance(model=PLAIN, pose=torch.eye, scale=torch.ones(3)), "scale must be a number"),  # pyright: ignore
    (lambda: tracer.Scene(world=PLAIN, instances=NONE), r"instances must be a tuple of tracer\.Instance, got NoneType"),
    (lambda: tracer.Scene(world=PLAIN, views=X), r"views must be a mapping of names to tracer\.View, got str"),
    (
        lambda: tracer.Sun(direction=(X, X, X)),
        "direction of the sun must be three numbers .*, got \\('x', 'x', 'x'\\)$",
    ),
    (lambda: tracer.Material(name="a", tint=torch.rand(3, 3)), r"tint of material 'a' .*, got one of shape \(3, 3\)$"),  # pyright: ignore
    (lambda: tracer.ambient_occlusion(MOVING, G, poses=X), r"poses must be a torch\.Tensor, got str; scene\.poses"),
    (lambda: tracer.ambient_occlusion(SCENE, G, progress=X, samples=1), "progress must be a function of the samples"),
    (lambda: tracer.sampled(SCENE, NONE), r"frame must be a gbufrt\.Frame, got NoneType; tracer\.render"),
    (
        lambda: tracer.sampled_with_cache(SCENE, tracer.render(SCENE, CAMERA, light_samples=0), X),
        r"cache must be a tracer\.IrradianceCache, got str",
    ),
    (lambda: tracer.sample_light(SCENE, G, chosen=G.depth), "chosen must be bool, got float32; compare it: chosen > 0"),
    (lambda: tracer.sample_light(SCENE, G, index=torch.tensor(0.5)), "index must be a whole number, got one of torch"),  # pyright: ignore
    (lambda: tracer.one_a_stratum(X), r"hit must be a torch\.Tensor, got str"),
    (lambda: tracer.brightest_a_stratum(G.depth, G.depth), "hit must be bool, got float32"),
    (lambda: tracer.at_hour(SCENE, 12.0, path=X), r"path must be a tracer\.SunPath, got str"),
    (lambda: tracer.focus_distance(SCENE, CAMERA, previous=X), "previous must be a number or a tensor, got 'x'"),
    (
        lambda: tracer.render(SCENE, CAMERA, time=torch.rand(2, 2)),
        r"time must be seconds, .*, got one of shape \(2, 2\)",
    ),
    (lambda: PLAIN.at(X), r"cells must be a torch\.Tensor, got str"),
]
VALUES: list[tuple[Callable[[], Any], str]] = [
    (
        lambda: tracer.trace(SCENE, AT, WAY, t_max=torch.rand(3, 2)),
        r"t_max must be a number, or \(2, 3\) for rays \(2, 3, 3\), got \(3, 2\)$",
    ),
    (lambda: tracer.trace(SCENE, AT, WAY, t_min=torch.rand(0)), r"t_min must be a number, or \(2, 3\) .*, got \(0,\)$"),
    (lambda: tracer.trace(SCENE, AT, WAY, t_max=torch.rand(1, 2, 3)), r"t_max must be a number, or \(2, 3\)"),
    (lambda: tracer.trace(SCENE, AT[:1], WAY[:1], beyond=HITS), r"beyond must be the hits of these rays, \(1, 3\)"),
    (lambda: tracer.trace(SCENE, AT.to("meta"), WAY), "origins is on meta but scene is on cpu; move one with"),
    (lambda: tracer.trace(MOVING, AT, WAY, poses=torch.zeros(0, 1, 4, 4)), r"poses must be \(1,4,4\) or \(B,1,4,4\)"),
    (lambda: Camera.look_at((0, 0, 0), (0, 0, 0), size=(3, 4)), "eye and target must be two places"),
    (lambda: tracer.View(**{**AHEAD, "target": AHEAD["eye"]}).camera(size=(3, 4)), "eye and target must be two places"),
    (lambda: tracer.View(**AHEAD, fov_y=180.0), "fov_y must lie between 0 and 180 degrees, got 180"),
    (lambda: moving(torch.eye(3)).poses([0.0]), r"pose of instance 'cart' must return a \(4,4\) tensor, got \(3, 3\)"),
    (lambda: moving(torch.eye(4) * torch.nan).poses([0.0]), "poses of instances must be finite"),
    (lambda: moving(TRANSPOSED).poses([0.0]), r"poses of instances must end in the row \(0, 0, 0, 1\): position goes"),
    (lambda: MOVING.poses([]), "times must be finite, in seconds, got"),
    (lambda: tracer.Sky(zenith=(torch.nan, 0.0, 0.0)), "zenith of the sky must be finite and not negative"),
    (lambda: tracer.render(SCENE, CAMERA, light_samples=-1), "light_samples must be at least 0, got -1"),
    (
        lambda: tracer.sample_light(SCENE, G, chosen=G.hit[..., 1:]),
        r"chosen must be \(1, 1, 3, 4\), got \(1, 1, 3, 3\)",
    ),
    (lambda: Stream(path=X, window=8).around((0.0, torch.nan, 0.0)), "eye must be finite, in world units"),
    (lambda: Stream(path=X, window=8).to("foo"), "device must be one that torch knows"),
    (lambda: tracer.focus_distance(SCENE, CAMERA, previous=torch.ones(3)), r"previous must be a number or \(1,\), got"),
    (lambda: PLAIN.at(torch.zeros(2, dtype=torch.int32)), r"cells must be \(\.\.\.,3\) voxel coordinates, got \(2,\)"),
]


@pytest.mark.parametrize(("call", "message"), KINDS)
def test_the_wrong_kind_is_named(call: Callable[[], Any], message: str):
    with pytest.raises(TypeError, match=f"^{message}") as error:
        call()
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(("call", "message"), VALUES)
def test_the_wrong_value_is_named(call: Callable[[], Any], message: str):
    with pytest.raises(ValueError, match=f"^{message}") as error:
        call()
    assert "\n" not in str(error.value)


def test_ends_of_rays_may_be_numbers_rows_or_one_for_each():
    above, down = torch.tensor([2.0, 3.0, 2.0]).expand(2, 3, 3), torch.tensor([0.0, -1.0, 0.0]).expand(2, 3, 3)
    same = [
        tracer.trace(SCENE, above, down, t_max=end).t
        for end in (5.0, torch.tensor(5.0), torch.full((3,), 5.0), torch.full((2, 1), 5.0), torch.full((2, 3), 5.0))
    ]
    assert all(torch.equal(one, same[0]) for one in same)
    assert bool((same[0] == 2.0).all())


def test_a_seed_may_be_a_flag():
    assert tracer.ambient_occlusion(SCENE, G, samples=1, seed=True).samples == 1
