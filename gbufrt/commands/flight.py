"""Flights: what is to be traced, how its frames are made in order, and the shots that workers make on their own."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gbufrt.commands.checks import WINDOW, check_part, check_world
from gbufrt.commands.options import MOST_COUNT, MOST_FRAMES, DayOptions, FileOptions, FogOptions, PartOptions, at_least
from gbufrt.names import unknown

if TYPE_CHECKING:
    from gbufrt.commands.progress import Tick
    from gbufrt.commands.session import Recipe, Runner
    from gbufrt.frame import Frame
    from tracer.scene.scene import Scene, View
    from tracer.worlds.stream import Stream

LEAD_IN = 64
"""Frames that a shot begins early. The pictures after a seam are then 52 dB from those of one run, at 960x540 (47 with
48 frames): GI's running mean, the slowest history, goes over 33 frames. More runs over the first frame (--warmup) do
not replace them."""
BOUNCES = 4  # of sampled light, as `tracer.path_trace` has by default
LONGEST = 256  # frames of a shot: so much is lost with its worker. Longer only where the lead-in would be a quarter


@dataclass(frozen=True, kw_only=True)
class Job:
    """What is to be traced."""

    world: str
    view: str | None
    size: tuple[int, int]
    frames: int
    time: float
    fps: float
    samples: int | None
    seed: int | None
    eye: tuple[float, float, float] | None = None
    target: tuple[float, float, float] | None = None
    fov: float | None = None
    part: PartOptions = field(default_factory=PartOptions)
    day: DayOptions = field(default_factory=DayOptions)
    fog: FogOptions = field(default_factory=FogOptions)

    def check(self) -> None:
        """Check the values, as far as possible without loading the world.

        Raises:
            ValueError: a number that makes no sense; there is no such world or view.
            FileNotFoundError: there is no such file.
        """
        at_least("--frames", self.frames, 1, MOST_FRAMES)
        at_least("--time", self.time, 0.0)
        at_least("--fps", self.fps, 1e-3)
        if self.samples is not None:
            at_least("--light-samples", self.samples, 1, MOST_COUNT)
        if (self.eye is None) != (self.target is None) or (self.eye is not None and self.view is not None):
            raise ValueError("--eye and --target go together, in place of --view; give both of them or a view")
        if self.eye is not None and self.eye == self.target:
            raise ValueError(f"--target must not be where --eye is, got {self.target} for both")
        if self.fov is not None and not 0.1 <= self.fov <= 170:
            raise ValueError(f"--fov must be 0.1 to 170 degrees, got {self.fov:g}")
        if self.part.window is not None:
            at_least("--window", self.part.window, *WINDOW)
        check_part(self.world, self.part.parsed())
        self.day.parsed()
        self.fog.parsed()
        check_world(self.world, () if self.view is None else (self.view,), seed=self.seed)

    def load(self) -> Scene | Stream:
        """The world, or with a window what reads it as the camera flies.

        Raises:
            ValueError: there is no such world or view, or nothing in it.
            FileNotFoundError: there is no such file.
        """
        from tracer.worlds import WORLDS, builtin, load
        from tracer.worlds.stream import stream

        if self.part.window is not None:
            scene = stream(self.world, **self.part.parsed())
        elif self.seed is None:
            scene = load(self.world, **self.part.parsed())
        elif self.world == "builtin" or self.world in WORLDS:
            scene = WORLDS.get(self.world, builtin)(seed=self.seed)
        else:
            raise ValueError(f"--seed is for built-in worlds ({', '.join(WORLDS)}); leave it out for {self.world}")
        if (when := self.day.parsed()) is not None:
            from tracer.scene.daylight import SunPath, at_hour

            path = SunPath(**dict(zip(("zenith", "azimuth"), when.pop("path", ()), strict=False)))
            scene = at_hour(scene, **when, path=path)
        if self.day.rain is not None:
            from tracer.weather.rain import raining

            scene = raining(scene, self.day.rain)
        if self.day.waves is not None:
            from tracer.scene.weather import Waves

            scene = replace(scene, waves=Waves(amplitude=self.day.waves))
        if (fog := self.fog.parsed()) is not None:
            from tracer.scene.fog import Fog

            base = self.eye[1] if self.eye is not None else 0.0
            if self.eye is None and scene.views:
                view = scene.views.get(self.view or next(iter(scene.views)))
                base = base if view is None else float(view.eye(self.time)[1])
            scene = replace(scene, fog=Fog(extinction=fog["extinction"], falloff=fog["falloff"], base=base))
        if scene.empty:
            raise ValueError(f"world {self.world!r} is empty: it holds no voxels; give one that does")
        if not scene.views and self.eye is None:
            raise ValueError(f"world {self.world!r} has no views to look from")
        if self.view is not None and self.view not in scene.views:
            raise ValueError(unknown("view", self.view, f"world {self.world!r}", scene.views))
        return scene

    def notes(self) -> dict[str, Any]:
        """What a frame depends on, as JSON values."""
        keys = ("world", "view", "time", "fps", "samples", "seed")
        camera = {key: value for key in ("eye", "target", "fov") if (value := getattr(self, key)) is not None}
        camera = {key: list(value) if isinstance(value, tuple) else value for key, value in camera.items()}
        part = {
            key: value
            for key, value in (asdict(self.part) | asdict(self.day) | asdict(self.fog)).items()
            if value is not None
        }
        return {"size": list(self.size), **{key: getattr(self, key) for key in keys}, **camera, **part}

    def seen_from(self, scene: Scene | Stream) -> View:
        """Where the camera is and looks to: a view of the scene, or `eye` and `target`."""
        from tracer.scene.scene import View

        if self.eye is not None and self.target is not None:
            eye, target = self.eye, self.target
            return View(eye=lambda _: eye, target=lambda _: target, fov_y=View.fov_y if self.fov is None else self.fov)
        view = scene.views[self.view or next(iter(scene.views))]
        return view if self.fov is None else replace(view, fov_y=self.fov)

    def trace(
        self, scene: Scene | Stream, index: int, device: Any, sampling: Sampling, *, still: int | None = None
    ) -> Frame:
        """G-buffer and light of one frame.

        Args:
            scene: the world.
            index: which frame.
            device: where to trace.
            sampling: how.
            still: number of a frame that stands as if it were this one, with noise of its own.
        """
        from gbufrt.noise.noise import halton_jitter
        from tracer.frames import render as trace_frame
        from tracer.frames import unlit
        from tracer.paths.sampled import sampled

        view, number = self.seen_from(scene), index if still is None else still
        before, size = index - (still is None), sampling.rendered(self.size)

        def camera(at: int, turn: int) -> Any:
            posed = view.camera(self.time + at / self.fps, size=size)
            jitter = halton_jitter(turn, length=sampling.jitter) if sampling.jitter else None
            return posed.with_jitter(jitter).to(device)

        more = {} if self.samples is None else {"light_samples": self.samples}
        there = scene.around(view.eye(self.time + index / self.fps))
        frame = trace_frame(
            there,
            camera(index, number),
            previous_camera=camera(before, number - 1),
            time=self.time + index / self.fps,
            previous_time=self.time + before / self.fps,
            index=number,
            **({"light_samples": 1} if sampling.paths else more),
        )
        if not sampling.paths:
            return frame
        last = None
        if still is None and index > 0:  # traced again, so that no frame needs another's files
            last = unlit(there, camera(before, before), time=self.time + before / self.fps, index=before)
        return without_ambient(sampled(there, frame, before=last, bounces=BOUNCES))


@dataclass(frozen=True, kw_only=True)
class Sampling:
    """How a flight's frames are sampled."""

    ratio: float = 1.0
    """Sides of the picture over those of what is traced."""
    jitter: int = 0
    """Frames after which the camera's jitter repeats; 0 for none."""
    paths: bool = False
    """Whether light comes by one sample a pixel, diffuse and specular apart, with replayed ones of the frame before."""

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


def without_ambient(frame: Frame) -> Frame:
    """The frame without open sky, which sampled light holds, and the same of what lies behind."""
    behind = None if frame.behind is None else without_ambient(frame.behind)
    return frame.replace(ambient=None, behind=behind)


def stem(index: int) -> str:
    """File name of a frame without its ending."""
    return f"frame_{index:04d}"


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
            known: gives a frame that is not wanted, as it was before the passes; by default it is traced.
            ready: called before the passes run.
        """
        wanted = frozenset(shot.wanted)
        for index in shot.frames:
            stills = self._stills(index, runner.warmup, device) if self.sampling.paths and index == shot.begin else ()
            if known is not None and index not in wanted:
                yield index, runner(known(index), doing(f"reading frame {index} again"), stills)
                continue
            traced = self._trace(index, device)
            doing(f"tracing frame {index}")()
            ready()
            yield index, runner(traced, doing(f"passes of frame {index}"), stills)

    def _trace(self, index: int, device: Any, *, still: int | None = None) -> Frame:
        from gbufrt.commands.session import precision_of
        from gbufrt.files.precision import as_stored

        traced = self.job.trace(self.scene, index, device, self.sampling, still=still)
        return as_stored(traced, precision_of(self.files))

    def _stills(self, index: int, count: int, device: Any) -> Iterator[Frame]:
        """Frames before one, with noise of their own, as if nothing had moved yet."""
        from gbufrt.pipeline import NOISE_PERIOD

        for before in range(count, 0, -1):
            yield self._trace(index, device, still=(index - before) % NOISE_PERIOD)

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
