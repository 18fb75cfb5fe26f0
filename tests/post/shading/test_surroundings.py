"""What lies beyond a picture is guessed from what the picture shows in other directions."""

from __future__ import annotations

from functools import partial

import boxes
import pytest
import torch
from mirrors import SkyAlone

import tracer
from gbufrt import Camera, Frame, Pipeline
from gbufrt.environment import lookup_environment
from gbufrt.luminance import luminance
from post import SSGI, SSR, ssr
from post.shading.incoming import off_horizon
from post.shading.sent_light import outgoing_light
from post.shading.surroundings import look_around
from tracer.scene.scene import Scene, Sky

LEVEL = Camera.look_at((0.0, 2.0, 0.0), (0.0, 2.0, -1.0), size=(36, 64), fov_y=60.0, far=100.0)
DOWN, BACK, LEFT, RIGHT = (0.0, -0.3, -1.0), (0.0, 0.1, 1.0), (-1.0, 0.05, -0.6), (1.0, 0.05, -0.6)


def at(around: torch.Tensor, *directions: tuple[float, float, float]) -> torch.Tensor:
    """``(N, C)``."""
    ways = torch.nn.functional.normalize(torch.tensor(directions), dim=1)
    return lookup_environment(around, ways.T[None, :, None])[0, :, 0].T


def test_a_picture_of_one_colour_is_continued_everywhere():
    hit = torch.ones(1, 1, 36, 64, dtype=torch.bool)
    around, sky = look_around(torch.tensor([0.2, 0.4, 0.1]).view(1, 3, 1, 1).expand(1, 3, 36, 64), hit, LEVEL)
    for found in (around[:, :3], sky):
        assert torch.allclose(found, torch.tensor([0.2, 0.4, 0.1]).view(1, 3, 1, 1), atol=1e-4)
    assert float(at(around, DOWN, BACK)[:, 3].max()) < 0.3, "nowhere does this picture show sky"
    assert float(at(around, (0.0, 1.0, 0.0))[:, 3]) == pytest.approx(1.0, abs=0.02), "but it does not show the zenith"


def test_the_skyline_goes_round_and_left_is_left():
    """Above the horizon sky, below it ground that is red on the left and green on the right."""
    rows, columns = torch.meshgrid(torch.arange(36), torch.arange(64), indexing="ij")
    hit = (rows >= 18)[None, None]
    ground = torch.stack([columns < 32, columns >= 32, 0 * columns]).float()[None]
    around, sky = look_around(torch.where(hit, ground, torch.tensor([0.1, 0.2, 0.9]).view(1, 3, 1, 1)), hit, LEVEL)
    left, right, back = at(around, (-1.0, -0.3, -0.6), (1.0, -0.3, -0.6), (0.0, -0.3, 1.0))
    assert left[0] > 4 * left[1]
    assert right[1] > 4 * right[0]
    assert float(back[0]) == pytest.approx(float(back[1]), rel=0.05)
    assert float(back[3]) < 0.2, "ground is ground behind the camera too"
    assert float(at(around, (0.0, 0.5, 1.0))[0, 3]) > 0.9
    assert torch.allclose(sky, torch.tensor([0.1, 0.2, 0.9]).view(1, 3, 1, 1), atol=0.03)


def test_the_sea_hides_nothing_of_the_sky_over_it():
    hit = (torch.arange(36) >= 18).view(1, 1, 36, 1).expand(1, 1, 36, 64)
    around, _ = look_around(torch.full((1, 3, 36, 64), 0.2), hit, LEVEL)
    low = [(x, up, z) for up in (0.01, -0.01) for x, z in ((-1.0, -0.6), (1.0, -0.6), (0.0, 1.0))]
    open_share = lookup_environment(around, off_horizon(torch.tensor(low).T[None, :, None]))[0, 3, 0]
    assert float(open_share[:3].min()) > 0.98  # 0.5 where the rows next to the horizon mix; 0.8 of it is not believed
    assert float(open_share[3:].max()) < 0.03


def test_a_picture_of_the_ground_alone_says_nothing_of_the_sky():
    down = Camera.look_at((0.0, 2.0, 0.0), (0.0, 0.0, -1.0), size=(36, 64), fov_y=60.0, far=100.0)
    around, _ = look_around(torch.full((1, 3, 36, 64), 0.2), torch.ones(1, 1, 36, 64, dtype=torch.bool), down)
    low, high = at(around, (0.0, 0.1, -1.0), (0.0, 0.5, -1.0))[:, 3]
    assert 0.2 < float(low) < 0.6
    assert float(high) > 0.9


@pytest.mark.parametrize("grad", [False, True])
def test_the_sides_of_an_open_sea_mirror_the_sky_whatever_a_hair_of_openness(*, grad: bool):
    """A sweep finds nearly all of the sky open, a little less or more from pixel to pixel."""
    camera = Camera.look_at((0.0, 2.0, 0.0), (0.0, 1.6, -2.0), size=(36, 64), fov_y=60.0, far=100.0)
    rays = camera.rays()[1].movedim(-1, 1)
    hit = rays[:, 1:2] < -0.02
    ahead = (rays * camera.forward.view(1, 3, 1, 1)).sum(1, keepdim=True)
    depth = torch.where(hit, -2.0 * ahead / rays[:, 1:2], 100.0).requires_grad_(grad)
    up = torch.tensor([0.0, 1.0, 0.0]).view(1, 3, 1, 1).expand(1, 3, 36, 64) * hit
    light = torch.where(hit, 0.05, 1.0).expand(1, 3, 36, 64)
    visibility = 0.965 + 0.002 * torch.rand(1, 1, 36, 64, generator=torch.Generator().manual_seed(1))
    mirror = partial(ssr, hit=hit, f0=torch.ones_like(up), environment=torch.ones(1, 3, 32, 64), bent_normal=up)
    found = mirror(depth, up, camera, light, torch.zeros(1, 1, 36, 64), visibility=visibility)[0]
    shown = found.detach()[0, 0, 15:]
    assert float(shown.min()) > 0.9 * float(shown.median()), "some were a sixth darker"


def test_lamps_are_no_surroundings_and_black_pictures_are_black():
    hit = torch.ones(2, 1, 36, 64, dtype=torch.bool)
    camera = boxes.cameras(2, (36, 64))
    light = torch.full((2, 3, 36, 64), 0.5)
    light[0, :, 4:6, 7:9], light[1] = 100.0, 0.0
    lit, dark = look_around(light, hit, camera)[0]
    assert float(lit[:3].max()) < 0.6  # 1.8 where lamps count in full
    assert float(dark[:3].abs().max()) == 0.0


def court() -> tuple[Scene, Camera]:
    """A court with red walls on four sides, and a gold pillar in its middle, seen from inside."""
    cells = torch.zeros(33, 14, 33, dtype=torch.int16)
    cells[:, 0] = 1
    cells[[0, -1], 1:] = 2
    cells[:, 1:, [0, -1]] = 2
    cells[14:19, 1:6, 10:13] = 3
    materials = tracer.MaterialTable.of(
        [
            tracer.Material(name="stone", albedo=(0.5, 0.5, 0.5)),
            tracer.Material(name="brick", albedo=(0.6, 0.2, 0.1)),
            tracer.Material(name="gold", albedo=(1.0, 0.7, 0.3), metallic=1.0, roughness=0.1),
        ]
    )
    sun = tracer.Sun(direction=(0.0, 1.0, 0.0), irradiance=(3.0, 2.9, 2.7))
    scene = Scene(world=tracer.World.from_dense(cells, materials), sun=sun, sky=Sky())
    return scene, Camera.look_at((16.5, 4.0, 26.0), (16.5, 4.0, 12.0), size=(54, 96), fov_y=60.0, far=200.0)


def error(frame: Frame, truth: torch.Tensor, *, surroundings: bool = True) -> float:
    """Relative squared error of the luminance that metal shows."""
    stage = SSR(samples=4) if surroundings else SkyAlone(samples=4)
    found = torch.stack([stage(frame.replace(index=i)).read("reflection") for i in range(4)]).mean(0)
    metal, true = frame.read("metallic") > 0.5, luminance(truth)
    assert int(metal.sum()) > 200
    return float((luminance(found) - true)[metal].square().sum() / true[metal].square().sum())


def test_gold_that_looks_back_shows_the_wall_behind_the_camera():
    """Without a guess it shows sky, or black where no sky is given."""
    scene, camera = court()
    frame = tracer.render(scene, camera)
    frame = Pipeline(gi=SSGI(directions=4))(frame)[0].replace(gi=None)  # the truth has light that came straight
    truth = tracer.reflection(scene, frame.gbuffer, samples=32)["reflection"]
    alone = frame.replace(environment=None)
    assert error(frame, truth) < 0.3 * error(frame, truth, surroundings=False)
    assert error(alone, truth) < 0.8 * error(alone, truth, surroundings=False)


def test_of_a_picture_without_environment_mirrors_show_the_sky_that_it_shows():
    scene = boxes.frame(boxes.camera((45, 60)), boxes=boxes.ROOM[:1])
    g = scene.gbuffer
    g = g.replace(metallic=torch.ones_like(g.depth), roughness=torch.zeros_like(g.depth))
    light = torch.where(g.hit, 0.05, torch.tensor([0.3, 0.5, 0.9]).view(1, 3, 1, 1))
    frame = Frame(gbuffer=g.replace(albedo=torch.ones_like(light)), radiance=light)
    assert torch.equal(outgoing_light(frame), light)
    shown = SSR(samples=1)(frame).read("reflection")[:, :, :25]
    found = shown.movedim(1, 0)[:, g.hit[:, 0, :25]]
    assert found.shape[1] > 100
    assert torch.allclose(found.mean(1), torch.tensor([0.3, 0.5, 0.9]), rtol=0.05)


def test_an_orthographic_picture_tells_where_its_walls_are():
    """All its pixels look one way, down: by that alone nothing is above the horizon."""
    room = Camera.look_at((5.0, 6.0, 5.0), (0.0, 1.0, 0.0), size=(36, 64), orthographic_height=8.0, far=100.0)
    origins, ways = room.rays()
    floor, wall = -origins[..., 1] / ways[..., 1], (-3.0 - origins[..., 0]) / ways[..., 0]
    on_wall = ((wall < floor) & (origins[..., 1] + wall * ways[..., 1] < 3.0))[:, None]
    depth = torch.where(on_wall, wall[:, None], floor[:, None])
    light = torch.where(on_wall, torch.tensor([0.8, 0.1, 0.1]).view(1, 3, 1, 1), 0.3)
    hit = torch.ones_like(on_wall)
    red, other = (
        at(look_around(light, hit, room, depth)[0], (side, 0.2, 0.0), (side, 0.9, 0.0)) for side in (-1.0, 1.0)
    )
    assert float(red[0, 0]) > 4 * float(red[0, 1])
    assert float(red[0, 3]) < 0.5 < float(other[1, 3])
    blind = at(look_around(light, hit, room)[0], (-1.0, 0.2, 0.0))
    assert float(blind[0, 3]) > 0.5
