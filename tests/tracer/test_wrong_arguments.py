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
NONE: Any = None
AT = torch.zeros(1, 3)
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
        (lambda: tracer.Sun(angular_radius=NONE), "^angular_radius must be a number or a 0-dim tensor, got NoneType$"),
        (lambda: tracer.Haze(begin=NONE, end=9.0), "^begin must be a number or a 0-dim tensor, got NoneType$"),
        (lambda: tracer.Sky(plain=NAME), r"^plain must be a tracer\.Plain, got str$"),
        (lambda: tracer.SunPath(zenith=NONE), "^zenith must be a number"),
        (lambda: tracer.Waves(amplitude=NAME), "^amplitude must be a number"),
        (lambda: tracer.Fog(extinction=NONE), "^extinction must be a number"),
        (lambda: tracer.Fog(extinction=0.1, albedo=NONE), "^albedo of fog must be three numbers .*, got None$"),
        (lambda: tracer.ambient_occlusion(SCENE, G, noise=NONE), "^noise must be a number"),
        (lambda: tracer.Sun(direction=NAME), "^direction of the sun must be three numbers"),
        (
            lambda: tracer.Material(name="a", albedo=NAME),
            "^albedo of material 'a' must be three numbers .*, got 'village'$",
        ),
        (
            lambda: tracer.Material(name="a", emission=torch.tensor(5.0)),  # pyright: ignore
            "^emission of material 'a' must be three numbers",
        ),
        *(
            (lambda name=name: tracer.Scene(world=PLAIN, **{name: NAME}), rf"^{name} must be a tracer\.\w+, got str$")
            for name in ("sun", "sky", "haze", "rain", "waves", "fog")
        ),
        (lambda: tracer.Scene(world=PLAIN, instances=(NAME,)), r"^instances must be a tracer\.Instance, got str$"),
        (lambda: tracer.trace(SCENE, AT, AT, t_min=NAME), "^t_min must be a number or a 0-dim tensor, got 'village'$"),
        (lambda: tracer.trace(SCENE, AT, AT, t_max=NONE), "^t_max must be a number or a 0-dim tensor, got NoneType$"),
        (lambda: tracer.trace(SCENE, AT, AT, poses=NAME), r"^poses must be a torch\.Tensor, got str; scene\.poses"),
        (lambda: tracer.load(".", box=NAME), "^box must be 6 whole numbers, x0, y0, z0, x1, y1, z1, got 'village'$"),
        (lambda: tracer.load(".", around=(1, 2.5)), r"^around must be 2 whole numbers, x, z, got \(1, 2\.5\)$"),  # pyright: ignore
        (lambda: tracer.load(".", chunks=NAME), "^chunks must be a whole number, got 'village'$"),
        (lambda: tracer.stream(".", window=NAME), "^window must be a whole number, got 'village'$"),
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


NAN = float("nan")


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: tracer.Sun(direction=(0.0, 0.0, 0.0)), "^direction of the sun must have a finite length above 0"),
        (lambda: tracer.Sun(direction=(NAN, 0.0, 0.0)), "^direction of the sun must have a finite length above 0"),
        (lambda: tracer.Sun(irradiance=(1.0, -1.0, 1.0)), "^irradiance of the sun must be finite and not negative"),
        (lambda: tracer.Sun(irradiance=(1.0, NAN, 1.0)), "^irradiance of the sun must be finite and not negative"),
        (lambda: tracer.Sun(angular_radius=-3.0), "^angular_radius must lie in 0 to 89, got -3$"),
        (lambda: tracer.Sun(angular_radius=95.0), "^angular_radius must lie in 0 to 89, got 95$"),
        (lambda: tracer.Sky(stars=torch.eye(4)), r"^stars must be \(3,3\), a rotation, got \(4, 4\)$"),
        (lambda: tracer.Haze(begin=5.0, end=5.0), "^begin of haze must be less than its end, got 5 and 5$"),
        (lambda: tracer.Haze(begin=-5.0, end=5.0), "^begin must be at least 0, got -5$"),
        (
            lambda: tracer.Instance(model=PLAIN, pose=lambda _: torch.eye(4), scale=0.0),
            "^scale must be positive, in world units a voxel, got 0$",
        ),
        (lambda: tracer.render(SCENE, CAMERA, time=[]), r"^time must be finite, in seconds, got \[\]$"),
        (
            lambda: tracer.path_trace(SCENE, CAMERA, time=(0.0, 1.0)),
            "^time must be one number or one for each of the 1",
        ),
        (
            lambda: tracer.path_trace(SCENE, CAMERA, aperture_radius=0.1, focus_distance=torch.ones(3)),
            r"^focus_distance must be one number or \(1,\), got \(3,\)$",
        ),
    ],
)
def test_what_no_light_air_model_or_time_can_be_is_named(call: Callable[[], Any], message: str):
    with pytest.raises(ValueError, match=message):
        call()


NO_NUMBERS: dict[Callable[..., Any], dict[str, str]] = {
    tracer.ambient_occlusion: {
        "samples": "a whole number",
        "seed": "a whole number",
        "noise": "a num",
        "radius": "a num",
    },
    tracer.indirect_diffuse: {"bounces": "a whole number"},
    tracer.reflection: {"samples": "a whole number"},
    light_truth: {"bounces": "a whole number", "samples": "a whole number"},
}


@pytest.mark.parametrize("function", NO_NUMBERS)
def test_texts_in_place_of_numbers_of_truth_are_named(function: Callable[..., Any]):
    for name, wanted in NO_NUMBERS[function].items():
        with pytest.raises(TypeError, match=f"^{name} must be {wanted}.*, got 'village'$"):
            function(SCENE, G, **{"samples": 1, name: NAME})


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: tracer.render(SCENE, CAMERA, time=NAME), "^time must be seconds, one number or one for each camera"),
        (lambda: tracer.path_trace(SCENE, CAMERA, time=NAME), "^time must be seconds, one number or one for each cam"),
        (lambda: tracer.path_trace(SCENE, CAMERA, shutter_offset=NAME), "^shutter_offset must be a number"),
        (lambda: tracer.path_trace(SCENE, lambda _: NAME), r"^camera must be a gbufrt\.Camera, got str"),
        (lambda: tracer.focus_distance(SCENE, CAMERA, rate=NAME), "^rate must be a number or a 0-dim tensor, got 'vil"),
        (lambda: tracer.Sky(zenith=NAME), "^zenith of the sky must be three numbers"),
        (lambda: tracer.Sky(picture=NAME), r"^picture must be a torch\.Tensor, got str"),
        (lambda: tracer.Haze(begin=NAME, end=1.0), "^begin must be a number"),
        (lambda: tracer.Instance(model=NAME, pose=lambda _: torch.eye(4)), r"^model must be a tracer\.World, got str$"),
        (
            lambda: tracer.Instance(model=PLAIN, pose=NAME),
            "^pose must be a function of the time in seconds that returns a .4,4. tensor, got 'village'$",
        ),
    ],
)
def test_what_is_no_light_air_model_time_or_camera_is_named(call: Callable[[], Any], message: str):
    with pytest.raises(TypeError, match=message):
        call()


def test_a_camera_in_double_precision_shows_what_it_shows_in_single():
    """Matrices of numpy and of camera files are float64."""
    double = CAMERA.to(torch.float64)
    single, found = (tracer.render(SCENE, camera, previous_camera=camera, index=3) for camera in (CAMERA, double))
    assert found.gbuffer.depth.dtype == torch.float32
    assert torch.allclose(found.read("radiance"), single.read("radiance"), atol=1e-5)
    assert torch.allclose(found.gbuffer.depth, single.gbuffer.depth, rtol=1e-5)
    assert float(tracer.focus_distance(SCENE, double)) == pytest.approx(float(tracer.focus_distance(SCENE, CAMERA)))


def test_the_time_of_a_frame_may_be_a_tensor():
    """As `gbufrt.Frame.time` may."""
    found = tracer.render(SCENE, CAMERA, time=torch.tensor(1.5, dtype=torch.float64), light_samples=0)
    assert found.time == 1.5
