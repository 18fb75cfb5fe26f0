"""What the page says about the frame of Minecraft RTX and the world of BetterRTX, beside the numbers."""

from __future__ import annotations

from gbufrt.commands.ablation.sections import Section
from gbufrt.commands.ablation.world import cut, fog, lights_out, sky, upscaling


def _section(title: str, subject: str, picture: str, names: dict[str, str], text: str) -> Section:
    return Section(title=title, subject=subject, picture=picture, figures=tuple(names), names=names, text=text)


def _upscaled(name: str, words: str) -> Section:
    key = f"upscale.{name}"
    return _section(
        f"Upscaling from {words} of the sides", "upscale", key,
        {
            f"{key}.gain": "dB over bicubic",
            f"{key}.flip": "FLIP over bicubic's",
            f"{key}.behind": "dB below TAA of full frames",
            f"{key}.behind_worst": "the same, worst frame",
            f"{key}.ours_psnr": "PSNR, dB",
            f"{key}.bicubic_psnr": "bicubic, dB",
            "upscale.native_psnr": "TAA of full frames, dB",
            f"{key}.ours_flip": "FLIP",
            f"{key}.bicubic_flip": "bicubic, FLIP",
            "upscale.native_flip": "TAA of full frames, FLIP",
        },
        f"A moving path at {upscaling.SIZE[1]}x{upscaling.SIZE[0]}, direct light, against {upscaling.SAMPLES} places "
        f"in every pixel; means of {len(upscaling.CHECKED)} of {upscaling.FRAMES} frames, the last is shown.",
    )  # fmt: skip


SECTIONS = (
    _section(
        "A-SVGF, lamps go out", "asvgf", "asvgf",
        {
            "asvgf.late_ours": f"error over the steady one, {lights_out.LATER} frames after",
            "asvgf.late_SVGF": "SVGF's",
            "asvgf.late_Denoise": "Denoise's",
            **{
                f"asvgf.after_{after}_{name}": f"{whose}{after} frames after"
                for after in lights_out.EVEN_LATER
                for name, whose in (("ours", ""), ("SVGF", "SVGF's, "))
            },
            "asvgf.over_denoise_ours": "steady error over Denoise's",
            "asvgf.over_denoise_SVGF": "SVGF's over Denoise's",
            "asvgf.steady_ours": "steady error",
            "asvgf.steady_SVGF": "SVGF's",
            "asvgf.steady_Denoise": "Denoise's",
            "asvgf.steady_input": "the input's",
        },
        f"One sample a pixel at {lights_out.SIZE[1]}x{lights_out.SIZE[0]}, while camera and sun move; from frame "
        f"{lights_out.OUT} on no lamp shines. SVGF is the same filter without replayed samples. Errors are RMSE over "
        "the mean after the curve x / (x + 0.3), on opaque surfaces that do not shine themselves; the steady one is of "
        f"frames {' and '.join(map(str, lights_out.STEADY))}. Frame {lights_out.OUT + lights_out.LATER} is shown.",
    ),
    _section(
        "Irradiance cache, after a cut", "irradiance_cache", "cut",
        {
            "cut.gain": "dB gained, mean",
            "cut.least": "dB gained, least",
            "cut.perfect": "by perfect indirect light",
            "cut.shown_ours": "PSNR, dB",
            "cut.shown_without": "without the cache, dB",
            "cut.gain_traced": "dB gained before upscaling",
            "cut.traced_ours": "PSNR before upscaling, dB",
            f"cut.bias_{cut.MOST}": f"bias to paths of {cut.MOST} bounces",
            f"cut.bias_{cut.BOUNCES}": f"to paths of {cut.BOUNCES}",
            f"cut.bias_indirect_{cut.MOST}": f"of indirect light to paths of {cut.MOST}",
            f"cut.bias_indirect_{cut.BOUNCES}": f"to paths of {cut.BOUNCES}",
            "cut.left": f"old light left after {cut.LATER} frames",
        },
        f"The first frame after a cut, traced at {cut.SIZE[1]}x{cut.SIZE[0]}, denoised and upscaled by two without a "
        f"history, against the path tracer; {len(cut.NOISES)} seeds, of which the first is shown, each with a cache of "
        f"{cut.BEFORE} frames of another view. Bias is that of the mean light of {cut.MEANS} further frames there. "
        "Old light is what the cache still holds in one part of a room after the block that shines was moved to the "
        "other.",
    ),
    _section(
        "Fog", "fog", "fog",
        {
            "fog.error": "RMS error over the mean",
            "fog.error_1": "after one frame",
            "fog.mean": "mean over the true mean",
            "fog.if_even": "the true mean everywhere",
            "fog.if_none": "none",
            "fog.truth_error": "noise of the truth",
        },
        f"Light of fog alone after {fog.FRAMES} static frames at {fog.SIZE[1]}x{fog.SIZE[0]}, against "
        f"{2 * fog.STEPS:,} even steps along every ray, each with rays to sun, sky and a lamp.",
    ),
    _upscaled("half", "a half"),
    _upscaled("third", "a third"),
    _section(
        "Sky", "sky", "sky",
        {
            "sky.error": "RMS error over the mean",
            "sky.mean": "mean over the true mean",
            "sky.if_even": "an even sky",
            "sky.truth_error": "noise of the truth",
            "sky.resolved": "error that this noise hides",
            "sky.step": "largest step between rows, levels",
            "sky.step_nearest": "read without interpolation",
            "sky.tables_s": "seconds of the tables",
        },
        f"{sky.GRID[0] * sky.GRID[1]} directions of the same solid angle, a pixel each: the top row is "
        "round the zenith, the lowest just above the horizon. Truth is paths of light that are scattered up to 24 "
        "times. Errors are products of differences from its two halves. Rows are those of a picture of 1080 that goes "
        "from zenith to horizon and on, at a right angle to the sun.",
    ),
    _section(
        "Caustics of waves", "caustics", "caustics",
        {
            "caustics.ratio": "energy over light tracing's",
            "caustics.alike": "correlation",
            "caustics.contrast": "contrast over light tracing's",
            "caustics.still": "still water: off by",
        },
        "Sunlight that waves reflect onto a wall at the end of a pool, against two million photons that fall on the "
        "same waves and are reflected one by one. The wall is dark otherwise.",
    ),
    _section(
        "Programmable rays", "dispatch", "dispatch",
        {
            "dispatch.times": "time over trace's",
            "dispatch.dispatch_ms": "dispatch, ms",
            "dispatch.trace_ms": "trace, ms",
            "dispatch.off": "largest difference of distances",
        },
        "The rays of a picture by `tracer.dispatch`, with one hit program that notes the distance, and by "
        "`tracer.trace`: processor time, the least of several turns.",
    ),
)  # fmt: skip
