"""Progressive means over samples, with their standard error."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import torch
from torch import Tensor

from gbufrt.numeric import check_counts, check_function, check_numbers

GROUPS = 16  # of consecutive samples; the spread of their means gives the error
FEWEST = 4  # groups needed before the error may end the sampling
WIDE = 1 << 15  # paths at a time: bounds memory, and keeps them near the cache

Values = dict[str, Tensor]
Estimate = Callable[[range], Values]
"""Maps a range of sample numbers to their sums, tensors of any shape, which are then changed."""
Progress = Callable[[int, int], object]
"""Called with the number of samples done, and of all."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Truth:
    """Path-traced means, by name: ``truth["ao"]``.

    Args:
        values: by name, ``(B, C, H, W)`` each.
        error: of each value, the standard error of its mean, same shape; inf where there is only one group of samples.
        samples: paths per pixel.
    """

    values: Mapping[str, Tensor]
    error: Mapping[str, Tensor]
    samples: int

    def __getitem__(self, name: str) -> Tensor:
        if name not in self.values:
            raise KeyError(f"no {name!r}; there are {', '.join(self.values)}")
        return self.values[name]


def converge(estimate: Estimate, *, samples: int, noise: float, pixels: int, progress: Progress | None) -> Truth:
    """Mean over samples, until all are taken or the error is small enough.

    Consecutive samples are grouped, up to `GROUPS` groups, and the error comes from the spread of the groups' means. A
    group of a low-discrepancy sequence is itself well spread, and the groups complement each other. So the reported
    error is, if anything, too large.

    Args:
        estimate: see `Estimate`.
        samples: at most so many.
        noise: stop earlier once the mean error of the first value is not above this.
        pixels: that are sampled; sets how many samples are taken at once.
        progress: see `Progress`.

    Returns:
        The means.

    Raises:
        TypeError: samples is no whole number, or noise no number.
        ValueError: samples is below 1, or noise negative.
    """
    check_counts(samples=samples)
    check_numbers(noise=noise)
    if progress is not None:
        check_function("progress", progress, "of the samples done and their number")
    if samples < 1:
        raise ValueError(f"samples must be at least 1, got {samples}")
    if not noise >= 0:
        raise ValueError(f"noise must be 0 (take all samples) or a standard error, got {noise}")
    group = 1 << max(0, (max(1, samples // GROUPS)).bit_length() - 1)
    block = max(1, min(group, WIDE // max(1, pixels)))
    mean: Values = {}
    spread: Values = {}
    done, groups = 0, 0

    def error() -> Values:
        return {name: (s / (max(groups - 1, 1) * done)).sqrt() for name, s in spread.items()}

    while done < samples:
        end = min(done + group, samples)
        count, share = end - done, (end - done) / end
        for name, total in _summed(estimate, done, end, block, samples, progress).items():
            if name not in mean:
                mean[name], spread[name] = torch.zeros_like(total), torch.zeros_like(total)
            change = total.div_(count).sub_(mean[name])
            mean[name].add_(change, alpha=share)
            spread[name].addcmul_(change, change, value=count * (1 - share))
        done, groups = end, groups + 1
        if noise > 0 and groups >= FEWEST and not _level(error()) > noise:
            break
    unknown = {name: torch.full_like(value, torch.inf) for name, value in mean.items()}
    return Truth(values=mean, error=unknown if groups < 2 else error(), samples=done)


def _summed(estimate: Estimate, begin: int, end: int, block: int, samples: int, progress: Progress | None) -> Values:
    sums: Values = {}
    for start in range(begin, end, block):
        stop = min(start + block, end)
        for name, value in estimate(range(start, stop)).items():
            sums[name] = sums[name] + value if name in sums else value
        if progress is not None:
            progress(stop, samples)
    return sums


def _level(error: Values) -> float:
    return float(next(iter(error.values())).mean())
