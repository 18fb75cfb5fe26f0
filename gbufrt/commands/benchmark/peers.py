"""`gbufrt bench --peers`: our spatial filters beside others that are installed, time and quality in one run."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from gbufrt.commands.ablation.denoising import has_oidn, joint_bilateral, oidn
from gbufrt.commands.benchmark.frames import HD
from gbufrt.commands.benchmark.process import timed
from gbufrt.frame import Frame

RADIUS = 2.0  # world units, of the ambient occlusion that is denoised
CLEAN_SAMPLES = 64
KERNEL = 9  # pixels, of kornia's filter and of ours
BILATERAL, ATROUS = "post.bilateral, 9x9", "post.atrous, 5 iterations"
KORNIA, OIDN_FAST = "kornia joint bilateral, 9x9", "OIDN, fast"

Filter = Callable[[], Tensor]


def compare_peers(size: tuple[int, int], repeats: int) -> list[dict[str, Any]]:
    """Denoise ambient occlusion of one ray a pixel, by each filter.

    Args:
        size: ``(H, W)``.
        repeats: runs that each median is taken over; one run before them does not count.

    Returns:
        For each filter its ``name``, ``ms`` and ``psnr`` in dB over the pixels that hit, against many rays.
    """
    from gbufrt.metrics.image import psnr

    noisy, clean = occlusion(size)
    hit = noisy.gbuffer.hit
    before = float(psnr(noisy.read("ao"), clean, hit))
    rows: list[dict[str, Any]] = [{"name": "nothing", "ms": 0.0, "psnr": before}]
    for name, run in filters(noisy).items():
        with torch.no_grad():
            found, ms = run(), timed(run, repeats)
        quality = float(psnr(torch.where(hit, found, clean).clamp(0, 1), clean, hit))
        rows.append({"name": name, "ms": ms, "psnr": quality})
    return rows


def time_filters(repeats: int) -> dict[str, float]:
    """Milliseconds of each filter at 1920x1080, over noise as ambient occlusion of one ray a pixel has it."""
    from tracer.gbuffers import gbuffer
    from tracer.worlds import builtin

    scene = builtin()
    g = gbuffer(scene, next(iter(scene.views.values())).camera(0.0, size=HD))
    noise = torch.rand(g.depth.shape, generator=torch.Generator().manual_seed(0))
    frame = Frame(gbuffer=g, ao=torch.where(g.hit, (noise < 0.6).float(), 1.0))
    with torch.no_grad():
        return {name: timed(run, repeats) for name, run in filters(frame).items()}


def time_oidn(path: Path, repeats: int) -> float | None:
    """Milliseconds of Intel Open Image Denoise over the light of a frame, at its best quality with clean albedo and
    normal; None where it is not installed.
    """
    from gbufrt.files.exr import read_exr

    if not has_oidn():
        return None
    frame = read_exr(path)
    g, light = frame.gbuffer, frame.read("radiance")
    albedo = torch.where(g.hit, frame.read("albedo"), 0.0)
    return timed(lambda: oidn(light, albedo, g.normal), repeats)


def occlusion(size: tuple[int, int]) -> tuple[Frame, Tensor]:
    """A frame of the built-in world with ``ao`` of one ray a pixel, and the same of many."""
    from tracer.gbuffers import gbuffer
    from tracer.truth.truth import ambient_occlusion
    from tracer.worlds import builtin

    scene = builtin()
    g = gbuffer(scene, next(iter(scene.views.values())).camera(0.0, size=size))
    noisy, clean = (
        ambient_occlusion(scene, g, poses=scene.poses([0.0]), radius=RADIUS, samples=samples, seed=seed)["ao"]
        for seed, samples in enumerate((1, CLEAN_SAMPLES))
    )
    return Frame(gbuffer=g, ao=noisy), clean


def filters(frame: Frame) -> dict[str, Filter]:
    """Each filter that is installed, of the frame's ``ao``, by its name."""
    from post import atrous, bilateral

    g, ao = frame.gbuffer, frame.read("ao")
    surface: dict[str, Any] = {"hit": g.hit, "camera": g.camera}
    found: dict[str, Filter] = {
        BILATERAL: lambda: bilateral(ao, g.depth, g.normal, radius=KERNEL // 2, **surface),
        ATROUS: lambda: atrous(ao, g.depth, g.normal, **surface)[0],
        KORNIA: lambda: joint_bilateral(ao, g, kernel=KERNEL),
    }
    if has_oidn():
        light, white = (plane.expand(-1, 3, -1, -1) for plane in (ao, torch.where(g.hit, 1.0, 0.0)))
        found[OIDN_FAST] = lambda: oidn(light, white, g.normal, quality="fast")[:, :1]
        found["OIDN, high"] = lambda: oidn(light, white, g.normal)[:, :1]
    return found
