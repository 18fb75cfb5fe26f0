"""What the page says about each subject, beside its numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from gbufrt.commands.ablation.variants import FULL


@dataclass(frozen=True, kw_only=True)
class Section:
    """One section of the page.

    Args:
        title: its heading.
        subject: whose records it shows.
        picture: name of the picture that is compared.
        figures: keys of the numbers, the most important one first.
        names: the numbers in words.
        text: how they are made.
    """

    title: str
    subject: str
    picture: str
    figures: tuple[str, ...]
    names: Mapping[str, str] = field(default_factory=dict)
    text: str = ""

    def label(self, name: str, variant: str) -> str | None:
        """The name of a record's picture in the viewer; None for a picture of another section."""
        if name == self.picture:
            return variant
        if not name.startswith(self.picture + " "):
            return None
        rest = name.removeprefix(self.picture + " ")
        if rest == "error":
            return f"{variant} error"
        return rest if variant == FULL or rest == "truth" else None


def _lens(title: str, subject: str, kind: str, truth: str) -> Section:
    key = f"{subject}.{kind}"
    names = {
        "gain": "dB gained where the picture changes",
        "changed": "share of pixels",
        "gain_onscreen": "dB gained where all light is from on-screen points",
        "offscreen": "share of changed pixels with light from elsewhere",
        "offscreen_error": "share of the squared error on those",
        "kept": "error where nothing changes",
    }
    return Section(
        title=title,
        subject=subject,
        picture=key,
        figures=tuple(f"{key}.{name}" for name in names),
        names={f"{key}.{name}": words for name, words in names.items()},
        text=f"The path-traced sharp frame, blurred by the pass, against {truth}. On-screen points are those that the "
        "sharp frame shows: the rest is beyond its border, behind what hides it or, in a pixel of a hundred, on edges "
        "finer than a pixel.",
    )


SECTIONS = (
    Section(
        title="Whole frame",
        subject="frame",
        picture="frame",
        figures=(
            "psnr", "ssim", "flip", "rmse", "loss", "changed", "flicker", "psnr_onscreen", "psnr_limit",
            "psnr_if_ambient", "psnr_if_direct",
        ),
        names={
            "psnr": "PSNR, dB",
            "ssim": "SSIM",
            "flip": "FLIP",
            "rmse": "RMSE, exposed light",
            "loss": "dB lost on changed pixels",
            "changed": "share changed",
            "flicker": "flicker",
            "psnr_onscreen": "PSNR to the on-screen part",
            "psnr_limit": "PSNR of that part",
            "psnr_if_ambient": "PSNR of direct light + open sky",
            "psnr_if_direct": "PSNR of direct light alone",
        },
        text="The composite, before lens and display, against the path-traced frame with one sample place a pixel. The "
        "on-screen part of that frame is the light that came, after the first surface, by on-screen surfaces alone. "
        "Flicker is the RMS change of displayed static surfaces between the last two frames.",
    ),
    Section(
        title="Ambient occlusion",
        subject="signals",
        picture="ao",
        figures=(
            "ao.rmse", "ao.rmse_1", "ao.rmse_4", "ao.limit", "ao.own", "ao.ssim", "ao.if_open", "ao.if_constant",
            "ao.bent", "ao.bent_degrees", "ao.normal_degrees", "ao.truth_error",
        ),
        names={
            "ao.rmse": "RMSE",
            "ao.rmse_1": "after 1 frame",
            "ao.rmse_4": "after 4",
            "ao.limit": "limit of screen space",
            "ao.own": "RMSE to that limit",
            "ao.ssim": "SSIM",
            "ao.if_open": "ao = 1",
            "ao.if_constant": "constant per object",
            "ao.bent": "bent normal: error over the normal's",
            "ao.bent_degrees": "bent normal, degrees",
            "ao.normal_degrees": "the normal, degrees",
            "ao.truth_error": "noise of the truth",
        },
        text="Against rays of the same radius. The limit is what blocking exactly those rays would score that end on a "
        "surface which the camera sees: a perfect method without thickness. A method that knows how thick "
        "things are may pass it.",
    ),
    Section(
        title="Indirect light",
        subject="signals",
        picture="gi",
        figures=(
            "gi.error", "gi.error_1", "gi.error_4", "gi.exact", "gi.if_constant", "gi.to_constant", "gi.whole",
            "gi.limit", "gi.rmse", "sky.rmse", "sky.if_open", "sky.if_constant", "gi.truth_error",
        ),
        names={
            "gi.error": "relative squared error",
            "gi.error_1": "after 1 frame",
            "gi.error_4": "after 4",
            "gi.exact": "perfect rays",
            "gi.if_constant": "constant per object",
            "gi.to_constant": "error over the constant's",
            "gi.whole": "against all light",
            "gi.limit": "limit of screen space",
            "gi.rmse": "RMSE",
            "sky.rmse": "sky visibility: RMSE",
            "sky.if_open": "sky open",
            "sky.if_constant": "sky constant per object",
            "gi.truth_error": "noise of the truth",
        },
        text="One bounce. The error is the sum of (gi - truth)² over the sum of truth², over all pixels that hit "
        "something, where truth is the light from surfaces on screen. Perfect rays are the tracer's own, which read "
        "the light that the picture holds where they end. The limit is the on-screen part's own error against the "
        "light from everywhere, by the same formula.",
    ),
    Section(
        title="Reflections",
        subject="signals",
        picture="reflection",
        figures=(
            "reflection.mirror", "reflection.exact", "reflection.exact_lit", "reflection.if_black",
            "reflection.if_sky", "reflection.if_constant", "reflection.mirror_share", "reflection.whole",
            "reflection.limit", "reflection.truth_error",
        ),
        names={
            "reflection.mirror": "mirrors on screen: RMSE over mean",
            "reflection.exact": "perfect rays",
            "reflection.exact_lit": "and the true sky visibility",
            "reflection.if_black": "black",
            "reflection.if_sky": "sky",
            "reflection.if_constant": "constant per object",
            "reflection.mirror_share": "share of such pixels",
            "reflection.whole": "relative squared error, all surfaces",
            "reflection.limit": "limit of screen space",
            "reflection.truth_error": "noise of the truth",
        },
        text="Mirrors are surfaces of roughness below 0.1 of whose rays more than 99 % end on what the camera sees. "
        "Perfect rays are the tracer's own, which read the picture where they end: what they miss, the picture does "
        "not hold, above all lamps a pixel wide. The pass sees no further bounces here, for its truth has none.",
    ),
    Section(
        title="Denoise and accumulate",
        subject="denoise",
        picture="denoise",
        figures=(
            "denoise.last_over_oidn", "denoise.least_over_kornia", "denoise.first_over_kornia",
            "denoise.third_over_kornia", "denoise.two_thirds_over_kornia", "denoise.last_over_kornia",
            "denoise.last_ours", "denoise.last_oidn", "denoise.last_kornia", "denoise.last_input", "denoise.first_ours",
            "denoise.first_oidn", "denoise.first_kornia", "denoise.first_input", "denoise.steady",
        ),
        names={
            "denoise.last_over_oidn": "last frame: dB over OIDN",
            "denoise.least_over_kornia": "least dB over kornia",
            "denoise.first_over_kornia": "first frame: dB over kornia",
            "denoise.third_over_kornia": "a third on: dB over kornia",
            "denoise.two_thirds_over_kornia": "two thirds on: dB over kornia",
            "denoise.last_over_kornia": "last frame: dB over kornia",
            "denoise.last_ours": "last: ours, dB",
            "denoise.last_oidn": "last: OIDN, dB",
            "denoise.last_kornia": "last: kornia, dB",
            "denoise.last_input": "last: input, dB",
            "denoise.first_ours": "first: ours, dB",
            "denoise.first_oidn": "first: OIDN, dB",
            "denoise.first_kornia": "first: kornia, dB",
            "denoise.first_input": "first: input, dB",
            "denoise.steady": "share on screen throughout",
        },
        text="One path-traced sample a pixel, 32 frames of a moving path. The last frame is judged where its surfaces "
        "were on screen all the way, the others everywhere; OIDN (high quality, clean albedo and normal) and kornia's "
        "joint bilateral filter (15 pixels, albedo divided out) see that one frame.",
    ),
    _lens("Motion blur, centred shutter", "motion_blur", "centred", "rays spread over the shutter"),
    _lens("Motion blur, trailing shutter", "motion_blur", "trailing", "rays spread over the shutter"),
    _lens("Depth of field, small aperture", "depth_of_field", "small", "a thin lens of radius 0.1 units"),
    _lens("Depth of field, large aperture", "depth_of_field", "large", "a thin lens of radius 0.4 units"),
    Section(
        title="In motion",
        subject="path",
        picture="path",
        figures=("flicker", "ghosting", "new_rmse", "fresh_new_rmse", "psnr", "ssim", "flip"),
        names={
            "flicker": "flicker beyond the truth's own",
            "ghosting": "ghosting",
            "new_rmse": "RMSE where newly uncovered",
            "fresh_new_rmse": "the same with a clean history",
            "psnr": "PSNR, dB",
            "ssim": "SSIM",
            "flip": "FLIP",
        },
        text="A moving camera. Flicker is the RMS change of displayed surfaces from frame to frame along their "
        "motion, beyond the truth's own. Ghosting is the RMSE where surfaces came into sight during the last four "
        "frames, beyond what the same passes leave there with a clean history.",
    ),
    Section(
        title="Temporal anti-aliasing",
        subject="taa",
        picture="taa",
        figures=("taa.gain", "taa.edges", "psnr", "flip"),
        names={
            "taa.gain": "dB gained on edges",
            "taa.edges": "share of such pixels",
            "psnr": "PSNR, dB",
            "flip": "FLIP",
        },
        text="Jittered static frames against the anti-aliased path-traced frame.",
    ),
)  # fmt: skip
