"""One path-traced sample a pixel on a moving path: our denoiser against what a user would otherwise pick."""

from __future__ import annotations

from importlib.util import find_spec

import torch
from torch import Tensor

from gbufrt.commands.ablation.figures.display import display, error_picture, exposure_of, unbiased
from gbufrt.commands.ablation.figures.errors import psnr_over, share_of_pixels
from gbufrt.commands.ablation.measure import run
from gbufrt.commands.ablation.place import Place
from gbufrt.commands.ablation.subjects import SHARP, Outcome
from gbufrt.frame import Frame
from gbufrt.gbuffer import GBuffer
from gbufrt.metrics.temporal import frames_seen
from gbufrt.pipeline import Pipeline

FRAMES = 32
CHECKED = {"first": 0.0, "third": 1 / 3, "two_thirds": 2 / 3, "last": 1.0}  # of the path
MORE = 2  # times as many paths, in four parts: see `truth_of`
TRUTH_SEEDS = range(FRAMES, FRAMES + 4)  # after those of the frames
MIN_ALBEDO = 1e-2
KERNEL = 15  # pixels, of the joint bilateral filter
SIGMA_GUIDE, SIGMA_SPACE = 0.1, 4.0


def denoiser() -> Pipeline:
    """What a user calls on noisy light."""
    from post import Denoise

    return Pipeline(given={"radiance"}, denoise=Denoise(signal="radiance"))


def denoise(place: Place, _: Pipeline) -> Outcome:
    """PSNR on four frames of a path, first to last; on the last, only where nothing was disoccluded on the way."""
    frames = [noisy(place, number) for number in range(FRAMES)]
    told = iter(range(1, FRAMES + 1))
    found = run(
        denoiser(), frames, keep=FRAMES, tick=lambda: place.say(f"{place.view}, denoised {next(told)} of {FRAMES}")
    )
    result = Outcome(passes=found.passes)
    steady = frames_seen([frame.gbuffer for frame in frames]) >= FRAMES
    for which, share in CHECKED.items():
        number = round(share * (FRAMES - 1))
        source = frames[number]
        parts = truth_of(place, number)
        truth = torch.stack(parts).mean(0)
        mask = source.gbuffer.hit & (steady if which == "last" else True)
        exposure = exposure_of(truth, source.gbuffer.hit)
        wanted = display(truth, exposure)
        answers = unbiased((parts[0], parts[1]), exposure), unbiased((parts[2], parts[3]), exposure)
        lights = {"ours": found.frames[number].read("radiance"), "input": source.read("radiance"), **rivals(source)}
        shown = {name: display(light, exposure) for name, light in lights.items()}
        scores = {name: psnr_over(picture, answers, mask) for name, picture in shown.items()}
        result.figures.update({f"denoise.{which}_{name}": score for name, score in scores.items()})
        for rival in ("oidn", "kornia"):
            if rival in scores:
                result.figures[f"denoise.{which}_over_{rival}"] = scores["ours"] - scores[rival]
                result.figures[f"denoise.{which}_input_over_{rival}"] = scores["input"] - scores[rival]
        if which == "last":
            result.pictures = {f"denoise {name}": picture for name, picture in shown.items()}
            result.pictures |= {"denoise": shown["ours"], "denoise truth": wanted}
            result.pictures["denoise error"] = error_picture(shown["ours"], wanted, source.gbuffer.hit)
            result.figures["denoise.steady"] = share_of_pixels(mask, source.gbuffer.hit)
    for what in ("", "input_"):
        gains = [result.figures[f"denoise.{which}_{what}over_kornia"] for which in CHECKED]
        result.figures[f"denoise.least_{what}over_kornia"] = min(gains)
    return result


def truth_of(place: Place, number: int) -> list[Tensor]:
    """The path-traced frame in four independent parts: of two, the display curve's answer to noise can be told."""
    samples, time = max(place.samples * MORE // len(TRUTH_SEEDS), 1), place.at(number)
    return [place.picture({**SHARP, "seed": seed}, time=time, samples=samples) for seed in TRUTH_SEEDS]


def noisy(place: Place, number: int) -> Frame:
    """A frame with ``radiance`` path-traced at one sample a pixel, and the layer behind water and glass."""
    from tracer.gbuffers import layers

    now, before = place.at(number), place.at(number - 1)
    g, behind = layers(
        place.scene, place.camera(now), previous_camera=place.camera(before), time=now, previous_time=before
    )
    light = place.picture({**SHARP, "seed": number}, time=now, samples=1)
    beyond = None if behind is None else Frame(gbuffer=behind, index=number, time=now)
    return Frame(gbuffer=g, index=number, time=now, radiance=light, behind=beyond)


def rivals(frame: Frame) -> dict[str, Tensor]:
    """The same frame by the other denoisers that are installed, each with albedo and normal of what is seen directly or
    through glass and water; what mirrors show only ours finds."""
    from post.passes.denoising.shown import reflectance_of, visible_layer

    behind = None if frame.behind is None else frame.behind.gbuffer
    g, albedo, *_ = visible_layer(frame.gbuffer, behind, reflectance_of(frame.gbuffer, specular=False))
    light, low = frame.read("radiance"), albedo.clamp_min(MIN_ALBEDO)
    smooth = joint_bilateral(torch.where(g.hit, light / low, light), g, kernel=KERNEL)  # with the albedo divided out
    found = {"kornia": torch.where(g.hit, smooth * low, light)}
    if has_oidn():
        found["oidn"] = oidn(light, torch.where(g.hit, albedo, 0.0), g.normal)
    return found


def has_oidn() -> bool:
    """Whether `oidn` can run here."""
    return find_spec("pyoidn") is not None


def oidn(light: Tensor, albedo: Tensor, normal: Tensor, *, quality: str = "high") -> Tensor:
    """Intel Open Image Denoise with clean albedo and normal, all of them and the result ``(1, 3, H, W)``."""
    from pyoidn import denoise as filtered  # pyright: ignore[reportMissingImports]

    pixels = [plane[0].permute(1, 2, 0).contiguous() for plane in (light, albedo, normal)]
    return filtered(*pixels, hdr=True, clean_aux=True, quality=quality).permute(2, 0, 1)[None]


def joint_bilateral(signal: Tensor, g: GBuffer, *, kernel: int) -> Tensor:
    """kornia's joint bilateral filter over ``(B, C, H, W)``, guided by normal and depth, ``kernel`` pixels wide."""
    from kornia.filters import joint_bilateral_blur

    near = torch.where(g.hit, 1 / g.depth, 0.0)
    guide = torch.cat([g.normal * 0.5, near / near.amax().clamp_min(1e-9)], dim=1)
    return joint_bilateral_blur(signal, guide, kernel, SIGMA_GUIDE, (SIGMA_SPACE, SIGMA_SPACE))
