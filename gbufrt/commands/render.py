"""`gbufrt render`: from a world to finished frames."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from gbufrt.commands.checks import check_folder, check_options, check_world
from gbufrt.commands.options import MOST_COUNT, MOST_FRAMES, Flag, PassOptions, Whole, at_least, parse_size

if TYPE_CHECKING:
    from gbufrt.commands.session import Runner
    from gbufrt.frame import Frame
    from tracer.scene.scene import Scene


def render(
    world: str = "builtin",
    *,
    out: Path,
    view: str | None = None,
    frames: Whole = 1,
    size: str = "960x540",
    time: float = 0.0,
    fps: float = 24.0,
    light_samples: Whole | None = None,
    seed: Annotated[Whole | None, Parameter(help="Seed of the built-in worlds: another one, another world.")] = None,
    resume: Flag = False,
    options: PassOptions | None = None,
) -> None:
    """Trace a world into G-buffers, run the passes over them, and write OUT/frame_0000.png and .exr for every frame.

    The EXR holds every channel and signal, so that `gbufrt post` can run other passes over it later. The first frame
    has no history: the passes run over it several times, as if it stood still (see --warmup).

    Args:
        world: Built-in world (builtin, terrain, ...) or a MagicaVoxel .vox file.
        out: Folder to write to; made where it is missing.
        view: Named view or camera path of the world; by default its first.
        frames: How many frames.
        size: Width x height in pixels.
        time: Seconds into the scene at the first frame.
        fps: Frames a second of the scene's time.
        light_samples: Shadow rays to each light per pixel; more is smoother and slower.
        resume: Go on after the last finished frame in OUT; finished frames are read again to restore the history.
    """
    options = options or PassOptions()
    job = Job(
        world=world,
        view=view,
        size=parse_size(size),
        frames=frames,
        time=time,
        fps=fps,
        samples=light_samples,
        seed=seed,
    )
    job.check()
    check_options(options)
    check_folder(out)

    from gbufrt.commands.ahead import compile_ahead
    from gbufrt.commands.progress import progress
    from gbufrt.commands.session import Recipe, Runner, bare, open_device, save

    recipe = Recipe.of(options)
    device = open_device(options.device)
    runner = Runner(recipe.build(), recipe.warmup)
    kernels_are_ready = compile_ahead(recipe, runner.pipeline, options.device)
    scene = job.load().to(device)
    jitter = frames > 1 and wants_jitter(runner)
    notes = {"render": job.notes(), "pipeline": recipe.to_notes()}
    missing = unfinished(out, frames, notes, jitter=jitter) if resume else list(range(frames))
    if not missing:
        print(f"all {frames} frames are in {out} already")
        return
    anew = set(missing)
    with progress("render", len(missing) + runner.runs(missing[-1] + 1)) as doing:
        for index in range(missing[-1] + 1):
            if index not in anew:
                runner(bare(_read(out, index)).to(device), doing(f"reading frame {index} again"))
                continue
            traced = job.trace(scene, index, device, jitter, doing(f"tracing frame {index}"))
            kernels_are_ready()
            result = runner(traced, doing(f"passes of frame {index}"))
            save(out, stem(index), result, notes=notes, debug=options.debug)
    _tell(out, missing, recipe.warmup)


def _tell(out: Path, made: list[int], warmup: int) -> None:
    """Say what has been written."""
    if warmup and made[0] == 0:
        times = "once" if warmup == 1 else f"{warmup} times"
        print(f"the passes ran {times} over frame 0, standing still, before it counted (--warmup)")
    first, last = out / stem(made[0]), stem(made[-1])
    if len(made) > 1:
        print(f"wrote {len(made)} frames to {out} ({first.name}.png and .exr to {last}.png and .exr)")
    else:
        print(f"wrote {first}.png, the picture, and {first}.exr, with everything that led to it")


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
        check_world(self.world, () if self.view is None else (self.view,), seed=self.seed)

    def load(self) -> Scene:
        """The world.

        Raises:
            ValueError: there is no such world or view, or nothing in it.
            FileNotFoundError: there is no such file.
        """
        from tracer.worlds import WORLDS, builtin, load

        if self.seed is None:
            scene = load(self.world)
        elif self.world == "builtin" or self.world in WORLDS:
            scene = WORLDS.get(self.world, builtin)(seed=self.seed)
        else:
            raise ValueError(f"--seed is for built-in worlds ({', '.join(WORLDS)}); leave it out for {self.world}")
        if scene.world.empty and not scene.instances:
            raise ValueError(f"world {self.world!r} is empty: it holds no voxels; give one that does")
        if not scene.views:
            raise ValueError(f"world {self.world!r} has no views to look from")
        if self.view is not None and self.view not in scene.views:
            raise ValueError(f"no view {self.view!r} in world {self.world!r}; it has {', '.join(scene.views)}")
        return scene

    def notes(self) -> dict[str, Any]:
        """What a frame depends on, as JSON values."""
        keys = ("world", "view", "time", "fps", "samples", "seed")
        return {"size": list(self.size), **{key: getattr(self, key) for key in keys}}

    def trace(self, scene: Scene, index: int, device: Any, jitter: bool, tick: Any) -> Frame:
        """G-buffer and light of one frame."""
        from gbufrt.noise.noise import halton_jitter
        from tracer.frames import render as trace_frame

        view = scene.views[self.view or next(iter(scene.views))]

        def camera(number: int) -> Any:
            posed = view.camera(self.time + number / self.fps, size=self.size)
            return posed.with_jitter(halton_jitter(number) if jitter else None).to(device)

        more = {} if self.samples is None else {"light_samples": self.samples}
        frame = trace_frame(
            scene,
            camera(index),
            previous_camera=camera(index - 1),
            time=self.time + index / self.fps,
            previous_time=self.time + (index - 1) / self.fps,
            index=index,
            **more,
        )
        tick()
        return frame


def wants_jitter(runner: Runner) -> bool:
    """Whether a pass averages jittered frames into an anti-aliased one."""
    return any(type(stage).__name__ == "TAA" for _, stage in runner.pipeline.passes())


def stem(index: int) -> str:
    """File name of a frame without its ending."""
    return f"frame_{index:04d}"


def unfinished(out: Path, frames: int, notes: dict[str, Any], *, jitter: bool) -> list[int]:
    """The frames not finished in ``out``; a finished one has a complete EXR, and its PNG beside it.

    Args:
        out: the folder.
        frames: how many there are to be.
        notes: what they must have been made with.
        jitter: whether their camera must be jittered.

    Raises:
        ValueError: a frame there was made with other options, so that the rest would not fit it.
    """
    from gbufrt.files.exr import read_exr, read_notes

    missing = []
    for index in range(frames):
        path = out / f"{stem(index)}.exr"
        try:
            found = read_notes(path)
            frame = read_exr(path)
        except (FileNotFoundError, ValueError):  # not there, or damaged since: make it again
            missing.append(index)
            continue
        _check_fits(path, found, notes)
        if (frame.gbuffer.camera.jitter is not None) != jitter:
            what = "a still, without the jitter of a sequence" if jitter else "part of a jittered sequence, not a still"
            raise ValueError(f"cannot resume: {path} is {what}; use another --out")
        if not _is_picture(path.with_suffix(".png"), frame.gbuffer.camera.size):
            missing.append(index)
    return missing


def _check_fits(path: Path, found: dict[str, Any], notes: dict[str, Any]) -> None:
    for part, wanted in notes.items():
        stored = found.get(part)
        for key, value in wanted.items():
            there = stored.get(key) if isinstance(stored, dict) else None
            if there != value:
                raise ValueError(f"cannot resume: {path} has {key} {there!r}, not {value!r}; use another --out")


def _is_picture(path: Path, size: tuple[int, int]) -> bool:
    from PIL import Image

    try:
        with Image.open(path) as picture:
            picture.load()
            return picture.size == (size[1], size[0])
    except (OSError, ValueError, SyntaxError):  # not there, or damaged: Pillow raises SyntaxError for broken PNGs
        return False


def _read(out: Path, index: int) -> Frame:
    from gbufrt.files.exr import read_exr

    return read_exr(out / f"{stem(index)}.exr")
