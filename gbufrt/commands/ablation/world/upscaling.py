"""`Upscale` on a moving path, against a picture with many samples in every pixel of the display."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any

import torch
import torch.nn.functional as F
from torch import Tensor

from gbufrt.commands.ablation.figures.display import display, exposure_of
from gbufrt.commands.ablation.figures.errors import psnr_over
from gbufrt.commands.ablation.place import Place
from gbufrt.commands.ablation.subjects import Outcome
from gbufrt.commands.ablation.world.pictures import compared_displays
from gbufrt.frame import Frame
from gbufrt.metrics.flip import available, flip

SIZE = (108, 192)  # of the display: a half and a third of it are whole
RATIOS = {"half": 2, "third": 3}
JITTERS = 8  # times the ratio squared: frames after which the camera's jitter repeats
FRAMES, CHECKED = 16, (9, 12, 15)
SAMPLES = 16  # a pixel of the truth
LIGHT_SAMPLES = 2


def judge(place: Place) -> Outcome:
    """PSNR and FLIP of `Upscale` over bicubic interpolation of the same frames; PSNR below TAA at full size.

    Light is direct, so that the upscaler alone is judged. Figures are means over `CHECKED` frames.
    """
    from post import TAA, Upscale

    place, result = replace(place, size=SIZE), Outcome()
    truths = {number: truth(place, number) for number in CHECKED}
    whole = torch.ones_like(truths[CHECKED[0]][:, :1], dtype=torch.bool)
    exposures = {number: exposure_of(light, whole) for number, light in truths.items()}
    wanted = {number: display(light, exposures[number]) for number, light in truths.items()}

    def score(shown: dict[int, Tensor], key: str) -> list[float]:
        psnr = [psnr_over(shown[n], (wanted[n], wanted[n]), whole) for n in CHECKED]
        result.figures[f"{key}_psnr"] = _mean(psnr)
        if available():
            result.figures[f"{key}_flip"] = _mean(float(flip(shown[n], wanted[n])) for n in CHECKED)
        return psnr

    native = _shown(TAA(), frames(place, 1), exposures)
    best = score(native, "upscale.native")
    for name, ratio in RATIOS.items():
        key, small = f"upscale.{name}", replace(place, size=(SIZE[0] // ratio, SIZE[1] // ratio))
        ours = _shown(Upscale(ratio=float(ratio)), frames(small, ratio), exposures)
        plain = {n: _bicubic(small, n, exposures[n]) for n in CHECKED}
        good, poor = score(ours, f"{key}.ours"), score(plain, f"{key}.bicubic")
        behind = [full - part for full, part in zip(best, good, strict=True)]
        result.figures |= {f"{key}.gain": _mean(good) - _mean(poor), f"{key}.native_gain": _mean(best) - _mean(poor)}
        result.figures |= {f"{key}.behind": _mean(behind), f"{key}.behind_worst": max(behind)}
        result.figures[f"{key}.bicubic_behind"] = _mean(best) - _mean(poor)
        if available():
            result.figures[f"{key}.flip"] = result.figures[f"{key}.ours_flip"] / result.figures[f"{key}.bicubic_flip"]
        last = CHECKED[-1]
        shown = {"ours": ours[last], "bicubic": plain[last], "TAA at full size": native[last]}
        result.pictures |= compared_displays(f"upscale.{name}", shown, wanted[last])
    return result


def frames(place: Place, ratio: int) -> Iterator[Frame]:
    """Jittered frames of the path, direct light as ``color``."""
    from gbufrt.noise.noise import halton_jitter

    for number in range(FRAMES):
        place.say(f"{place.view} at {place.size[1]}x{place.size[0]}, frame {number + 1} of {FRAMES}")
        yield _traced(place, number, jitter=halton_jitter(number, length=JITTERS * ratio**2))


def truth(place: Place, number: int) -> Tensor:
    """The mean of frames that are jittered over the whole pixel."""
    from gbufrt.noise.noise import halton_jitter

    def make() -> dict[str, Tensor]:
        place.say(f"{place.view}, truth of frame {number}")
        jitters = [halton_jitter(step, length=SAMPLES) for step in range(SAMPLES)]
        lights = [_traced(place, number, jitter=jitter, seed=step + 1) for step, jitter in enumerate(jitters)]
        return {"radiance": torch.stack([light.read("color") for light in lights]).mean(0)}

    time = place.at(number)
    return place.kept("supersampled", place.camera(time), [time], (SAMPLES, LIGHT_SAMPLES), make)["radiance"]


def _bicubic(place: Place, number: int, exposure: float) -> Tensor:
    """Of the displayed picture: in linear light it rings round what is bright."""
    small = display(_traced(place, number).read("color"), exposure)
    return F.interpolate(small, size=SIZE, mode="bicubic").clamp(0.0, 1.0)


def _traced(place: Place, number: int, jitter: tuple[float, float] | None = None, seed: int = 0) -> Frame:
    from tracer.frames import render

    now, before = place.at(number), place.at(number - 1)
    moment: dict[str, Any] = {"time": now, "previous_time": before, "previous_camera": place.camera(before)}
    camera = place.camera(now).with_jitter(jitter)
    frame = render(place.scene, camera, index=number + FRAMES * seed, light_samples=LIGHT_SAMPLES, **moment)
    return frame.replace(index=number, color=frame.read("radiance"))


def _shown(stage: Any, given: Iterator[Frame], exposures: dict[int, float]) -> dict[int, Tensor]:
    """Displayed pictures of the checked frames."""
    state, found = None, {}
    for frame in given:
        with torch.no_grad():
            after, state = stage(frame, state)
        if (number := int(frame.index)) in exposures:
            found[number] = display(after.read("color"), exposures[number])
    return found


def _mean(values: Iterable[float]) -> float:
    values = list(values)
    return sum(values) / len(values)
