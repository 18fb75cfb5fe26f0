"""What mirrors show: how long it lasts where their normals turn, as on waves."""

from __future__ import annotations

import math

import boxes
import pytest
import torch
from torch import Tensor

from gbufrt import Frame, GBuffer
from post import ASVGF
from post.history.virtual import closer, image_kept, misfit, virtual_motion

SIZE, FAR = (24, 32), 50.0
TURN = 0.08  # radians


def mirror(turn: float | Tensor = 0.0, *, roughness: float = 0.05) -> GBuffer:
    """A room whose surfaces are smooth, with all normals turned about y."""
    g = boxes.frame(boxes.camera(SIZE)).gbuffer
    x, y, z = g.normal.split(1, dim=1)
    turn = torch.as_tensor(turn)
    normal = torch.cat([turn.cos() * x + turn.sin() * z, y, turn.cos() * z - turn.sin() * x], dim=1)
    return g.replace(normal=torch.where(g.hit, normal, 0.0), roughness=torch.where(g.hit, roughness, 1.0))


def upright(g: GBuffer) -> Tensor:
    """Surfaces whose normals turn about y."""
    return g.hit & (g.normal[:, 1:2].abs() < 0.5)


def lit(g: GBuffer, value: float) -> Frame:
    light = torch.where(g.hit, value, 0.0).expand(1, 3, *SIZE)
    return Frame(gbuffer=g).replace(specular=light, reflection_distance=torch.where(g.hit, FAR, 0.0))


def test_smooth_surfaces_keep_no_image_when_their_normals_turn():
    still, turned = image_kept(mirror(), mirror()), image_kept(mirror(TURN), mirror())
    assert bool((still == 1).all())
    here = upright(mirror())
    assert float(turned[here].max()) < 0.2
    rough = image_kept(mirror(TURN, roughness=1.0), mirror(roughness=1.0))
    assert float(rough[here].min()) > 0.99
    assert bool((turned[~mirror().hit] == 1).all())
    assert bool((image_kept(mirror(TURN).replace(roughness=None), mirror()) == 1).all())


@pytest.mark.parametrize(("turn", "least", "most"), [(0.0, 0.05, 0.2), (TURN, 0.7, 1.0)])
def test_specular_histories_give_way_where_normals_turn(turn: float, least: float, most: float):
    stage, state = ASVGF(signal="specular"), None
    with torch.no_grad():
        for _ in range(12):
            _, state = stage(lit(mirror(), 1.0), state)
        found, _ = stage(lit(mirror(turn), 2.0), state)
    share = found.read("specular")[upright(mirror()).expand(-1, 3, -1, -1)].mean() - 1
    assert least < float(share) < most


def test_specular_light_is_not_averaged_over_waves():
    """Two facets in turn, 3 degrees apart, with noise on each: each keeps its own light."""
    columns = torch.arange(SIZE[1]) // 4 % 2
    turn = (columns * math.radians(3.0)).view(1, 1, 1, -1)
    g = mirror(turn, roughness=0.2)
    noise = torch.rand(1, 1, *SIZE, generator=torch.Generator().manual_seed(1))
    light = torch.where(g.hit, 1 + 0.5 * columns + 2 * noise, 0.0).expand(1, 3, *SIZE)
    frame = lit(g, 1.0).replace(specular=light)
    with torch.no_grad():
        found, _ = ASVGF(signal="specular")(frame)
    here, light = upright(g)[0, 0], found.read("specular")[0, 0]
    first, second = light[here & (columns == 0)], light[here & (columns == 1)]
    assert float(second.mean() - first.mean()) > 0.4


def rare(g: GBuffer, share: float, seed: int) -> Tensor:
    """Light of mean 1, all of which a ``share`` of the samples brings."""
    chosen = torch.rand(g.depth.shape, generator=torch.Generator().manual_seed(seed)) < share
    return (chosen / share).expand(1, 3, *SIZE)


def test_of_two_histories_rare_bright_samples_do_not_choose_the_darker():
    g = mirror()
    samples, right = rare(g, 0.2, 1), torch.ones(1, 3, *SIZE)

    def chosen(by_means: bool) -> float:
        apart, darker = (misfit(x, samples, 3, rare=by_means) for x in (right, 0.3 * right))
        return float((apart < darker).float().mean())

    assert chosen(True) > 0.7
    assert chosen(False) < 0.2


def test_what_is_cut_of_rare_bright_reflections_is_given_back():
    stage, state, shares = ASVGF(signal="specular", firefly=3.0), None, list[float]()
    with torch.no_grad():
        for index in range(12):
            g = boxes.frame(boxes.camera(SIZE, dx=0.1 * index)).gbuffer
            g = g.replace(roughness=torch.full_like(g.depth, 0.15))
            frame = lit(g, 1.0)
            found, state = stage(frame.replace(specular=rare(g, 0.05, index) * frame.read("specular")), state)
            shares.append(float(found.read("specular")[g.hit.expand(-1, 3, -1, -1)].mean()))
    assert sum(shares[-6:]) / 6 > 0.95, "cuts take a third"


@pytest.mark.parametrize("size", [(9, 14), (1, 5), (2, 2)])
def test_the_closer_of_two_histories_by_the_kernel_is_that_of_the_reference(size: tuple[int, int]):
    one, other, signal = torch.rand((3, 2, 4, *size), generator=torch.Generator().manual_seed(0))
    where, other = signal[:, :1] > 0.3, torch.where(one[:, :1] > 0.5, signal + (other - signal) / 2, other)
    got, want = (closer(one, other, signal, where, compiled=form) for form in (True, False))
    assert torch.equal(got, want & where)
    assert bool((want != want[:1, :1, :1, :1]).any())


@pytest.mark.parametrize("parallel", [(False, False), (True, True), (False, True)])
def test_the_motion_of_images_by_the_kernel_equals_the_reference(parallel: tuple[bool, bool]):
    now = boxes.frame(boxes.cameras(2, SIZE, orthographic=parallel[0])).gbuffer
    now = now.replace(camera=now.camera.with_jitter((0.3, -0.4)))
    was = now.replace(camera=boxes.cameras(2, SIZE, apart=0.9, orthographic=parallel[1]).with_jitter((-0.2, 0.1)))
    distance = 8 * torch.rand(now.depth.shape, generator=torch.Generator().manual_seed(3))
    got, want = (virtual_motion(now, was, distance, compiled=form) for form in (True, False))
    torch.testing.assert_close(got, want, rtol=1e-4, atol=2e-4)
    still = virtual_motion(now, was, 0 * distance, compiled=False)
    assert all(parallel) or float((want - still).abs().mean()) > 0.01, "the distance counts"
