"""`gbufrt bench --peers`: our spatial filters beside others that are installed, time and quality in one run."""

from __future__ import annotations

import time
from collections.abc import Callable
from importlib.util import find_spec
from statistics import median
from typing import Any

import torch
from torch import Tensor

from gbufrt.frame import Frame
from gbufrt.gbuffer import GBuffer

RADIUS = 2.0  # world units, of the ambient occlusion that is denoised
CLEAN_SAMPLES = 64
KERNEL, SIGMA_GUIDE, SIGMA_SPACE = 9, 0.1, 4.0  # of kornia's filter, as wide as ours

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
            found, seconds = run(), []
            for _ in range(repeats):
                start = time.perf_counter()
                run()
                seconds.append(time.perf_counter() - start)
        quality = float(psnr(torch.where(hit, found, clean).clamp(0, 1), clean, hit))
        rows.append({"name": name, "ms": median(seconds) * 1e3, "psnr": quality})
    return rows


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
        "post.bilateral, 9x9": lambda: bilateral(ao, g.depth, g.normal, radius=KERNEL // 2, **surface),
        "post.atrous, 5 iterations": lambda: atrous(ao, g.depth, g.normal, **surface)[0],
        "kornia joint bilateral, 9x9": lambda: _kornia(ao, g),
    }
    if find_spec("pyoidn") is not None:
        found["OIDN, fast"] = lambda: _oidn(ao, g, "fast")
        found["OIDN, high"] = lambda: _oidn(ao, g, "high")
    return found


def _kornia(ao: Tensor, g: GBuffer) -> Tensor:
    from kornia.filters import joint_bilateral_blur

    near = torch.where(g.hit, 1 / g.depth, 0.0)
    guide = torch.cat([g.normal * 0.5, near / near.amax().clamp_min(1e-9)], dim=1)
    return joint_bilateral_blur(ao, guide, KERNEL, SIGMA_GUIDE, (SIGMA_SPACE, SIGMA_SPACE))


def _oidn(ao: Tensor, g: GBuffer, quality: str) -> Tensor:
    from pyoidn import denoise  # pyright: ignore[reportMissingImports]

    pixels = [plane[0].permute(1, 2, 0).contiguous() for plane in (ao.expand(-1, 3, -1, -1), g.normal)]
    flat = torch.where(g.hit, 1.0, 0.0)[0].permute(1, 2, 0).expand(-1, -1, 3).contiguous()
    found = denoise(pixels[0], flat, pixels[1], hdr=True, clean_aux=True, quality=quality)
    return found.permute(2, 0, 1)[None, :1]
