"""A-SVGF: what has not changed is averaged, what has is forgotten at once, and only there."""

from __future__ import annotations

import boxes
import pytest
import torch
from torch import Tensor

from gbufrt import Frame, Pipeline
from post import ASVGF, asvgf
from post.passes.denoising.asvgf import FADING
from post.upsampling.gradient import forgetting, temporal_gradient
from tracer.paths.one_sample import brightest_a_stratum, one_a_stratum

SIZE = (36, 48)
COLOR = torch.tensor([0.9, 0.5, 0.2]).view(1, 3, 1, 1)


def frame(light: Tensor, again: Tensor | None = None, *, index: int = 0, orthographic: bool = False) -> Frame:
    """A still frame with diffuse ``light``; ``again`` is what the frame before's samples bring now."""
    plain = boxes.frame(boxes.cameras(1, SIZE, orthographic=orthographic))
    hit = plain.gbuffer.hit
    more = {}
    if again is not None:
        chosen = one_a_stratum(hit, index=index - 1)
        more = {"replayed": chosen.float(), "replayed_diffuse": torch.where(chosen, again, 0.0)}
    return plain.replace(index=index, diffuse=torch.where(hit, light, 0.0), **more)


def even(value: float = 1.0) -> Tensor:
    return (value * COLOR).expand(1, 3, *SIZE)


def noisy(seed: int, value: float = 1.0) -> Tensor:
    generator = torch.Generator().manual_seed(seed)
    return even(value) * torch.empty(1, 1, *SIZE).exponential_(generator=generator)


def upward(f: Frame) -> Tensor:
    return f.gbuffer.hit & (f.gbuffer.normal[:, 1:2] > 0.9)


def inner(mask: Tensor) -> Tensor:
    """Pixels of a mask whose 5x5 neighbours all belong to it."""
    return torch.nn.functional.max_pool2d(1 - mask.float(), 5, stride=1, padding=2) == 0


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize(("now", "share"), [(1.0, 0.0), (0.0, 1.0), (0.25, 0.75), (4.0, 0.75)])
@pytest.mark.parametrize("index", [1, 2, 6])
def test_the_gradient_is_the_share_of_light_that_changed(now: float, share: float, index: int, orthographic: bool):
    before = noisy(3)
    f = frame(even(), before * now, index=index, orthographic=orthographic)
    change = temporal_gradient(before, f.read("replayed_diffuse"), f.read("replayed"), f.gbuffer)
    torch.testing.assert_close(change[f.gbuffer.hit], torch.full_like(change[f.gbuffer.hit], share), atol=1e-5, rtol=0)
    assert not bool(change[~f.gbuffer.hit].any())


def test_changes_stay_on_their_own_surface():
    plain = frame(even())
    floor = upward(plain)
    f = frame(even(), torch.where(floor, 0.0, even()), index=3)
    change = temporal_gradient(even(), f.read("replayed_diffuse"), f.read("replayed"), f.gbuffer)
    assert float(change[inner(floor)].mean()) > 0.999
    assert float(change[inner(f.gbuffer.hit & ~floor)].mean()) < 0.01  # few have no replayed pixel of their own near
    assert bool(inner(floor).any())
    assert bool(inner(f.gbuffer.hit & ~floor).any())


def test_replayed_samples_may_lie_anywhere_in_their_squares():
    """Of samples that only some pixels have, the brightest tell what becomes of them; and each on its own surface."""
    plain, generator = frame(even()), torch.Generator().manual_seed(2)
    floor, hit = upward(plain), plain.gbuffer.hit
    before = even() * (torch.rand(1, 1, *SIZE, generator=generator) < 0.2)
    after = torch.where(floor, 0.0, before)
    chosen = brightest_a_stratum(hit, before[:, :1])
    again = torch.where(chosen, after, 0.0)
    change = temporal_gradient(before, again, chosen.float(), plain.gbuffer)
    assert float(change[inner(floor)].mean()) > 0.999
    assert float(change[inner(hit & ~floor)].mean()) < 0.002
    assert not bool(change[~hit].any())


def test_noise_of_replayed_samples_cancels():
    """Samples that jump up as often as down tell of no change of their mean."""
    before, after = noisy(5), noisy(6)
    f = frame(even(), after, index=1)
    change = temporal_gradient(before, f.read("replayed_diffuse"), f.read("replayed"), f.gbuffer)
    alone = (after - before).abs() / torch.maximum(after, before)
    assert float(change[f.gbuffer.hit].mean()) < 0.3 * float(alone.mean())


@pytest.mark.parametrize("signal", ["diffuse", "specular"])
def test_light_of_one_colour_stays_of_that_colour_around_what_is_bright(signal: str):
    """The image of a lamp and the dark around it: neither the rim nor the dark is more colourful than the lamp is."""
    generator = torch.Generator().manual_seed(8)
    lamp = torch.full((1, 1, *SIZE), 0.01)
    lamp[..., 20:26, 18:24] = 10.0
    f = frame(even() * lamp * torch.empty(1, 1, *SIZE).exponential_(generator=generator))
    distance = torch.full_like(f.gbuffer.depth, 4.0) if signal == "specular" else None
    light, _ = asvgf(f.read("diffuse"), f.gbuffer, distance=distance)
    hit = f.gbuffer.hit & (light.sum(1, keepdim=True) > 0)
    assert bool(hit[..., 18:28, 16:26].any())
    share = light / light.sum(1, keepdim=True).clamp_min(1e-12)
    want = (COLOR / COLOR.sum()).expand_as(share)
    torch.testing.assert_close(share[hit.expand_as(share)], want[hit.expand_as(want)], rtol=1e-4, atol=0)


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_this_frame_counts_as_much_as_has_changed(share: float):
    f, history = frame(even()), None
    for _ in range(4):
        _, history = asvgf(f.read("diffuse"), f.gbuffer, history, firefly=0.0)
    assert history is not None
    history = forgetting(history, torch.full_like(history.length, share))
    _, after = asvgf(f.read("diffuse") * 0, f.gbuffer, history, firefly=0.0)
    want = even() * (1 - (0.2 + 0.8 * share))
    hit = f.gbuffer.hit.expand_as(want)
    torch.testing.assert_close(after.signals["signal"][hit], want[hit], atol=2e-3, rtol=0)


def rare(seed: int) -> Tensor:
    """Light of mean 1 of which one pixel in a hundred brings a third, as paths by way of something shiny do."""
    generator = torch.Generator().manual_seed(seed)
    base, shine = torch.rand(2, 1, 1, *SIZE, generator=generator)
    return even() * (4 / 3 * base + 100 / 3 * (shine < 0.01))


def after_rare(frames: int, signal: str = "diffuse") -> Tensor:
    """Luminance of the floor relative to its mean, after some frames of `rare` light."""
    f, state = frame(even()), None
    for seed in range(frames):
        f, state = ASVGF(signal=signal)(f.replace(**{signal: torch.where(f.gbuffer.hit, rare(seed), 0.0)}), state)
    light = f.read(signal)[:, :1] / COLOR[:, :1]
    return light[inner(upward(f))]


def test_light_of_rare_bright_paths_is_kept():
    """Cuts alone would leave 0.71 of it."""
    assert float(after_rare(24).mean()) == pytest.approx(1.0, abs=0.05)


def test_pixels_that_missed_rare_bright_paths_are_no_dots(monkeypatch: pytest.MonkeyPatch):
    def roughness() -> float:
        light = after_rare(8)
        return float(light.std() / light.mean())

    found = roughness()
    monkeypatch.setattr("post.passes.denoising.asvgf._shared", lambda variance, light, hit: variance)
    assert found < 0.95 * roughness()


def test_first_frames_trust_the_variance_of_few_samples_less_than_old_ones(monkeypatch: pytest.MonkeyPatch):
    f, generator = frame(even()), torch.Generator().manual_seed(4)
    light = even() * (1 + 0.1 * torch.randn(1, 1, *SIZE, generator=generator))

    def roughness() -> float:
        found = asvgf(light, f.gbuffer)[0][:, :1][inner(upward(f))]
        return float(found.std() / found.mean())

    found = roughness()
    monkeypatch.setattr("post.passes.denoising.asvgf.UNSURE", 15.0)
    assert found < 0.75 * roughness()


def test_new_surfaces_show_what_a_cache_knows_until_they_have_a_history():
    """The share of the cache falls over frames; what it shows is no sample, so that gradients stay as they are."""
    f, history, shares = frame(0 * even()), None, []
    hit = f.gbuffer.hit
    for _ in range(40):
        light, history = asvgf(f.read("diffuse"), f.gbuffer, history, cached=even(), firefly=0.0)
        assert not bool(history.signals["sample"].any())
        shares.append(float((light / even())[hit.expand_as(light)].mean()))
    assert shares[0] == pytest.approx(1.0, abs=1e-3)
    assert shares[1] == pytest.approx((1 + FADING) / 2, abs=1e-3)
    assert shares[-1] < 0.1
    assert history is not None
    changed = forgetting(history, torch.ones_like(history.length))
    light, _ = asvgf(f.read("diffuse"), f.gbuffer, changed, cached=even(), firefly=0.0)
    assert float(light.max()) < 0.01, "light that changes makes no surface new"
    light, _ = asvgf(f.read("diffuse"), f.gbuffer, history.reset(torch.tensor([True])), cached=even(), firefly=0.0)
    torch.testing.assert_close(light[hit.expand_as(light)], even()[hit.expand_as(light)])


def test_a_cache_that_comes_late_stays_unread():
    f = frame(0 * even())
    _, history = asvgf(f.read("diffuse"), f.gbuffer)
    light, _ = asvgf(f.read("diffuse"), f.gbuffer, history, cached=even())
    assert not bool(light.any())
    result, _ = ASVGF()(f.replace(cached_diffuse=even()))
    assert bool(result.read("diffuse").any())


def test_even_light_of_any_colour_is_left_alone():
    out, _ = asvgf(even().clone(), frame(even()).gbuffer)
    torch.testing.assert_close(out, even().clone())


def run(stage: ASVGF, lights: list[Tensor], again: list[Tensor]) -> list[Tensor]:
    pipeline, state, found = Pipeline(denoise=stage), None, []
    for index, (light, replayed) in enumerate(zip(lights, again, strict=True)):
        result, state = pipeline(frame(light, replayed if index else None, index=index), state)
        found.append(result.read("diffuse"))
    return found


def test_a_lamp_that_goes_out_leaves_no_trail():
    """Of twelve noisy frames, and four after nine tenths of the light went out, these are nearly as good as new."""
    lights = [noisy(k) for k in range(12)] + [noisy(k, 0.1) for k in range(12, 16)]
    again = [lights[0], *lights[:11], 0.1 * lights[11], *lights[12:15]]
    hit = frame(even()).gbuffer.hit.expand(1, 3, *SIZE)

    def error(picture: Tensor, value: float) -> float:
        return float((picture - even(value))[hit].square().mean().sqrt()) / value

    ours, plain = run(ASVGF(), lights, again), run(ASVGF(gradients=False), lights, again)
    assert error(ours[11], 1.0) < 0.25 * error(lights[11], 1.0)
    assert torch.equal(ours[11], plain[11])
    assert error(ours[15], 0.1) < 1.5 * error(ours[3], 1.0)
    assert error(plain[15], 0.1) > 50 * error(ours[15], 0.1)


def test_a_cut_forgets_all():
    stage, f = ASVGF(), frame(even())
    _, state = stage(f)
    out, state = stage(frame(0.5 * even(), even(), index=1).replace(cut=torch.tensor([True])), state)
    assert float(state.length.max()) == 1
    hit = f.gbuffer.hit.expand(1, 3, *SIZE)
    torch.testing.assert_close(out.read("diffuse")[hit], (0.5 * even())[hit])


def test_chroma_is_not_taken_across_an_edge_of_light():
    """A warm lit half beside a dark cold one of the same floor: neither takes on the other's colour."""
    f = frame(even())
    left = (torch.arange(SIZE[1]) < SIZE[1] // 2).view(1, 1, 1, -1)
    warm, cold = torch.tensor([2.0, 1.0, 0.3]).view(1, 3, 1, 1), torch.tensor([0.02, 0.05, 0.1]).view(1, 3, 1, 1)
    light = torch.where(left, warm, cold).expand(1, 3, *SIZE).clone()
    out, history = asvgf(light, f.gbuffer)
    for _ in range(5):
        out, history = asvgf(light, f.gbuffer, history)
    off = (out - light).abs() / light
    assert float(off[upward(f).expand_as(off)].mean()) < 0.02


def test_light_of_the_wrong_shape_is_told():
    with pytest.raises(ValueError, match=r"light must be \(1,3,36,48\), .*linear radiance; got \(1,1,36,48\)"):
        asvgf(torch.zeros(1, 1, *SIZE), frame(even()).gbuffer)
