"""Flights: a job and its pipeline, how its frames are made in order, and what a worker of a cluster does of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gbufrt.commands.flights.job import Left

if TYPE_CHECKING:
    from gbufrt.commands.arguments.options import FileOptions
    from gbufrt.commands.flights.job import Job
    from gbufrt.commands.flights.sampling import Sampling
    from gbufrt.commands.flights.shots import Shot
    from gbufrt.commands.progress import Tick
    from gbufrt.commands.recipe import Recipe
    from gbufrt.commands.session import Runner
    from gbufrt.frame import Frame
    from tracer.scene.scene import Scene
    from tracer.worlds.regions.stream import Stream


def stem(index: int) -> str:
    """File name of a frame without its ending."""
    return f"frame_{index:04d}"


@dataclass(frozen=True, kw_only=True)
class Flight:
    """A job, its world, and the pipeline that finishes its frames."""

    job: Job
    scene: Scene | Stream
    recipe: Recipe
    sampling: Sampling
    notes: dict[str, Any]
    """For the frames' headers."""
    debug: bool
    files: FileOptions

    def make(
        self,
        shot: Shot,
        runner: Runner,
        *,
        device: Any,
        doing: Callable[[str], Tick] = lambda _: lambda: None,
        known: Callable[[int], Frame] | None = None,
        ready: Callable[[], None] = lambda: None,
    ) -> Iterator[tuple[int, Frame]]:
        """A shot's frames by number, in order and finished, the lead-in included.

        The passes see a traced frame as its file will hold it, so that they can be run over the file with the same
        result.

        Args:
            shot: which frames.
            runner: of the recipe, without history.
            device: where to trace and run.
            doing: told what is being done; what it returns is called after each step.
            known: gives a frame that is not wanted, as it was before the passes; by default it is traced, as it is
                where frames leave light for others.
            ready: called before the passes run.
        """
        wanted, left = frozenset(shot.wanted), Left()
        for index in shot.frames:
            passes = f"passes of frame {index}"
            begins = index == shot.begin or self.job.standpoint.cuts_at(index)
            if begins and (self.sampling.paths or self.recipe.fog):  # a warm-up over one keeps its noise
                runner.settle(self._stills(index, runner.warmup, device, left, ready), doing(passes))
            if known is not None and index not in wanted and not self.sampling.cached:
                yield index, runner(left.keep(known(index)), doing(f"reading frame {index} again"))
                continue
            traced = left.keep(self._trace(index, device, left))  # after the stills, to find the light that they left
            doing(f"tracing frame {index}")()
            ready()
            yield index, runner(traced, doing(passes))

    def _trace(self, index: int, device: Any, left: Left, *, still: int | None = None) -> Frame:
        from gbufrt.commands.session import precision_of
        from gbufrt.files.precision import as_stored

        traced = self.job.trace(self.scene, index, device, self.sampling, still=still, left=left)
        return as_stored(traced, precision_of(self.files))

    def _stills(self, index: int, count: int, device: Any, left: Left, ready: Callable[[], None]) -> Iterator[Frame]:
        """Frames before one, with noise of their own, as if nothing had moved yet."""
        from gbufrt.pipeline import NOISE_PERIOD

        for before in range(count, 0, -1):
            still = self._trace(index, device, left, still=(index - before) % NOISE_PERIOD)
            ready()
            yield still

    def save(self, folder: Path, index: int, frame: Frame) -> None:
        """Write a finished frame's files."""
        from gbufrt.commands.session import save

        save(folder, stem(index), frame, notes=self.notes, debug=self.debug, files=self.files)


def shoot(flight: Flight, shot: Shot, folder: Path) -> Iterator[str]:
    """Make a shot in a worker of `gbufrt.commands.cluster`, and say which frame is done after each."""
    import torch

    from gbufrt.commands.session import Runner

    runner, wanted = Runner(flight.recipe.build(), flight.recipe.warmup), frozenset(shot.wanted)
    for index, frame in flight.make(shot, runner, device=torch.device("cpu")):
        if index in wanted:
            flight.save(folder, index, frame)
        yield f"frame {index}" if index in wanted else f"frame {index}, which leads in to frame {shot.wanted[0]}"
