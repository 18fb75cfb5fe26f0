"""What the frame of Minecraft RTX and the world of BetterRTX must reach."""

from __future__ import annotations

from gbufrt.commands.ablation.bars import Bar
from gbufrt.commands.ablation.world.lights_out import LATER

VISIBLE = 0.71  # a correlation with which a half of the variance is explained

BARS = (
    Bar(
        name="A-SVGF", what=f"error over its steady value, {LATER} frames after lamps go out under a moving sun",
        key="asvgf.late_ours", bound=1.1, better="lower", subject="asvgf",
        trivial={"SVGF": "asvgf.late_SVGF", "Denoise": "asvgf.late_Denoise"},
    ),
    Bar(
        name="A-SVGF", what="steady error over Denoise's", key="asvgf.over_denoise_ours", bound=1.0, better="lower",
        subject="asvgf", trivial={"SVGF": "asvgf.over_denoise_SVGF", "the input": "asvgf.over_denoise_input"},
    ),
    Bar(
        name="irradiance cache", what="dB gained in the first displayed frame after a cut, mean of the seeds",
        key="cut.gain", bound=3.0, better="higher", subject="irradiance_cache", trivial={"the least seed": "cut.least"},
        limit="cut.perfect",
    ),
    Bar(
        name="irradiance cache", what="bias of the mean light of converged frames, to paths of four bounces",
        key="cut.bias", bound=0.02, better="lower", subject="irradiance_cache",
        trivial={"to paths of twelve": "cut.bias_most"},
    ),
    Bar(
        name="irradiance cache", what="share of the old light left, 8 frames after the lamp was moved", key="cut.left",
        bound=0.1, better="lower", subject="irradiance_cache", trivial={"never forgets": "cut.never"},
    ),
    Bar(
        name="fog", what="RMS error over the mean after 16 static frames, to 1,024 steps a ray", key="fog.error",
        bound=0.05, better="lower", subject="fog",
        trivial={"none": "fog.if_none", "even": "fog.if_even", "one frame": "fog.error_1"},
    ),
    *(
        bar
        for name, words in (("half", "1/2"), ("third", "1/3"))
        for bar in (
            Bar(
                name="upscaling", what=f"dB over bicubic from {words} of the sides, on a moving path",
                key=f"upscale.{name}.gain", bound=3.0, better="higher", subject="upscale",
                limit=f"upscale.{name}.native_gain",
            ),
            Bar(
                name="upscaling", what=f"FLIP over bicubic's from {words} of the sides", key=f"upscale.{name}.flip",
                bound=1.0, better="lower", subject="upscale",
            ),
        )
    ),
    Bar(
        name="upscaling", what="dB below TAA of frames at full size, from 1/2, mean of the frames",
        key="upscale.half.behind", bound=1.0, better="lower", subject="upscale",
        trivial={"bicubic": "upscale.half.bicubic_behind"},
    ),
    Bar(
        name="upscaling", what="the same, in the worst frame", key="upscale.half.behind_worst", bound=1.0,
        better="lower", subject="upscale",
    ),
    Bar(
        name="sky", what="RMS error over the mean of all directions, to paths of light", key="sky.error", bound=0.02,
        better="lower", subject="sky", trivial={"even": "sky.if_even"},
    ),
    Bar(
        name="sky", what="most that a row differs from its neighbours' mean, levels of 8 bits", key="sky.step",
        bound=1.0, better="lower", subject="sky", trivial={"read without interpolation": "sky.step_nearest"},
    ),
    Bar(
        name="sky", what="seconds that the tables take, of one thread", key="sky.tables_s", bound=1.0, better="lower",
        subject="sky", timed=True,
    ),
    Bar(
        name="caustics", what="energy less light tracing's, over it", key="caustics.energy", bound=0.2, better="lower",
        subject="caustics", trivial={"none": "caustics.none", "still water": "caustics.still"},
    ),
    Bar(
        name="caustics", what="correlation of their pattern with light tracing's", key="caustics.alike", bound=VISIBLE,
        better="higher", subject="caustics", trivial={"still water": "caustics.none_alike"},
    ),
    Bar(
        name="dispatch", what="time of a plain hit program over trace's", key="dispatch.times", bound=2.0,
        better="lower", subject="dispatch", timed=True,
    ),
)  # fmt: skip
