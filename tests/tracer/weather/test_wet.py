"""Rain wets what stands under the open sky, and nothing else."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch
import voxels
from torch import Tensor

from gbufrt import Camera, GBuffer
from tracer import Rain, Scene, Waves, gbuffer
from tracer.scene.material import Material, MaterialTable
from tracer.scene.scene import MASK_ALL, MASK_PRIMARY, MASK_SHADOW, Instance
from tracer.scene.world import World
from tracer.weather.noise import noise3
from tracer.weather.ripples import CELL, LIFE, ripple_slopes
from tracer.weather.wet import RAYS

ROOF, HIGH = (16, 32), 11  # voxels along x and z that the roof covers; its underside
HARD = Rain(level=1.0, ripples=0.0)


def shed(*, water: bool = False, instances: tuple[Instance, ...] = ()) -> Scene:
    """A floor whose top is at 1, or a lake in it, and a roof over its middle with the camera beneath it."""
    a, b = ROOF
    boxes = [(voxels.STONE, (0, 0, 0), (48, 1, 48)), (voxels.STONE, (a, HIGH, a), (b, HIGH + 1, b))]
    if water:
        boxes.append((voxels.WATER, (0, 0, 0), (48, 1, 48)))
    return Scene(world=voxels.world((48, 12, 48), *boxes), instances=instances)


def seen(scene: Scene, rain: Rain | None, *, time: float = 0.0, span: float = 44.0, size: int = 88) -> GBuffer:
    """From under the roof straight down; picture right is +x."""
    camera = voxels.above(size=(size, size), span=span, height=HIGH - 1.0)
    return gbuffer(replace(scene, rain=rain), camera, time=time)


def read(found: GBuffer, name: str) -> Tensor:
    value = getattr(found, name)
    assert value is not None
    return value[0]


def under_roof(within: float) -> Tensor:
    """``(88, 88)`` bool: which pixels of `seen` lie under the roof, so far from its edge."""
    place = 24 - 22 + (torch.arange(88) + 0.5) * 44 / 88
    inside = (place > ROOF[0] + within) & (place < ROOF[1] - within)
    return inside[:, None] & inside[None]


def test_a_floor_under_a_roof_stays_dry_with_a_soft_border():
    dry, wet = seen(shed(), None), seen(shed(), HARD)
    slant = HARD.disc_radius * (HIGH - 1)
    kept, rained = under_roof(slant + 0.01), ~under_roof(-slant - 0.01)
    for name in ("roughness", "albedo", "metallic"):
        assert torch.equal(read(wet, name)[:, kept], read(dry, name)[:, kept])
    assert bool((read(wet, "roughness")[0, rained] < read(dry, "roughness")[0, rained]).all())
    row = read(seen(shed(), replace(HARD, puddle_low=0.0, puddle_high=1e-6)), "roughness")[0, 44]
    steps = row[(row > row.min()) & (row < row.max())]
    assert len(steps) > 8  # of half a unit each, on both sides together
    assert len(steps.unique()) > 3


def test_the_share_of_rain_is_the_part_of_the_disc_that_is_open():
    full = replace(HARD, puddle_low=0.0, puddle_high=1e-6)
    alpha = read(seen(shed(), full), "roughness")[0] ** 2
    dry, puddle = 0.9**2, full.puddle_roughness**2
    share = ((dry - alpha) / (dry - puddle))[36:52].mean(dim=0)  # along the edges, away from corners
    place = 2 + (torch.arange(88) + 0.5) / 2
    out = torch.maximum(ROOF[0] - place, place - ROOF[1]) / full.disc_radius
    out = torch.where(out < 0, out / (HIGH - 1), out / HIGH)  # its underside, and its upper edge
    t = out.clamp(-1, 1)
    wanted = 0.5 + (t * (1 - t * t).sqrt() + t.asin()) / torch.pi  # of a disc, on one side of a chord
    assert float((share - wanted).abs().max()) < 1 / RAYS


def test_the_formula_of_the_document():
    rain = replace(HARD, level=0.6, wetness=0.8)
    dry, wet = seen(shed(), None), seen(shed(), rain)
    points = wet.camera.to_world(wet.points_view())[0].permute(1, 2, 0)
    t = ((noise3(points / rain.puddle_scale) - rain.puddle_low) / (rain.puddle_high - rain.puddle_low)).clamp(0, 1)
    wetness = rain.level * rain.wetness * t * t * (3 - 2 * t)
    alpha = torch.lerp(
        read(dry, "roughness")[0] ** 2,
        torch.tensor(rain.puddle_roughness**2),
        wetness.clamp_min(rain.level * rain.uniform_wetness),
    )
    out = ~under_roof(-3.0)
    assert 0.2 < float((wetness[out] > 0.1).float().mean()) < 0.8
    torch.testing.assert_close(read(wet, "roughness")[0][out], alpha.sqrt()[out], atol=2e-3, rtol=0)
    darker = read(wet, "albedo")[0] / read(dry, "albedo")[0]
    torch.testing.assert_close(darker[out], (1 - 0.45 * wetness)[out], atol=2e-3, rtol=0)


def test_walls_are_wet_by_what_runs_down_and_ceilings_not_at_all():
    scene = Scene(world=voxels.world((20, 20, 20), (voxels.STONE, (4, 4, 4), (16, 16, 16))))
    for eye, share in (((10.5, 10.2, 40.0), HARD.runoff), ((10.3, -20.0, 10.2), 0.0)):
        camera = Camera.look_at(eye, (10.4, 10.1, 10.0), size=(16, 16), fov_y=15.0)
        wet, dry = (gbuffer(replace(scene, rain=rain), camera) for rain in (HARD, None))
        ratio = read(wet, "albedo") / read(dry, "albedo")
        torch.testing.assert_close(ratio, torch.full_like(ratio, 1 - 0.45 * share), atol=1e-5, rtol=0)


def test_puddles_are_not_on_what_moves():
    model = voxels.world((8, 1, 8), (voxels.STONE, (0, 0, 0), (8, 1, 8)))
    scene = shed(instances=(Instance(model=model, pose=lambda _: voxels.pose((3.0, 2.0, 3.0))),))
    wet, dry = seen(scene, HARD), seen(scene, None)
    ratio = (read(wet, "albedo") / read(dry, "albedo"))[0][read(wet, "object_id")[0] == 1]
    assert len(ratio) > 200
    torch.testing.assert_close(ratio, torch.full_like(ratio, 1 - 0.45 * HARD.runoff), atol=1e-5, rtol=0)


def test_what_casts_no_shadow_keeps_nothing_dry_and_metals_dull():
    table = MaterialTable.of([Material(name="iron", metallic=1.0, variation=0.0)])
    plate = World.from_dense(torch.ones(20, 1, 20, dtype=torch.int16), table)
    scene, camera = Scene(world=plate), Camera.look_at((10.0, 5.0, 10.1), (10.0, 0.0, 10.0), size=(8, 8))
    full = replace(HARD, puddle_low=0.0, puddle_high=1e-6, metalness_reduction=0.7)
    for mask, share in ((MASK_ALL & ~MASK_SHADOW, 1.0), (MASK_ALL & ~MASK_PRIMARY, 0.0)):
        cover = Instance(model=plate, pose=lambda _: voxels.pose((0.0, 3.0, 0.0)), mask=mask & ~MASK_PRIMARY)
        wet = gbuffer(replace(scene, instances=(cover,), rain=full), camera)
        metallic = read(wet, "metallic")
        torch.testing.assert_close(metallic, torch.full_like(metallic, 1 - 0.3 * share))


def test_falling_water_has_no_rings():
    scene = Scene(world=voxels.world((20, 20, 20), (voxels.WATER, (4, 4, 4), (16, 16, 16))))
    camera = Camera.look_at((10.5, 10.2, 20.0), (10.4, 10.1, 10.0), size=(64, 64), fov_y=30.0)
    wet, dry = (gbuffer(replace(scene, rain=rain), camera) for rain in (Rain(level=1.0), None))
    assert torch.equal(wet.normal, dry.normal)


def test_water_is_only_rippled_where_rain_falls_and_rings_move_and_fade_with_distance():
    rain = Rain(level=1.0)
    fine = {"span": 20.0, "size": 480}
    dry, wet, later = (
        seen(shed(water=True), r, time=time, **fine) for r, time in ((None, 0.0), (rain, 0.0), (rain, LIFE / 4))
    )
    for name in ("roughness", "albedo", "depth"):
        assert torch.equal(read(wet, name), read(dry, name))
    turned = (read(wet, "normal") != read(dry, "normal")).any(dim=0)
    place = 14 + (torch.arange(480) + 0.5) / 24
    slant = rain.disc_radius * (HIGH - 1)
    covered = (place > ROOF[0] + slant) & (place < ROOF[1] - slant)
    assert not bool(turned[covered][:, covered].any())
    assert float(turned[:10, :].float().mean()) > 0.02
    assert not torch.equal(read(wet, "normal"), read(later, "normal"))
    wet.validate()
    tilt = read(wet, "normal")[1].acos()
    assert 4 < float(torch.rad2deg(tilt.max())) < 30
    far = seen(shed(water=True), rain, size=40)
    assert torch.equal(read(far, "normal"), read(seen(shed(water=True), None, size=40), "normal"))


def test_rain_falls_on_waves_too():
    """Waves lie inside the voxels of still water, which are no cover."""
    lake = replace(shed(water=True), waves=Waves(amplitude=0.3))
    wet, dry = (seen(lake, rain, span=20.0, size=320) for rain in (Rain(level=1.0), None))
    turned = (read(wet, "normal") != read(dry, "normal")).any(dim=0)
    assert float(turned[:10].float().mean()) > 0.02
    assert not bool(turned[100:220, 100:220].any())


def test_rings_have_no_edges_and_less_rain_has_fewer():
    place = torch.linspace(0, 12, 24001, dtype=torch.float64)
    line = torch.stack([place, torch.full_like(place, 3.1)], dim=-1)
    still, sharp = torch.zeros_like(place), torch.full_like(place, 1e4)
    slopes = ripple_slopes(line, still, 1.0, sharp)
    assert float(slopes.diff(dim=0).abs().max()) < 0.05
    assert float(slopes.norm(dim=-1).max()) > 0.3
    grid = torch.rand(20000, 2, generator=torch.Generator().manual_seed(1)).double() * 40 * CELL
    shares = [
        float((ripple_slopes(grid, still[:20000], level, sharp[:20000]) != 0).any(dim=-1).double().mean())
        for level in (0.0, 0.3, 1.0)
    ]
    assert shares[0] == 0
    assert 0 < shares[1] < 0.5 * shares[2]


def test_noise_spans_its_range_without_steps():
    g = torch.Generator().manual_seed(2)
    values = noise3(torch.rand(100_000, 3, generator=g) * 50 - 25)
    assert 0 <= float(values.min()) < 0.1
    assert 0.9 < float(values.max()) <= 1
    assert abs(float(values.mean()) - 0.5) < 0.02
    line = torch.linspace(-3, 3, 60001, dtype=torch.float64)
    along = noise3(torch.stack([line, line * 0.3, line * -0.7], dim=-1))
    step = float(line[1] - line[0])
    assert float(along.diff().abs().max()) / step < 4
    assert float(along.diff(n=2).abs().max()) / step**2 < 30
    assert not torch.equal(values, noise3(torch.rand(100_000, 3, generator=g.manual_seed(2)) * 50 - 25, seed=1))


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"level": -0.1}, "level of rain must lie in 0..1, got -0.1"),
        ({"level": 2.0}, "level of rain must lie in 0..1, got 2"),
        ({"level": 1.0, "puddle_scale": 0.0}, "puddle_scale of rain must be 0.001 or more"),
        ({"level": 1.0, "puddle_low": 0.6, "puddle_high": 0.5}, "puddle_low must be less than puddle_high"),
        ({"level": 1.0, "ripples": float("nan")}, "ripples of rain must lie in 0..100"),
    ],
)
def test_bad_values_get_one_line(values: dict[str, float], message: str):
    with pytest.raises(ValueError, match=message):
        Rain(**values)
