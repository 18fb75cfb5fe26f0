"""Compiled temporal anti-aliasing against its torch reference."""

from __future__ import annotations

from typing import Any

import boxes
import pytest
import torch
from torch import Tensor

from post.history.op import anti_alias, anti_alias_cpu
from post.history.taa_reference import dilated
from post.passes.lens.taa import ray_matrix

BLEND, GAMMA = 0.93, 1.25
FORMS = (True, False)


def noise(size: tuple[int, int], channels: int, seed: int = 0) -> Tensor:
    return torch.rand((1, channels, *size), generator=torch.Generator().manual_seed(seed))


def inputs(size: tuple[int, int] = (127, 73), *, orthographic: bool = False, sky: bool = False) -> dict[str, Any]:
    """A camera that moves, light with texture, and a history that shows another light and has holes."""
    before = boxes.camera(size, orthographic=orthographic)
    camera = boxes.camera(size, dx=0.35, orthographic=orthographic)
    frame = boxes.frame(camera, previous=before, boxes=boxes.ROOM + 500 if sky else boxes.ROOM)
    g = frame.gbuffer
    color = frame.read("radiance") + 3 * noise(size, 3) ** 4
    toned = color / (1 + color)
    assert g.motion is not None
    return {
        "color": color,
        "jitter": torch.tensor([[0.31, -0.22]]),
        "depth": torch.where(g.hit, g.depth, torch.inf),
        "normal": g.normal,
        "rays": ray_matrix(camera),
        "parallel": orthographic,
        "motion": g.motion + 0.2 * noise(size, 2, 1) + torch.tensor([1.3, -0.6]).view(1, 2, 1, 1),
        "before": (toned * (0.6 + 0.8 * noise(size, 3, 2))).clamp_max(0.98),
        "age": torch.floor(16 * noise(size, 1, 3)) * (noise(size, 1, 4) > 0.1),
    }


CASES = {
    "moving": {},
    "orthographic": {"orthographic": True},
    "sky": {"sky": True},
    **{f"{h}x{w}": {"size": (h, w)} for h, w in ((1, 1), (1, 9), (9, 1), (2, 3))},
}


def both(given: dict[str, Any], *, blend: float = BLEND, gamma: float = GAMMA) -> tuple[tuple[Tensor, ...], ...]:
    got, want = (anti_alias(**given, blend=blend, gamma=gamma, compiled=form) for form in FORMS)
    return got, want


def assert_close(got: tuple[Tensor, ...], want: tuple[Tensor, ...]) -> None:
    light, toned, length = want
    assert torch.equal(got[2], length)
    torch.testing.assert_close(got[1], toned, rtol=0, atol=2e-4)
    torch.testing.assert_close(got[0] / (1 + got[0]), light / (1 + light), rtol=0, atol=2e-4)


@pytest.mark.parametrize("case", CASES)
def test_forms_agree(case: str) -> None:
    given = inputs(**CASES[case])
    got, want = both(given)
    assert_close(got, want)
    if min(want[0].shape[2:]) > 9:
        fresh = (want[2] == 1).float().mean()
        assert 0.05 < float(fresh) < 0.5, "some pixels have no history"
        assert float((want[0] - given["color"]).abs().mean()) > 0.05


@pytest.mark.parametrize("change", ["without history", "without jitter", "still", "blend", "gamma", "dark and bright"])
def test_other_inputs(change: str) -> None:
    given, tunables = inputs(), {"blend": BLEND, "gamma": GAMMA}
    if change == "without history":
        given["before"] = None
    elif change == "without jitter":
        given["jitter"] = None
    elif change == "still":
        given["motion"] = torch.zeros_like(given["motion"])
    elif change == "dark and bright":
        given["color"] = torch.cat([1e-3 * given["color"][..., :40], 1e4 * given["color"][..., 40:]], dim=-1)
    else:
        tunables[change] = 0.4
    ordinary, (got, want) = both(inputs())[0], both(given, **tunables)
    assert_close(got, want)
    assert not torch.equal(got[0], ordinary[0])


@pytest.mark.parametrize("compiled", FORMS)
def test_light_of_pure_colours_never_falls_below_none(compiled: bool) -> None:
    """A box of luma and chroma around pure colours holds some that are less than no light."""
    given = inputs()
    given["color"] = torch.where(noise((127, 73), 3, 5) > 0.6, 4.0, 0.0)
    given["before"] = noise((127, 73), 3, 6) ** 4
    light, toned, _ = anti_alias(**given, blend=BLEND, gamma=GAMMA, compiled=compiled)
    assert float(light.min()) >= 0
    assert float(toned.min()) >= 0


def wall(size: tuple[int, int] = (15, 15)) -> dict[str, Any]:
    """A wall that faces the camera, and stays."""
    still = {"depth": torch.full((1, 1, *size), 9.0), "motion": torch.zeros(1, 2, *size)}
    return {name: given for name, given in inputs(size).items() if name not in ("normal", "rays")} | still


def test_what_is_in_front_moves_an_edge() -> None:
    """A near pixel in the middle moves; those around it move with it, and all others stay."""
    given = wall()
    given["depth"][..., 7, 7], given["motion"][..., 7, 7] = 2.0, 3.25
    got, want = both(given)
    assert_close(got, want)
    still = both(given | {"motion": torch.zeros(1, 2, 15, 15)})[0]
    moved = (got[1] != still[1]).any(dim=1)[0]
    assert bool(moved[6:9, 6:9].any())
    moved[6:9, 6:9] = False
    assert not moved.any()


@pytest.mark.parametrize("parallel", [False, True])
def test_a_leaning_surface_is_not_in_front_of_itself(parallel: bool) -> None:
    """A surface that leans moves at one pixel: those beside it take that motion where it is off their plane alone."""
    for off, expected in ((0.0, 1), (6.0, 9)):
        given, camera = wall(), boxes.camera((15, 15), orthographic=parallel)
        normal = camera.rotate_to_world(torch.tensor([0.8, 0.0, -0.6]).view(1, 3, 1, 1).expand(1, 3, 15, 15))
        origin = camera.unproject(torch.zeros(1, 1, 15, 15))
        facing = camera.rotate_to_view(normal)
        along = (facing * (camera.unproject(torch.ones(1, 1, 15, 15)) - origin)).sum(1, keepdim=True)
        given["depth"] = ((facing[:, 2:] * 9 - (facing * origin).sum(1, keepdim=True)) / along).contiguous()
        plane = {"normal": normal, "rays": ray_matrix(camera), "parallel": parallel}
        given["depth"][..., 7, 7] -= off
        given["motion"][..., 7, 7] = 3.25
        got, want = both(given | plane)
        assert_close(got, want)
        still = both(given | plane | {"motion": torch.zeros(1, 2, 15, 15)})[0]
        assert int((got[1] != still[1]).any(dim=1).sum()) == expected


def test_of_what_is_in_front_the_pixel_at_its_edge_counts() -> None:
    """A body rounds off to the left; the wall beside it moves as the body does at its edge, not as where it is near.

    In some rows a pole stands before the edge: the wall moves with that there.
    """
    given = wall()
    given["age"][:] = 4.0
    edge = 6.0 - 0.01 * torch.arange(15.0)  # so that no two rows are alike
    given["depth"][..., 7], given["depth"][..., 8:] = edge, 5.7
    given["motion"][..., 7] = 1.0
    given["depth"][..., 10:, 7], given["motion"][..., 10:, 7] = 2.0, 2.0
    moved = dilated(given["motion"], given["depth"], torch.zeros(1, 3, 15, 15), torch.zeros(1, 3, 3), False)
    assert moved[0, 0, :, 6].tolist() == [1.0] * 9 + [2.0] * 6
    got, want = both(given)
    assert_close(got, want)


def test_motion_and_depth_that_are_not_finite() -> None:
    given = inputs()
    given["motion"][..., :9], given["motion"][..., 9:20] = torch.inf, torch.nan
    given["motion"][..., 20:30] = -1e30
    given["depth"][..., 40:60, 50:60] = torch.nan
    got, want = both(given)
    assert_close(got, want)
    assert bool((got[2][..., :29] == 1).all())


def test_batch_equals_loop() -> None:
    one, other = inputs(), inputs(orthographic=True)
    other["jitter"] = -one["jitter"]
    other["parallel"] = False
    tensors: dict[str, Any] = {n: torch.cat([one[n], other[n]]) for n in one if n != "parallel"}
    together = anti_alias(**tensors, blend=BLEND, gamma=GAMMA, compiled=True)
    for i, given in enumerate((one, other)):
        alone = anti_alias(**given, blend=BLEND, gamma=GAMMA, compiled=True)
        assert all(torch.equal(a[i : i + 1], b) for a, b in zip(together, alone, strict=True))


def test_threads_and_layout_do_not_matter() -> None:
    given, count = inputs(), torch.get_num_threads()
    kept = {name: tensor.clone() for name, tensor in given.items() if name != "parallel"}
    want = anti_alias(**given, blend=BLEND, gamma=GAMMA, compiled=True)
    try:
        torch.set_num_threads(1)
        strided = given | {n: given[n].contiguous(memory_format=torch.channels_last) for n in ("color", "before")}
        got = anti_alias(**strided, blend=BLEND, gamma=GAMMA, compiled=True)
    finally:
        torch.set_num_threads(count)
    assert all(torch.equal(a, b) for a, b in zip(got, want, strict=True))
    assert all(torch.equal(given[name], tensor) for name, tensor in kept.items())


@pytest.mark.parametrize("name", ["color", "motion", "before"])
def test_gradients_choose_the_reference(name: str) -> None:
    given = inputs((20, 30))
    given[name].requires_grad_()
    anti_alias(**given, blend=BLEND, gamma=GAMMA)[0].sum().backward()
    assert float(given[name].grad.abs().max()) > 1e-3


def test_operator_is_registered_properly() -> None:
    given = inputs((7, 9))
    planes = (given[n] for n in ("depth", "normal", "rays", "motion", "before", "age"))
    operands = given["color"], torch.rand(1, 2, 3), *planes, False
    torch.library.opcheck(anti_alias_cpu, (*operands, BLEND, GAMMA), test_utils=("test_schema", "test_faketensor"))
