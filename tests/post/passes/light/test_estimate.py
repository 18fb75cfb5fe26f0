"""Guessed channels against the exact ones of the box scenes."""

from __future__ import annotations

import boxes
import pytest
import torch
from torch import Tensor

from gbufrt import Camera, Frame
from post.passes.light.estimate import (
    EstimateMissing,
    metallic_from_color,
    motion_from_depth,
    normals_from_depth,
    roughness_from_color,
)

SIZE = (72, 96)


def wrong_share(guess: Tensor, truth: Tensor, hit: Tensor, cosine: float = 0.99) -> float:
    return float(((guess * truth).sum(1, keepdim=True)[hit] < cosine).float().mean())


@pytest.mark.parametrize("orthographic", [False, True])
def test_edge_aware_normals_are_exact_up_to_the_edges(orthographic):
    camera = boxes.camera(SIZE, orthographic=orthographic)
    g = boxes.frame(camera).gbuffer
    aware = normals_from_depth(g.depth, camera, hit=g.hit)
    plain = normals_from_depth(g.depth, camera, hit=g.hit, method="plain")
    assert wrong_share(aware, g.normal, g.hit) < 0.02
    assert wrong_share(aware, g.normal, g.hit) < 0.4 * wrong_share(plain, g.normal, g.hit)
    assert torch.allclose(aware.norm(dim=1, keepdim=True)[g.hit], torch.tensor(1.0), atol=1e-3)
    assert float(aware.abs().amax(1, keepdim=True)[~g.hit].sum()) == 0.0


def test_normals_have_gradients():
    camera = boxes.camera((5, 6)).to(torch.float64)
    torch.manual_seed(0)
    depth = (8 + torch.rand(1, 1, 5, 6, dtype=torch.float64)).requires_grad_()
    (gradient,) = torch.autograd.grad(normals_from_depth(depth, camera)[:, 0].sum(), depth)
    assert float(gradient.abs().max()) > 1e-3
    assert torch.autograd.gradcheck(lambda d: normals_from_depth(d, camera), (depth,), eps=1e-7, atol=1e-4)


def test_motion_of_a_still_world_is_the_cameras():
    previous, camera = boxes.camera(SIZE, dx=-0.3), boxes.camera(SIZE)
    g, before = boxes.frame(camera, previous=previous).gbuffer, boxes.frame(previous).gbuffer
    assert g.motion is not None
    still, _ = motion_from_depth(g.depth, camera, before.depth, previous, hit=g.hit, radius=0)
    assert torch.allclose(still, g.motion, atol=1e-4)
    searched, _ = motion_from_depth(g.depth, camera, before.depth, previous, hit=g.hit)
    assert float((searched - g.motion).norm(dim=1).median()) < 0.1


def test_the_search_finds_a_mover():
    """A block in front of a far wall that moved two pixels to the right."""
    camera = Camera.look_at((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), size=(24, 32), far=100.0)
    depth, before = torch.full((1, 1, 24, 32), 50.0), torch.full((1, 1, 24, 32), 50.0)
    columns = torch.arange(10) * 0.5  # it is slanted, so that its depth tells its columns apart
    depth[..., 8:16, 14:24], before[..., 8:16, 12:22] = 10 + columns, 10 + columns
    motion, motion_z = motion_from_depth(depth, camera, before, camera, radius=3)
    assert torch.allclose(motion[0, 0, 9:15, 15:23], torch.tensor(-2.0), atol=1e-3)
    assert torch.allclose(motion[0, 1, 9:15, 15:23], torch.tensor(0.0), atol=1e-3)
    assert float(motion[0, :, 20:].abs().max()) < 1e-3
    assert float(motion_z[..., 9:15, 15:23].abs().max()) < 1e-3


def test_rough_is_where_detail_is():
    smooth = torch.linspace(0.5, 0.6, 32).expand(1, 3, 32, 32)
    rough = smooth + 0.3 * (torch.rand(1, 1, 32, 32, generator=torch.Generator().manual_seed(0)) - 0.5)
    assert float(roughness_from_color(smooth).max()) < 0.1
    assert float(roughness_from_color(rough).mean()) > 0.4
    assert torch.allclose(roughness_from_color(rough * 20), roughness_from_color(rough), atol=1e-4)


def test_metal_is_saturated_and_not_dark():
    gold, grey, dark = (torch.tensor(c).view(1, 3, 1, 1) for c in ([1.0, 0.8, 0.3], [0.8] * 3, [0.1, 0.05, 0.01]))
    assert float(metallic_from_color(gold)) > 0.5
    assert float(metallic_from_color(grey)) == 0.0
    assert float(metallic_from_color(dark)) == 0.0
    assert float(metallic_from_color(torch.zeros(1, 3, 1, 1))) == 0.0


@pytest.mark.parametrize("guess", [roughness_from_color, metallic_from_color])
def test_material_gradients(guess):
    torch.manual_seed(1)
    color = (0.4 + 0.1 * torch.rand(1, 3, 4, 5, dtype=torch.float64)).requires_grad_()
    (gradient,) = torch.autograd.grad(guess(color).sum(), color)
    assert float(gradient.abs().max()) > 1e-3
    assert torch.autograd.gradcheck(guess, (color,))


def test_pass_fills_what_is_missing_and_says_so():
    previous, camera = boxes.camera(SIZE, dx=-0.3), boxes.camera(SIZE)
    full = boxes.frame(camera, previous=previous)
    bare = full.replace(gbuffer=full.gbuffer.replace(motion=None, motion_z=None, metallic=None))
    filled = EstimateMissing()(bare.replace(previous=boxes.frame(previous)))
    assert filled.gbuffer.roughness is full.gbuffer.roughness
    assert set(filled.extra) == {"motion_estimated", "motion_z_estimated", "metallic_estimated"}
    g, before = bare.gbuffer, boxes.frame(previous).gbuffer
    expected, _ = motion_from_depth(g.depth, g.camera, before.depth, previous, hit=g.hit)
    assert filled.gbuffer.motion is not None
    assert torch.equal(filled.gbuffer.motion, expected)
    filled.gbuffer.validate()
    assert EstimateMissing()(full).gbuffer.present == full.gbuffer.present
    assert not EstimateMissing()(full).extra


def test_only_the_chosen_channels_are_filled():
    full = boxes.frame(boxes.camera(SIZE))
    bare = full.replace(gbuffer=full.gbuffer.replace(roughness=None, metallic=None, thickness=None))
    stage = EstimateMissing(channels=("thickness", "metallic"))
    filled = stage(bare)
    assert filled.gbuffer.roughness is None
    assert set(filled.extra) == {"thickness_estimated", "metallic_estimated"}
    assert stage.writes == {"thickness", "metallic"} | set(filled.extra)
    filled.gbuffer.validate()
    assert "thickness_estimated" in EstimateMissing()(bare).extra


def test_sky_alone_stays_empty():
    frame: Frame = boxes.frame(boxes.camera(SIZE), boxes=boxes.ROOM + 500)
    g = frame.gbuffer.replace(roughness=None, metallic=None, motion=None, motion_z=None)
    filled = EstimateMissing()(frame.replace(gbuffer=g)).gbuffer
    assert filled.metallic is not None
    assert float(filled.metallic.abs().max()) == 0.0
    assert float(normals_from_depth(g.depth, g.camera, hit=g.hit).abs().max()) == 0.0


def test_bad_input():
    camera = boxes.camera((4, 4))
    depth = torch.ones(1, 1, 4, 4)
    with pytest.raises(ValueError, match="method"):
        normals_from_depth(depth, camera, method="best")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="radius"):
        motion_from_depth(depth, camera, depth, camera, radius=-1)
    for wrong in (3, (), [None]):
        with pytest.raises(ValueError, match=r"^channels must be a name or several such as \('motion', .*, got"):
            EstimateMissing(channels=wrong)  # pyright: ignore[reportArgumentType]
    with pytest.raises(ValueError, match=r"channels must be some of motion, .*, got 'depth'"):
        EstimateMissing(channels="depth")
    with pytest.raises(ValueError, match="dark must be less than bright"):
        metallic_from_color(torch.rand(1, 3, 4, 4), dark=0.9, bright=0.1)
