"""Shots: consecutive frames that a worker makes in one go."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

LEAD_IN = 64
"""Frames that a shot begins early. The pictures after a seam are then 50 dB from those of one run, at 960x540 (47 with
48 frames): GI's running mean, the slowest history, goes over 33 frames. More runs over the first frame (--warmup) do
not replace them."""
LONGEST = 256  # frames of a shot: so much is lost with its worker. Longer only where the lead-in would be a quarter


@dataclass(frozen=True, kw_only=True)
class Shot:
    """Consecutive frames that are made in one go."""

    begin: int
    """The first frame that the passes see. Frames before the first wanted one are the lead-in: they fill histories."""
    wanted: tuple[int, ...]
    """The frames to write, ascending; at least one."""

    @property
    def frames(self) -> range:
        """All frames, the lead-in included."""
        return range(self.begin, self.wanted[-1] + 1)


def cut(frames: int, missing: Sequence[int], *, workers: int, lead_in: int) -> list[Shot]:
    """The shots that make the ``missing`` frames of a flight.

    Shots are as many as there are workers, and take equally long: the first has no lead-in, and more frames for that.
    Where they would be longer than `LONGEST`, each worker makes several, all as many. There are fewer where a shot
    would be less than half its lead-in, as that would cost more than it brings. Which frames belong to a shot, and
    where it begins, does not depend on what is missing: frames resumed with as many workers and as long a lead-in are
    what they would have been. For that, finished frames of a shot are made again up to its last missing one.
    """
    worth = (frames - lead_in) // max(lead_in // 2, 1)
    rounds = math.ceil(frames / (max(LONGEST, 4 * lead_in) * workers))
    count = min(max(min(workers, worth), 1) if rounds == 1 else rounds * workers, frames)
    first = math.ceil((frames + (count - 1) * lead_in) / count)
    starts = [0, *(first + (frames - first) * n // (count - 1) for n in range(count - 1))]
    shots, left = [], set(missing)
    for start, end in zip(starts, [*starts[1:], frames], strict=True):
        wanted = tuple(sorted(left & set(range(start, end))))
        if wanted:
            shots.append(Shot(begin=max(start - lead_in, 0), wanted=wanted))
    return shots
