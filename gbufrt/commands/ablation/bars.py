"""What each pass of ME1 must reach in the worst view, and the trivial answers beside it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from gbufrt.commands.ablation.front import TOLERANCE


@dataclass(frozen=True, kw_only=True)
class Bar:
    """What one figure must reach in the worst view."""

    name: str
    """Of the pass."""
    what: str
    key: str
    bound: float
    better: Literal["lower", "higher"]
    subject: str
    trivial: Mapping[str, str] = field(default_factory=dict)
    """Label to the figure that holds the score of a trivial answer."""
    limit: str | None = None
    """The figure that holds what a perfect answer of its kind would score: for ME1's passes, one by screen space."""
    timed: bool = False
    """Whether it is made of times, which tell nothing beside other units."""


BARS = (
    Bar(
        name="AO", what="RMSE to true AO at the same radius", key="ao.rmse", bound=0.06, better="lower",
        subject="signals", trivial={"ao = 1": "ao.if_open", "constant per object": "ao.if_constant"}, limit="ao.limit",
    ),
    Bar(
        name="AO", what="the same RMSE after 1 frame from an empty history", key="ao.rmse_1", bound=0.09,
        better="lower", subject="signals",
    ),
    Bar(
        name="AO", what="bent normal's error over the normal's, where true AO < 0.9", key="ao.bent", bound=0.5,
        better="lower", subject="signals", trivial={"the normal": "ao.if_normal"},
    ),
    Bar(
        name="GI", what="squared error over squared truth, on-screen part of one bounce", key="gi.error", bound=0.25,
        better="lower", subject="signals", trivial={"black": "gi.if_black", "constant per object": "gi.if_constant"},
        limit="gi.exact",
    ),
    Bar(
        name="GI", what="the same error after 1 frame from an empty history", key="gi.error_1", bound=0.5,
        better="lower", subject="signals",
    ),
    Bar(
        name="GI", what="the error over a per-object constant's", key="gi.to_constant", bound=0.5, better="lower",
        subject="signals",
    ),
    Bar(
        name="reflections", what="RMSE over mean true radiance, mirrors whose hit is on screen",
        key="reflection.mirror", bound=0.1, better="lower", subject="signals",
        trivial={
            "black": "reflection.if_black", "sky": "reflection.if_sky", "constant per object": "reflection.if_constant",
        },
        limit="reflection.exact",
    ),
    Bar(
        name="denoise", what="dB over OIDN, last of 32 frames, 1 sample a pixel", key="denoise.last_over_oidn",
        bound=2.0, better="higher", subject="denoise", trivial={"the input": "denoise.last_input_over_oidn"},
    ),
    Bar(
        name="denoise", what="dB over kornia's joint bilateral, least of four frames from the first on",
        key="denoise.least_over_kornia", bound=0.0, better="higher", subject="denoise",
        trivial={"the input": "denoise.least_input_over_kornia"},
    ),
    Bar(
        name="motion blur", what="dB gained, centred shutter", key="motion_blur.centred.gain", bound=4.0,
        better="higher", subject="motion_blur",
    ),
    Bar(
        name="motion blur", what="dB gained, trailing shutter", key="motion_blur.trailing.gain", bound=3.0,
        better="higher", subject="motion_blur",
    ),
    Bar(
        name="depth of field", what="dB gained, small aperture", key="depth_of_field.small.gain", bound=10.0,
        better="higher", subject="depth_of_field",
    ),
    Bar(
        name="depth of field", what="dB gained, large aperture", key="depth_of_field.large.gain", bound=12.0,
        better="higher", subject="depth_of_field",
    ),
)  # fmt: skip
BARS += tuple(
    Bar(
        name=name, what="most times the time of the fastest setting that errs no more, of presets low to high",
        key=f"front.{signal}.behind", bound=TOLERANCE, better="lower", subject="front", timed=True,
    )
    for name, signal in (("AO", "ao"), ("GI", "gi"), ("reflections", "reflection"))
)  # fmt: skip
UNTOUCHED = {"motion_blur": "the untouched frame: 0 dB", "depth_of_field": "the untouched frame: 0 dB"}
