"""Arguments of the wrong kind to the tracer are named, with how the right one is made."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
import torch
from voxels import STONE, world

import tracer
from gbufrt import Camera
from tracer.truth.truth import light_truth

PLAIN = world((4, 2, 4), (STONE, (0, 0, 0), (4, 1, 4)))
SCENE: Any = tracer.Scene(world=PLAIN)
CAMERA: Any = Camera.look_at((2.0, 5.0, 9.0), (2.0, 0.0, 2.0), size=(3, 4))
G: Any = tracer.gbuffer(SCENE, CAMERA)
NAME: Any = "village"
PROGRAM: Any = len
WRONG: Any = {"a": tracer.HitGroup()}
OF_GBUFFERS: dict[str, Any] = {
    "ambient_occlusion": tracer.ambient_occlusion,
    "indirect_diffuse": tracer.indirect_diffuse,
    "reflection": tracer.reflection,
    "sample_light": tracer.sample_light,
    "light_truth": light_truth,
    "fog_truth": tracer.fog_truth,
}
OF_FRAMES: dict[str, Any] = {
    "sampled": tracer.sampled,
    "sampled_with_cache": tracer.sampled_with_cache,
    "one_path": tracer.one_path,
}
NO_SCENE = r"^scene must be a tracer\.Scene, got str; tracer\.load\(name\) gives one$"


@pytest.mark.parametrize("name", OF_GBUFFERS)
def test_what_takes_a_gbuffer_tells_how_one_is_made(name: str):
    function = OF_GBUFFERS[name]
    with pytest.raises(TypeError, match=NO_SCENE):
        function(NAME, G)
    made = r"tracer\.gbuffer\(scene, camera\) gives one$"
    for wrong in (NAME, CAMERA):
        with pytest.raises(TypeError, match=rf"^gbuffer must be a gbufrt\.GBuffer, got \w+; {made}"):
            function(SCENE, wrong)


@pytest.mark.parametrize("name", OF_FRAMES)
def test_what_takes_a_frame_tells_how_one_is_made(name: str):
    function, frame = OF_FRAMES[name], tracer.render(SCENE, CAMERA, light_samples=0)
    with pytest.raises(TypeError, match=NO_SCENE):
        function(NAME, frame)
    for wrong in (NAME, CAMERA, G):
        with pytest.raises(
            TypeError, match=r"^frame must be a gbufrt\.Frame, got \w+; tracer\.render\(scene, camera\)"
        ):
            function(SCENE, wrong)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: tracer.dispatch(NAME, PROGRAM, {}), NO_SCENE),
        (lambda: tracer.dispatch(SCENE, NAME, {}), "^generation must be a function that takes a Launch, got a str$"),
        (lambda: tracer.dispatch(SCENE, PROGRAM, NAME), "^rays must be ray types by name, as in .*, got 'village'$"),
        (lambda: tracer.dispatch(SCENE, PROGRAM, WRONG), "^rays must be ray types by name"),
        (lambda: tracer.focus_distance(NAME, CAMERA), NO_SCENE),
        (lambda: tracer.focus_distance(SCENE, NAME), r"^camera must be a gbufrt\.Camera, got str; "),
        (lambda: tracer.at_hour(NAME, 12.0), NO_SCENE),
        (lambda: tracer.at_hour(SCENE, NAME), "^hour must be a number or a 0-dim tensor, got 'village'$"),
        (lambda: tracer.raining(NAME, 0.5), NO_SCENE),
        (lambda: tracer.raining(SCENE, NAME), "^level must be a number or a 0-dim tensor, got 'village'$"),
        (lambda: tracer.trace(SCENE, NAME, NAME), r"^origins must be a torch\.Tensor, got str$"),
        (lambda: tracer.render(SCENE, CAMERA, index=NAME), "^index must be a whole number, got 'village'$"),
        (
            lambda: tracer.Scene(world=NAME),
            r"^world must be a tracer\.World, got str; tracer\.load\(name\) gives a scene$",
        ),
        (lambda: tracer.Sun(direction=NAME), "^direction of the sun must be three numbers"),
        (
            lambda: tracer.Material(name="a", albedo=NAME),
            "^albedo of material 'a' must be three numbers .*, got 'village'$",
        ),
        (
            lambda: tracer.Material(name="a", emission=torch.tensor(5.0)),  # pyright: ignore
            "^emission of material 'a' must be three numbers",
        ),
        (lambda: tracer.Material(name="a", roughness=NAME), "^roughness must be a number or a 0-dim tensor"),
    ],
)
def test_the_wrong_kind_is_named(call: Callable[[], Any], message: str):
    with pytest.raises(TypeError, match=message):
        call()


def test_no_time_is_no_number():
    with pytest.raises(ValueError, match=r"^time must be finite, in seconds, got nan"):
        tracer.render(SCENE, CAMERA, time=float("nan"))


def test_a_device_that_is_not_there_is_named():
    with pytest.raises(ValueError, match=r"^there is no device 'cuda:99': torch sees"):
        SCENE.to("cuda:99")
