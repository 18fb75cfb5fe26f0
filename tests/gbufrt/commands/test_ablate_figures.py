"""The ablation's figures on pictures whose errors are known, its charts, and its table."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import boxes
import pytest
import torch

from gbufrt.commands.ablation.cache import Cache, digest
from gbufrt.commands.ablation.figures.display import changed_pixels, display, exposure_of, unbiased
from gbufrt.commands.ablation.figures.errors import (
    by_onscreen_points,
    gain,
    relative_energy,
    rms_error,
    share_of_error,
    share_of_pixels,
)
from gbufrt.commands.ablation.figures.pictures import picture_figures
from gbufrt.commands.ablation.figures.trivial import constant_per_object
from gbufrt.commands.ablation.measure import Allocations
from gbufrt.commands.ablation.records import Record
from gbufrt.commands.ablation.table import table
from gbufrt.commands.charts.drawing import Point, dots, scatter


def test_relative_energy_and_the_constant_per_object():
    frame = boxes.frame()
    g, truth = frame.gbuffer, frame.read("radiance")
    assert relative_energy(truth * 1.5, (truth, truth), g.hit) == pytest.approx(0.25, rel=1e-5)
    assert relative_energy(truth * 0, (truth, truth), g.hit) == 1.0
    halves = (g.depth < 8).to(torch.int32)
    g = g.replace(material_id=halves, object_id=torch.zeros_like(halves))
    constant = constant_per_object(truth, g)
    for number in (0, 1):
        inside = ((g.material_id == number) & g.hit).expand_as(truth)
        assert torch.allclose(constant[inside].view(3, -1).mean(1), truth[inside].view(3, -1).mean(1), atol=1e-4)
        assert float(constant[inside].view(3, -1).std(1).max()) < 1e-6
    assert 0 < relative_energy(constant, (truth, truth), g.hit) < 1


def test_the_noise_of_two_halves_of_a_truth_counts_for_nothing():
    g = torch.Generator().manual_seed(0)
    true = torch.rand(1, 3, 200, 200, generator=g)
    noisy = [true + 0.05 * torch.randn(true.shape, generator=g) for _ in range(2)]
    hit = torch.ones(1, 1, 200, 200, dtype=torch.bool)
    assert float(rms_error(true + 0.1, (noisy[0], noisy[1]), hit)) == pytest.approx(0.1, abs=0.005)
    want = relative_energy(true * 0.8, (true, true), hit)
    assert relative_energy(true * 0.8, (noisy[0], noisy[1]), hit) == pytest.approx(want, abs=0.003)
    found = gain(true + 0.01, true + 0.1, (noisy[0], noisy[1]), hit)
    assert found == pytest.approx(20.0, abs=1.0)
    assert gain(true + 0.1, true + 0.1, (noisy[0], noisy[1]), hit) == 0.0


def test_what_is_displayed_of_two_noisy_halves_has_less_bias_than_their_mean():
    """Hardly any under even noise, and half as much where one path in ten brings all the light."""
    g, shape = torch.Generator().manual_seed(1), (32, 1, 3, 100, 100)
    wanted = float(display(torch.full((1, 3, 1, 1), 0.3), 2.0).mean())
    even, rare = 0.6 * torch.rand(2, *shape, generator=g), 3.0 * (torch.rand(2, *shape, generator=g) < 0.1)
    for light, share in ((even, 0.1), (rare, 0.6)):
        first, second = light.mean(dim=1)
        bias = float(display((first + second) / 2, 2.0).mean()) - wanted
        assert bias < -5e-4
        assert abs(float(unbiased((first, second), 2.0).mean()) - wanted) < share * -bias


def test_gain_counts_the_changed_pixels_alone():
    truth = torch.full((1, 3, 20, 20), 0.5)
    worse, better = truth.clone(), truth.clone()
    worse[..., :10] += 0.2
    better[..., :10] += 0.02
    better[..., 10:] += 0.004  # less than two levels
    changed = changed_pixels(worse, better)
    assert int(changed.sum()) == 200
    assert gain(better, worse, truth, changed) == pytest.approx(20.0, abs=1e-3)
    assert math.isnan(gain(better, worse, truth, changed & False))


def test_the_error_where_not_all_light_is_from_points_in_sight_is_told_apart():
    truth = torch.full((1, 3, 20, 20), 0.5)
    onscreen = truth.clone()
    onscreen[..., :5] *= 0.98
    onscreen[..., 5:10] *= 0.995  # too little for the split
    sees = by_onscreen_points((onscreen, onscreen), (truth, truth))
    assert int(sees.sum()) == 300
    assert not bool(sees[..., :5].any())
    picture = truth.clone()
    picture[..., :5] += 0.3
    picture[..., 5:] += 0.1
    everywhere = sees | ~sees
    assert share_of_pixels(~sees, everywhere) == 0.25
    assert share_of_error(picture, (truth, truth), ~sees, everywhere) == pytest.approx(0.75, rel=1e-4)
    assert share_of_error(picture, (truth, truth), sees & False, everywhere) == 0.0
    assert math.isnan(share_of_error(picture, (truth, truth), ~sees, everywhere & False))


def test_display_is_fixed_by_the_truth():
    truth = torch.full((1, 3, 8, 8), 0.36)
    hit = torch.ones(1, 1, 8, 8, dtype=torch.bool)
    assert exposure_of(truth, hit) == pytest.approx(0.5, rel=1e-5)
    shown = display(truth * 1e6, 0.5)
    assert bool((shown <= 1).all())
    assert bool((display(-truth, 0.5) == 0).all())
    figures = picture_figures(truth * 1.1, truth, hit, 0.5)
    assert figures["rmse"] == pytest.approx(0.018, rel=1e-4)
    assert set(figures) >= {"rmse", "psnr", "ssim"}


def test_the_worst_view_is_the_figure():
    def record(view: str, value: float, **more: object) -> Record:
        given = {"world": "builtin", "view": view, "subject": "signals", "variant": "full"}
        return Record(**{**given, "figures": {"ao.rmse": value, "ao.if_open": 2 * value}, **more})  # pyright: ignore[reportArgumentType]

    row = table([record("a", 0.02), record("b", 0.05), record("b", 0.9, variant="without=ao")])[0]
    assert (row.value, row.view, row.reached, row.trivial["ao = 1"]) == (0.05, "b", True, 0.1)
    assert table([record("a", 0.061)])[0].reached is False
    none = table([record("a", 0.0, figures={}, error="ValueError: why")])[0]
    assert (none.value, none.reached, none.note) == (None, None, "ValueError: why")


def test_charts_are_well_formed():
    points = [Point(x=float(i), y=float(i % 3), label=f"<{i}> & more", group="passes") for i in range(8)]
    for chart in (
        scatter(points, x_label="ms", y_label="dB"),
        scatter(points[:1], x_label="ms", y_label="dB", line=True),
        dots([("without gi", {"a": 1.0, "b": -0.5}), ("without ao", {"a": 0.0})], label="dB"),
    ):
        root = ElementTree.fromstring(chart)
        circles = [node for node in root.iter() if node.tag == "circle"]
        assert circles
        for node in circles:
            assert 0 <= float(node.attrib["cx"]) <= 760
        assert "nan" not in chart
    assert scatter([], x_label="", y_label="") == ""
    assert dots([], label="") == ""


def test_memory_is_what_lives_at_once():
    with Allocations() as watch:
        kept = torch.zeros(1000)
        for _ in range(5):
            kept = kept + 1
        view = kept[:10]
    assert watch.peak == 2 * 4000
    assert watch.live == 4000
    assert view.shape == (10,)


def test_contents_have_names(tmp_path: Path):
    a = torch.arange(6.0)
    assert digest(a, 1) == digest(a.clone(), 1)
    assert len({digest(a), digest(a + 1), digest(a.view(2, 3)), digest(a.double()), digest([a]), digest({"a": a})}) == 6
    cache = Cache(tmp_path)
    assert torch.equal(cache.tensors("x", lambda: {"a": a})["a"], a)
    assert torch.equal(cache.tensors("x", lambda: {})["a"], a)
    assert cache.made == 1
