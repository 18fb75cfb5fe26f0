"""Lengths, factors, frame numbers and seeds that mean nothing are named, and none of them is taken silently."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

import boxes
import pytest
import torch

import gbufrt
import post
from gbufrt.noise.noise import blue_noise, halton_jitter, hilbert_r2, pixel_hash
from post.lens.thin_lens import circle_of_confusion

SIZE = (24, 32)
NONE: Any = None
NUMBER: Any = 3
NAN: Any = torch.nan
SEVERAL: Any = [1, 2]
WORD: Any = "x"
FRAME = boxes.frame(boxes.camera(SIZE))
G = FRAME.gbuffer
LIT, ONE = torch.rand(1, 3, *SIZE), torch.rand(1, 1, *SIZE)
SURFACES: dict[str, Any] = {"depth": G.depth, "normal": G.normal, "camera": G.camera}
SWEEPS: dict[Callable[..., Any], dict[str, Any]] = {
    post.gtao: SURFACES,
    post.bitmask_ao: SURFACES,
    post.ssgi: {**SURFACES, "light": LIT, "albedo": LIT},
    post.march_gi: {**SURFACES, "light": LIT, "albedo": LIT},
    post.ssr: {**SURFACES, "light": LIT, "roughness": ONE},
}
LIGHT = FRAME.replace(radiance=LIT, color=LIT, gbuffer=G.replace(albedo=LIT))
LENS: dict[str, Any] = {"color": LIT, "depth": G.depth, "camera": G.camera}
MOVED: dict[str, Any] = {"color": LIT, "depth": G.depth, "motion": LIT[:, :2]}
FILTERED: dict[str, Any] = {**SURFACES, "signal": LIT, "hit": G.hit}
NOISY: dict[Callable[..., Any], dict[str, Any]] = {
    **SWEEPS,
    (lambda **given: post.gtao(**given, method="horizon")): SURFACES,
    (lambda **given: post.motion_blur(**{**MOVED, "motion": 20 * LIT[:, :2]}, **given)): {},
    (lambda **given: post.display_encode(LIT, dither=True, **given)): {},
    **{(lambda noise=noise, **given: noise(*SIZE, **given)): {} for noise in (blue_noise, hilbert_r2, pixel_hash)},
}
WRONG: list[tuple[Callable[..., Any], dict[str, Any], str, str]] = [
    *((function, given, "thickness", "be at least 0") for function, given in SWEEPS.items()),
    (post.gtao, SURFACES, "hidden", "be at least 0"),
    (post.bitmask_ao, SURFACES, "hidden", "be at least 0"),
    (post.tone_map, {"color": LIT}, "exposure", "be at least 0"),
    (post.roughness_from_color, {"color": LIT}, "scale", "be at least 0"),
    (post.metallic_from_color, {"color": LIT}, "dark", "be at least 0"),
    (post.reactive_mask, {"g": G}, "reactivity", "be at least 0"),
    (post.depth_of_field, LENS, "focus_distance", "be positive, in world units"),
    (post.depth_of_field, LENS, "aperture_radius", "be at least 0, in world units"),
    (post.motion_blur, MOVED, "shutter", "be at least 0"),
]


@pytest.mark.parametrize(("function", "given", "name", "wanted"), WRONG)
def test_numbers_below_their_least_and_texts_are_named(
    function: Callable[..., Any], given: dict[str, Any], name: str, wanted: str
):
    for wrong in (-1.0, torch.tensor(-1.0)):
        with pytest.raises(ValueError, match=f"^{name} must {wanted}, got -1$"):
            function(**given, **{name: wrong})
    with pytest.raises(ValueError, match=f"^{name} must {wanted}, got nan$"):
        function(**given, **{name: float("nan")})
    with pytest.raises(TypeError, match=f"^{name} must be a number or a (0-dim )?tensor, got 'x'$"):
        function(**given, **{name: "x"})


@pytest.mark.parametrize("function", NOISY)
def test_frame_numbers_and_seeds_are_whole(function: Callable[..., Any]):
    for name in ("index", "seed"):
        for wrong, told in (("x", "'x'"), (1.5, "1.5"), (None, "NoneType"), (torch.ones(3), r"one of shape \(3,\)")):
            with pytest.raises(TypeError, match=f"^{name} must be a whole number, got {told}$"):
                function(**NOISY[function], **{name: wrong})


def test_jitter_repeats_after_a_whole_number_of_frames():
    with pytest.raises(TypeError, match=r"^index must be a whole number, got 1\.5$"):
        halton_jitter(1.5)  # pyright: ignore[reportArgumentType]
    with pytest.raises(ValueError, match=r"^length must be at least 1, got 0$"):
        halton_jitter(3, length=0)


def test_one_of_several_numbers_of_cameras_is_enough():
    of: dict[str, Any] = {"focus_distance": 5.0, "aperture_radius": 0.1}
    for name, wrong in (("focus_distance", torch.tensor([1.0, 0.0])), ("aperture_radius", torch.tensor([1.0, -2.0]))):
        with pytest.raises(ValueError, match=f"^{name} must be "):
            circle_of_confusion(G.depth, G.camera, **{**of, name: wrong})
    with pytest.raises(TypeError, match=r"^focus_speed must be a number"):
        post.DepthOfField(focus_speed="x")  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize("function", [post.bilateral, post.atrous])
def test_the_channels_that_lead_are_there(function: Callable[..., Any]):
    for lead in (0, -1, 4):
        with pytest.raises(ValueError, match=f"^lead must lie in 1 to 3, the channels of the signal, got {lead}$"):
            function(**FILTERED, lead=lead)
    with pytest.raises(TypeError, match=r"^lead must be a whole number, got 'x'$"):
        function(**FILTERED, lead="x")
    with pytest.raises(ValueError, match=r"^lead must lie in 1 to 1"):
        post.temporal(ONE, G, lead=3)


@pytest.mark.parametrize("function", [post.bilateral, post.atrous])
@pytest.mark.parametrize("bad", [torch.nan, torch.inf])
def test_filters_mend_what_is_not_finite(function: Callable[..., Any], bad: float):
    """As passes do, where a pipeline has not."""
    for name, picture in (("signal", LIT), ("variance", ONE)):
        wrong = picture.clone()
        wrong[..., 12, 16] = bad
        found = function(**{**FILTERED, name: wrong})
        assert all(bool(t.isfinite().all()) for t in (found if isinstance(found, tuple) else (found,)))


def test_strides_and_pipelines_are_told_from_what_is_none():
    for wrong in (None, 1.5, "x"):
        with pytest.raises(TypeError, match=r"^stride must be a whole number, got "):
            post.Reduced(wrong)  # pyright: ignore[reportArgumentType]
    for extra in ("haze", (1,), 3):
        with pytest.raises(TypeError, match=r"^extra must be names of signals, as in extra=\('fog',\), got "):
            post.Reduced(extra=extra)  # pyright: ignore[reportArgumentType]
    for wrong in (None, "low"):
        with pytest.raises(TypeError, match=r"^pipeline must be a gbufrt\.Pipeline, got \w+; post\.me1\(\) is one$"):
            post.with_fog(wrong)  # pyright: ignore[reportArgumentType]


def test_no_number_of_a_pass_may_be_none():
    """They are told where they are set, not by torch over a frame."""
    told = 0
    for name, kind in vars(post).items():
        if not (isinstance(kind, type) and issubclass(kind, (gbufrt.Pass, gbufrt.TemporalPass))):
            continue
        for tunable, known in inspect.signature(kind).parameters.items():
            if isinstance(known.default, (int, float)) and "None" not in str(known.annotation):
                with pytest.raises(TypeError, match=rf"^{tunable}( of {name})? must be a number"):
                    kind(**{tunable: None})
                told += 1
    assert told > 80


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: post.SSGI(distance=SEVERAL), r"distance of SSGI must be a number, got \[1, 2\]"),
        (lambda: post.fxaa(LIT, subpixel=NONE), "subpixel must be a number or a 0-dim tensor, got NoneType"),
        (lambda: post.gtao(**SURFACES, radius=WORD), "radius must be a number or a 0-dim tensor, got 'x'"),
        (lambda: post.gtao(**SURFACES, method="horizon", thickness=WORD), "thickness must be a number"),
        (lambda: post.gtao(**SURFACES, method="horizon", hidden=NONE), "hidden must be a number"),
        (lambda: post.tone_map(LIT, operator=NONE), "operator and view must be texts, got None and ''"),
        (lambda: post.AerialPerspective(sun=NONE)(LIGHT), r"sun of the air must be three numbers .*, got None"),
        (lambda: post.AerialPerspective(atmosphere=NUMBER)(LIGHT), r"atmosphere must be a gbufrt\.Atmosphere, got int"),
        (lambda: post.SSGI(bounces=NAN)(LIGHT), "bounces must be a whole number, got nan"),
    ],
)
def test_what_is_no_number_is_named(call: Callable[[], Any], message: str):
    with pytest.raises(TypeError, match=f"^{message}"):
        call()


def test_an_assumed_thickness_is_named_also_where_the_frame_knows_it_better():
    measured = LIGHT.replace(gbuffer=LIGHT.gbuffer.replace(thickness=ONE, roughness=ONE))
    passes: list[tuple[str, Callable[..., Any]]] = [("thickness", post.GTAO), ("thickness", post.SSGI)]
    passes += [("assumed_thickness", post.SSR), ("assumed_thickness", post.MarchGI)]
    for frame in (LIGHT.replace(gbuffer=LIGHT.gbuffer.replace(roughness=ONE)), measured):
        for name, kind in passes:
            for bad in (-1.0, torch.nan):
                with pytest.raises(ValueError, match=f"^{name} must be at least 0, got {bad:g}$"):
                    kind(**{name: bad})(frame)
        with pytest.raises(ValueError, match=r"^thickness must be at least 0, got -1$"):
            post.GTAO(method="horizon", thickness=-1.0)(frame)


@pytest.mark.parametrize("kind", [post.GTAO, post.SSGI])
def test_a_factor_on_directions_is_named(kind: Callable[..., Any]):
    for bad in (-1, 0):
        with pytest.raises(ValueError, match=f"^fresh must be at least 1, got {bad}$"):
            kind(fresh=bad)(LIGHT)
    with pytest.raises(TypeError, match=r"^fresh must be a whole number, got 1\.5$"):
        kind(fresh=1.5)(LIGHT)


def test_what_is_out_of_range_or_nan_is_named():
    for bad in (-1.0, torch.nan):
        with pytest.raises(ValueError, match=r"^bounce_loss must be at least 0"):
            post.SSGI(bounce_loss=bad)(LIGHT)
        with pytest.raises(ValueError, match=r"^thickness must be at least 0"):
            post.gtao(**SURFACES, method="horizon", thickness=bad)
        later = LIGHT.replace(time=1.0, previous=LIGHT, color=LIT)
        with pytest.raises(ValueError, match=r"^target_frame_time must be positive, in seconds"):
            post.MotionBlur(target_frame_time=bad)(later)
    with pytest.raises(ValueError, match=r"^min_ev must not exceed max_ev, got nan"):
        post.exposure(LIT, min_ev=torch.nan)
