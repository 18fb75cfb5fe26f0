"""How frames are sampled: their size, the jitter of the camera, and light by paths."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from gbufrt.commands.recipe import Recipe
    from gbufrt.commands.session import Runner

JITTERS = 8  # samples of each pixel of the picture before the jitter repeats
TAA_JITTERS = 16


@dataclass(frozen=True, kw_only=True)
class Sampling:
    """How a flight's frames are sampled."""

    ratio: float = 1.0
    """Sides of the picture over those of what is traced."""
    jitter: int = 0
    """Frames after which the camera's jitter repeats; 0 for none."""
    paths: Literal["asvgf", "denoise"] | None = None
    """Which denoiser gets light of one path a pixel, and so in what form; None for direct light without noise."""
    cached: bool = False
    """Whether paths leave their light in the world, see `tracer.sampled_with_cache`."""

    def rendered(self, size: tuple[int, int]) -> tuple[int, int]:
        """What is traced of a picture of ``size`` ``(H, W)``.

        Raises:
            ValueError: the picture cannot be upscaled from whole pixels.
        """
        height, width = (max(1, round(side / self.ratio)) for side in size)
        if (round(height * self.ratio), round(width * self.ratio)) != size:
            fits = f"{round(width * self.ratio)}x{round(height * self.ratio)}"
            raise ValueError(
                f"--size {size[1]}x{size[0]} is no multiple of upscale.ratio {self.ratio:g}; {fits} is one"
            )
        return height, width


def sampling_of(runner: Runner, recipe: Recipe, frames: int) -> Sampling:
    """How the frames of a pipeline are sampled: jittered where a pass averages them, small where one upscales."""
    stages = {type(stage).__name__: stage for _, stage in runner.pipeline.passes()}
    paths: Any = recipe.denoiser if recipe.pipeline == "minecraft-rtx" else None
    upscale = stages.get("Upscale")
    if upscale is not None:
        ratio = upscale.tunables()["ratio"]
        return Sampling(ratio=ratio, jitter=round(JITTERS * ratio**2), paths=paths, cached=recipe.irradiance_cache)
    jitter = TAA_JITTERS if frames > 1 and "TAA" in stages else 0
    return Sampling(jitter=jitter, paths=paths, cached=recipe.irradiance_cache)
