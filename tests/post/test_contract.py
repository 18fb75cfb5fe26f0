"""What every exported pass owes, whoever wrote it: house rules 1, 2 and 4, and frames that engines get wrong."""

from __future__ import annotations

import inspect

import boxes
import pytest
import torch
from stages import PASSES, dress, run, written

import post
from gbufrt import CHANNELS, SIGNALS, Pass, Stage, TemporalPass
from gbufrt.tree import map_tensors

FUNCTIONS = sorted(
    (v for v in vars(post).values() if inspect.isfunction(v) and v.__module__.startswith("post.")),
    key=lambda f: f.__name__,
)


@pytest.fixture(params=PASSES, ids=lambda c: c.__name__)
def stage(request) -> Stage:
    torch.manual_seed(0)
    return request.param()


def test_all_passes_are_exported():
    assert len(PASSES) >= 10
    assert set(post.__all__) <= set(vars(post))


def test_writes_what_it_says(stage):
    frame = dress(boxes.frame(boxes.camera((36, 48))))
    result = run(stage, frame, times=1)
    assert written(stage, result), "a pass must write something"
    changed = {n for n in (*SIGNALS, *result.extra) if result.get(n) is not frame.get(n)}
    assert changed <= stage.writes | {"previous"}, f"wrote {changed - stage.writes} without saying so"


def test_reads_what_it_says(stage):
    """Everything that is not declared may be absent."""
    frame = dress(boxes.frame(boxes.camera((36, 48))))
    kept = stage.reads
    g = frame.gbuffer
    bare = g.replace(**{n: None for n, row in CHANNELS.items() if not row.required and n not in kept})
    nothing = {n: None for n in SIGNALS if n not in kept}
    result = run(stage, frame.replace(gbuffer=bare, **nothing), times=1)
    for name, value in written(stage, result).items():
        assert torch.isfinite(value).all(), name


@pytest.mark.parametrize("case", ["odd", "orthographic", "sky", "one row", "one column", "jittered"])
def test_awkward_frames(stage, case):
    size = {"odd": (127, 73), "one row": (1, 9), "one column": (9, 1)}.get(case, (24, 32))
    camera = boxes.cameras(1, size, orthographic=case == "orthographic")
    camera = camera.with_jitter((0.3, -0.4)) if case == "jittered" else camera
    frame = dress(boxes.frame(camera, boxes=boxes.ROOM + 500 if case == "sky" else boxes.ROOM))
    for name, value in written(stage, run(stage, frame)).items():
        assert torch.isfinite(value).all(), name


def test_batch_equals_loop(stage):
    size = (30, 40)
    both = dress(boxes.frame(boxes.cameras(2, size)))
    together = written(stage, run(stage, both, times=3))
    for b in range(2):
        one = map_tensors(lambda t, b=b: t[b : b + 1] if t.shape[0] == 2 else t, both)
        for name, value in written(stage, run(stage, one, times=3)).items():
            worst = float((value[0] - together[name][b]).abs().max())
            assert torch.allclose(value[0], together[name][b], atol=2e-4, rtol=1e-3), f"{name} differs by {worst}"


def test_repeats_bit_for_bit_and_leaves_its_input_alone(stage):
    frame = dress(boxes.frame(boxes.camera((24, 32))))
    kept = map_tensors(torch.clone, frame)
    first, second = run(stage, frame), run(stage, frame)
    for name, value in written(stage, first).items():
        assert torch.equal(value, second.read(name)), name
    for name in frame.present:
        assert torch.equal(kept.read(name), frame.read(name)), f"{name} was changed in place"


def test_double_precision(stage):
    frame = dress(boxes.frame(boxes.camera((24, 32)))).to(torch.float64)
    for name, value in written(stage, run(stage, frame)).items():
        assert value.dtype == torch.float64, name


def test_module_is_thin_and_documented(stage):
    cls = type(stage)
    source = inspect.getsource(cls.forward).splitlines()
    body = [line for line in source if line.strip()][1:]
    assert len(body) <= 12, f"{cls.__name__}.forward is {len(body)} lines: move work into its function"
    assert cls.__doc__
    assert len(stage.tunables()) <= 9, "at most eight tunables, besides `seed`"
    assert type(stage)(**stage.tunables()).tunables() == stage.tunables()
    parameters = list(inspect.signature(cls.__init__).parameters.values())[1:]
    assert all(p.kind is p.KEYWORD_ONLY for p in parameters)
    assert isinstance(stage, (Pass, TemporalPass))


def test_every_tunable_has_a_meaning(stage):
    meanings = stage.meanings()
    assert list(meanings) == list(stage.tunables())
    assert not [name for name, text in meanings.items() if len(text) < 5 or "\n" in text or text.startswith("see ")]


@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda f: f.__name__)
def test_functions_are_documented(function):
    doc = inspect.getdoc(function) or ""
    names = [p for p in inspect.signature(function).parameters if p not in ("self",)]
    if function.__name__ != "me1":
        assert "Returns:" in doc, f"{function.__name__} must say what it returns"
    missing = [n for n in names if f"{n}:" not in doc and f"{n}``" not in doc]
    assert not missing, f"{function.__name__} does not document {missing}"
    assert all(p.kind is not p.VAR_KEYWORD for p in inspect.signature(function).parameters.values())


@pytest.mark.parametrize("function", [post.gtao, post.bitmask_ao, post.ssgi, post.ssr, post.march_gi])
def test_gatherers_take_their_arguments_in_one_order(function):
    """``(depth, normal, camera, light, material)``, and all that is optional by name."""
    parameters = list(inspect.signature(function).parameters.values())
    order = [p.name for p in parameters if p.kind is not p.KEYWORD_ONLY]
    material = {"ssr": "roughness"}.get(function.__name__, "albedo")
    assert order == ["depth", "normal", "camera", "light", material][: len(order)]
    optional = [p for p in parameters if p.kind is p.KEYWORD_ONLY]
    assert all(p.default is not p.empty for p in optional)
    assert {"hit", "thickness", "index", "seed"} <= {p.name for p in optional}


@pytest.mark.parametrize("function", [post.ssr, post.march_gi])
def test_hit_is_every_pixel_and_thickness_estimated_by_default(function):
    frame = boxes.frame(boxes.camera((24, 32)))
    g = frame.gbuffer
    inputs = (g.depth, g.normal + 1e-3, g.camera, frame.read("radiance"))
    material = g.roughness if function is post.ssr else g.albedo
    every = torch.ones_like(g.hit)
    solid = post.thickness_from_depth(*inputs[:3])
    plain, said = function(*inputs, material), function(*inputs, material, hit=every, thickness=solid)
    assert all(torch.equal(a, b) for a, b in zip(plain, said, strict=True))
    deep = function(*inputs, material, hit=every, thickness=torch.full_like(g.depth, 9.0))
    assert not all(torch.equal(a, b) for a, b in zip(plain, deep, strict=True))
