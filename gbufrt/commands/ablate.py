"""`gbufrt ablate`: what each pass is worth, against ray-traced truth."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from gbufrt.commands.arguments.checks import (
    COMPOSITES,
    PRESETS,
    SUBJECTS,
    check_cluster,
    check_folder,
    check_name,
    check_world,
)
from gbufrt.commands.arguments.options import ClusterOptions
from gbufrt.commands.arguments.settings import parse_settings
from gbufrt.commands.arguments.values import (
    MOST_COUNT,
    MOST_FRAMES,
    Flag,
    Whole,
    Without,
    at_least,
    parse_names,
    parse_size,
)

Names = Annotated[tuple[str, ...], Parameter(negative="")]


def ablate(
    *worlds: str,
    out: Path = Path("report"),
    views: Names = (),
    paths: Names = (),
    size: str = "480x270",
    frames: Whole = 16,
    samples: Whole = 32,
    preset: str = "high",
    composite: str = "physical",
    set: Without = (),
    variants: Names = ("passes",),
    sweep: Names = (),
    only: Names = (),
    cache: Path | None = None,
    resume: Flag = False,
    spread: ClusterOptions | None = None,
) -> None:
    """Measure the passes against ray-traced truth, and write OUT/report.html, report.json, report.csv and front.svg.

    Without further options it makes the table of what each pass must reach, from the built-in world: ambient occlusion,
    indirect light and reflections after static frames, and their error against time at several settings; denoising on a
    moving path, motion blur and depth of field; the whole frame with each pass left out. A second table has the frame
    of Minecraft RTX and the world of BetterRTX, at places and sizes of their own. Truth is kept between runs. A variant
    that fails is reported in its row.

    On a cluster (--cluster) units run beside one another: milliseconds, and error against time, tell nothing. All other
    figures are the same.

    Args:
        worlds: Built-in worlds or MagicaVoxel .vox files; by default the built-in one.
        out: Folder to write to; made where it is missing.
        views: Views that stand still; may be repeated, or name several with commas. By default four.
        paths: Views for what needs motion, likewise. By default one or two.
        size: Width x height in pixels.
        frames: Static frames that signals accumulate over; whole frames take a quarter as many.
        samples: Paths a pixel of the truth; cheaper truths take some times as many.
        preset: low, medium, high or ultra: the full pipeline.
        composite: physical, or me1 for the formula of the original.
        set: Tunable of the full pipeline to change, as NAME=VALUE; may be repeated.
        variants: Groups (passes, presets, methods) or changes joined by + (without=gi, gtao.method=horizon,
            gi.estimate=MarchGI); may be repeated, or name several with commas.
        sweep: Tunable to vary, as NAME=LOW:HIGH:COUNT (gtao.radius=0.25:2:5); may be repeated.
        only: Judge by these alone: ao, gi, reflection, frame, path, taa, motion_blur, depth_of_field, denoise,
            front (error against time), asvgf, upscale, caustics, dispatch; irradiance_cache, fog and sky, which take
            minutes and are measured only where they are named; world for the last seven.
        cache: Folder where truth is kept; on a cluster, one that all machines share. [default: the user's cache]
        resume: Keep what is finished in OUT, as far as nothing it depends on has changed.
    """
    shape, settings, subjects = parse_size(size), parse_settings(set), parse_names(only)
    at_least("--frames", frames, 1, MOST_FRAMES)
    at_least("--samples", samples, 1, MOST_COUNT)
    check_name("--preset", preset, PRESETS)
    check_name("--composite", composite, COMPOSITES)
    for subject in subjects:
        check_name("--only", subject, (*SUBJECTS, "world"))
    for world in worlds or ("builtin",):
        check_world(world, (*parse_names(views), *parse_names(paths)))
    check_folder(out)
    if cache is not None:
        check_folder(cache, "--cache")
    check_cluster(spread or ClusterOptions())

    from gbufrt.commands.ablation import Plan
    from gbufrt.commands.ablation import ablate as measure
    from gbufrt.commands.recipe import Recipe

    recipe = Recipe(preset=preset, composite=composite, set=settings)
    results = measure(
        Plan(
            out=out, worlds=worlds or ("builtin",), views=parse_names(views), paths=parse_names(paths),
            size=shape, frames=frames, samples=samples, recipe=recipe, variants=parse_names(variants),
            sweeps=parse_names(sweep), only=subjects, cache=cache, resume=resume,
        ),
        spread,
    )  # fmt: skip
    from gbufrt.commands.ablation.report import show

    show(results)
    for record in results.failures:
        print(f"failed: {record.variant}, {record.subject} of {record.view}: {record.error}")
    drawn = ", front.svg" if any(record.subject == "front" and record.figures for record in results.records) else ""
    print(f"wrote report.html, report.json, report.csv{drawn} to {out}")
